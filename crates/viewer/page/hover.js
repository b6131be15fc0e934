/** @file The label of what the mouse rests on. */
import { h, within } from './dom.js';
import { number, values } from './format.js';
import { store } from './store.js';

/** Milliseconds of rest. */
const REST = 350;

/** @type {number|undefined} */
let timer;
let asked = 0;
/** @type {HTMLElement} */
let label;

/** The pointer moved. @param {HTMLCanvasElement} canvas @param {PointerEvent} e */
export function hover(canvas, e) {
  leave();
  timer = window.setTimeout(() => ask(canvas, e), REST);
}

/** Takes the label away. */
export function leave() {
  clearTimeout(timer);
  asked += 1;
  label?.remove();
}

/** @param {HTMLCanvasElement} canvas @param {PointerEvent} e */
async function ask(canvas, e) {
  if (!store.line?.open || store.tool === 'cut' || store.tool === 'box') return;
  const mine = ++asked;
  let answer;
  try {
    answer = await store.line.ask('pick', within(canvas, e));
  } catch {
    return;
  }
  if (mine !== asked || !answer.picked) return;
  const stage = /** @type {HTMLElement} */ (canvas.parentElement);
  const box = stage.getBoundingClientRect();
  label = h('div', { class: 'hover' }, ...words(answer.picked));
  stage.append(label);
  const x = e.clientX - box.left + 14;
  const y = e.clientY - box.top + 14;
  label.style.left = `${Math.min(x, box.width - label.offsetWidth - 8)}px`;
  label.style.top = `${Math.min(y, box.height - label.offsetHeight - 8)}px`;
}

/** The kind of a particle in a word, if it has one. @param {import('./types.js').Picked} picked */
export function kind(picked) {
  const type = picked.element ?? picked.type;
  if (type === undefined || type === null) return '';
  return typeof type === 'number' ? `Type ${type}` : String(type);
}

/** @param {import('./types.js').Picked} picked */
function words(picked) {
  const by = store.get(`system.${picked.system}.color.by`);
  const value = picked.properties?.[by];
  const name = picked.id !== undefined && picked.id !== null ? `#${picked.id}` : `index ${picked.index}`;
  return [
    h('b', {}, kind(picked) || picked.name || 'Particle'), ` ${name}`,
    value !== undefined ? h('div', {}, `${by} ${values(value)}`) : h('div', {}, picked.position.map((p) => number(p, 4)).join('  ')),
  ];
}
