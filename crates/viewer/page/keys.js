/** @file What keys do; `KEYS` is also what the help shows. */
import { store } from './store.js';

/** Radians that an arrow key turns. */
const STEP = Math.PI / 36;

/** @type {[string, string][]} for the help: keys, what they do */
export const KEYS = [
  ['← → ↑ ↓', 'Turn; with Shift, move aside'],
  ['+ −', 'Zoom in and out'],
  ['[ ]', 'Roll'],
  ['W A S D', 'Walk through'],
  ['1 2 3', 'Look from the front, the right, the top'],
  ['4 5 6', 'Look from the back, the left, below'],
  ['F', 'Fit what is visible'],
  ['P  O', 'Perspective, orthographic'],
  ['Space', 'Play and stop'],
  [',  .', 'Frame back, frame on'],
  ['M  N  B', 'Measure a distance, an angle; select by a box'],
  ['X', 'Cut by dragging'],
  ['Esc', 'Put the tool away, close'],
  ['Ctrl Z', 'Undo'],
  ['Ctrl Shift Z', 'Redo'],
  ['Ctrl S', 'Save'],
  ['?', 'This help'],
];

/** Directions that 1…6 look along. @type {import('./types.js').Vec3[]} */
export const VIEWS = [[0, 1, 0], [-1, 0, 0], [0, 0, -1], [0, -1, 0], [1, 0, 0], [0, 0, 1]];

/** @param {import('./camera.js').Camera} camera @param {boolean} mark */
const look = (camera, mark) => store.look(camera, mark);

/** @type {Record<string, (camera: import('./camera.js').Camera, shift: boolean) => import('./camera.js').Camera>} */
const MOVES = {
  ArrowLeft: (c, shift) => (shift ? c.pan(0.03, 0) : c.orbit(STEP, 0)),
  ArrowRight: (c, shift) => (shift ? c.pan(-0.03, 0) : c.orbit(-STEP, 0)),
  ArrowUp: (c, shift) => (shift ? c.pan(0, 0.03) : c.orbit(0, -STEP)),
  ArrowDown: (c, shift) => (shift ? c.pan(0, -0.03) : c.orbit(0, STEP)),
  '+': (c) => c.zoom(1 / 1.1),
  '=': (c) => c.zoom(1 / 1.1),
  '-': (c) => c.zoom(1.1),
  '[': (c) => c.roll(-STEP),
  ']': (c) => c.roll(STEP),
  w: (c) => c.walk(0.05),
  s: (c) => c.walk(-0.05),
  a: (c) => c.pan(0.04, 0),
  d: (c) => c.pan(-0.04, 0),
};

/** @type {Record<string, () => void>} */
const ACTIONS = {
  f: () => store.fit(),
  p: () => project('perspective'),
  o: () => project('orthographic'),
  ' ': () => store.tell('toggle-play'),
  ',': () => store.tell('step', -1),
  '.': () => store.tell('step', 1),
  m: () => store.use('distance'),
  n: () => store.use('angle'),
  b: () => store.use('box'),
  x: () => store.has('section') && store.use('cut'),
  '?': () => store.tell('help'),
  Escape: () => {
    store.use('move');
    store.picked = null;
    store.tell('picked');
  },
};
VIEWS.forEach((direction, i) => { ACTIONS[String(i + 1)] = () => store.fit(turned(direction)); });

/** A direction for a world with z up, in this world. @param {import('./types.js').Vec3} v @returns {import('./types.js').Vec3} */
export function turned([x, y, z]) {
  const axis = store.get('camera.up_axis');
  if (axis === 'y') return [x, z, -y];
  return axis === 'x' ? [z, y, -x] : [x, y, z];
}

/** @param {string} kind */
export function project(kind) {
  const camera = store.camera;
  if (camera && camera.resolved.projection !== kind) look(camera.projected(), true);
}

/** Whether an element wants the keys for itself. @param {any} target */
function writes(target) {
  return target.closest?.('input, textarea, select, [contenteditable], dialog, [role=slider], [role=listbox]');
}

/** @type {Set<string>} keys that move the camera and are down */
const down = new Set();

addEventListener('keydown', (e) => {
  const key = e.key.length === 1 ? e.key.toLowerCase() : e.key;
  const command = e.ctrlKey || e.metaKey;
  if (command && key === 's') {
    e.preventDefault();
    store.tell('save');
    return;
  }
  if (writes(e.target) || document.querySelector('dialog[open], :popover-open')) {
    if (key === 'Escape') /** @type {HTMLElement} */ (e.target).blur();
    return;
  }
  if (command && (key === 'z' || key === 'y')) {
    e.preventDefault();
    const what = key === 'y' || e.shiftKey ? 'redo' : 'undo';
    if (store[what] > 0) store.ask(what);
    return;
  }
  if (command || e.altKey || !store.line?.open) return;
  // On a button, Space and Enter press it.
  const button = /** @type {Element} */ (e.target).closest('button, a, summary, [role=tab]');
  if (button && [' ', 'Enter', 'ArrowLeft', 'ArrowRight', 'ArrowUp', 'ArrowDown'].includes(key)) return;
  if (MOVES[key] && store.camera) {
    e.preventDefault();
    down.add(key);
    look(MOVES[key](store.camera, e.shiftKey), false);
  } else if (ACTIONS[key] && !e.repeat) {
    e.preventDefault();
    ACTIONS[key]();
  }
});

addEventListener('keyup', (e) => {
  const key = e.key.length === 1 ? e.key.toLowerCase() : e.key;
  if (down.delete(key) && down.size === 0 && store.camera) look(store.camera, true);
});

addEventListener('blur', () => {
  if (down.size && store.camera) look(store.camera, true);
  down.clear();
});
