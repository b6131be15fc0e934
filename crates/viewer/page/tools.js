/** @file The tools of the canvas: measuring, selecting by a box, cutting by a drag. */
import { follow, within } from './dom.js';
import { store } from './store.js';
import { newSection } from './sections.js';

/** How many particles a measure takes. @type {Record<string, number>} */
const POINTS = { distance: 2, angle: 3 };

/** @type {Record<string, string>} what to do with a tool */
const HINTS = {
  distance: 'Click two particles: their distance. Esc ends.',
  angle: 'Click three particles: the angle at the second. Esc ends.',
  box: 'Drag a box around particles. Esc ends.',
  cut: 'Drag from a point of the plane to where the kept side is. Esc ends.',
};

store.addEventListener('tool', () => {
  store.tell('hint', HINTS[store.tool] ?? null);
  store.tell('rubber', null);
  // A measure that was begun and not ended is given up.
  store.measures = store.measures.filter((m) => m.points.length === POINTS[m.kind]);
  store.tell('measures');
});

/** The left button goes down with a tool in hand. @param {HTMLCanvasElement} canvas @param {PointerEvent} down */
export function toolPress(canvas, down) {
  if (POINTS[store.tool]) {
    // What becomes a movement of two fingers is no click.
    const near = (/** @type {PointerEvent} */ e) => Math.hypot(e.clientX - down.clientX, e.clientY - down.clientY) < 5;
    follow(down, () => {}, (e) => e.type === 'pointerup' && near(e) && measure(canvas, down));
    return;
  }
  const from = within(canvas, down);
  let to = from;
  follow(down, (e) => {
    to = within(canvas, e);
    store.tell('rubber', { kind: store.tool, from, to });
  }, (e) => {
    store.tell('rubber', null);
    const far = Math.hypot((to.x - from.x) * canvas.clientWidth, (to.y - from.y) * canvas.clientHeight) > 6;
    if (e.type !== 'pointerup' || !far) return;
    if (store.tool === 'box') select(from, to);
    else cut(from, to);
  });
}

/** @param {HTMLCanvasElement} canvas @param {PointerEvent} down */
async function measure(canvas, down) {
  const kind = store.tool;
  const answer = await store.ask('pick', within(canvas, down));
  if (!answer?.picked) {
    if (answer) store.tell('hint', `No particle there. ${HINTS[kind]}`);
    return;
  }
  const open = store.measures.at(-1);
  if (open && open.kind === kind && open.points.length < POINTS[kind]) open.points.push(answer.picked);
  else store.measures.push({ kind, points: [answer.picked] });
  store.tell('measures');
  const now = /** @type {any} */ (store.measures.at(-1));
  if (now.points.length === POINTS[kind]) store.tell('panel', 'ask');
}

/** @param {{x: number, y: number}} a @param {{x: number, y: number}} b */
async function select(a, b) {
  const box = [Math.min(a.x, b.x), Math.min(a.y, b.y), Math.max(a.x, b.x), Math.max(a.y, b.y)];
  const answer = await store.ask('select', { box });
  if (!answer || !store.camera) return;
  store.selection = { ...answer, box, camera: store.camera };
  store.tell('selection');
  store.tell('panel', 'ask');
  store.use('move');
}

/** @param {{x: number, y: number}} a @param {{x: number, y: number}} b */
async function cut(a, b) {
  const answer = await store.ask('drag', { from: [a.x, a.y], to: [b.x, b.y] });
  if (!answer) return;
  newSection(answer.point, answer.normal);
  store.use('move');
  store.tell('panel', 'cut');
}

/** The length of a distance or the size of an angle. @param {{kind: string, points: import('./types.js').Picked[]}} measure */
export function measured({ kind, points }) {
  if (points.length < POINTS[kind]) return undefined;
  const [a, b, c] = points.map((p) => p.position);
  const to = (/** @type {number[]} */ p, /** @type {number[]} */ q) => q.map((v, i) => v - p[i]);
  if (kind === 'distance') return Math.hypot(...to(a, b));
  const [u, v] = [to(b, a), to(b, c)];
  const dot = u.reduce((s, n, i) => s + n * v[i], 0);
  return (Math.acos(Math.max(-1, Math.min(1, dot / (Math.hypot(...u) * Math.hypot(...v))))) * 180) / Math.PI;
}
