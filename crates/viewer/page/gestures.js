/**
 * @file What dragging, turning the wheel and touching do to the camera, by the habits of ParaView and OVITO.
 *
 * Left turns, right or Ctrl zooms, middle or Shift moves, both wheel directions zoom to the pointer; one
 * finger turns, two move, zoom and roll. A click asks, a double click goes to the particle. With another
 * tool in hand the left button is the tool's.
 */
import { follow, within } from './dom.js';
import { store } from './store.js';
import { toolPress } from './tools.js';
import { hover, leave } from './hover.js';

/** Radians for a drag across the picture's height. */
const TURN = Math.PI;
/** How far a click may slip, pixels. */
const SLIP = 4;
/** A movement by the wheel has ended after so many milliseconds. */
const WHEEL_REST = 250;

/** @param {HTMLCanvasElement} canvas */
export function gestures(canvas) {
  /** @type {Map<number, PointerEvent>} */
  const touches = new Map();
  canvas.addEventListener('contextmenu', (e) => e.preventDefault());
  canvas.addEventListener('pointerdown', (e) => {
    canvas.focus({ preventScroll: true });
    leave();
    touches.set(e.pointerId, e);
    const gone = () => touches.delete(e.pointerId);
    canvas.addEventListener('pointerup', (u) => u.pointerId === e.pointerId && gone(), { once: true });
    if (e.pointerType === 'touch' && touches.size > 1) return pinch(canvas, touches);
    if (e.button === 0 && !e.ctrlKey && !e.shiftKey && store.tool !== 'move') return toolPress(canvas, e);
    press(canvas, e, touches);
  });
  canvas.addEventListener('pointercancel', (e) => touches.delete(e.pointerId));
  canvas.addEventListener('lostpointercapture', (e) => touches.delete(e.pointerId));
  canvas.addEventListener('pointermove', (e) => {
    if (touches.has(e.pointerId)) touches.set(e.pointerId, e);
    if (e.pointerType === 'mouse' && e.buttons === 0) hover(canvas, e);
  });
  canvas.addEventListener('pointerleave', leave);
  canvas.addEventListener('dblclick', (e) => center(canvas, e));
  wheel(canvas);
}

/** @param {PointerEvent} e */
function kind(e) {
  if (e.button === 1 || e.shiftKey) return 'pan';
  if (e.button === 2 || e.ctrlKey || e.metaKey) return 'zoom';
  return 'orbit';
}

/** @param {HTMLCanvasElement} canvas @param {PointerEvent} down @param {Map<number, PointerEvent>} touches */
function press(canvas, down, touches) {
  if (down.button === 1) down.preventDefault();
  const how = kind(down);
  const start = within(canvas, down);
  const height = canvas.clientHeight;
  let [last, moved] = [down, false];
  follow(down, (e) => {
    // A second finger takes over.
    if (touches.size > 1) [last, moved] = [e, true];
    if (touches.size > 1) return;
    const far = Math.hypot(e.clientX - down.clientX, e.clientY - down.clientY) > SLIP;
    const camera = store.camera;
    if ((!moved && !far) || !camera) return;
    moved = true;
    const [dx, dy] = [(e.clientX - last.clientX) / height, (e.clientY - last.clientY) / height];
    last = e;
    if (how === 'orbit') store.look(camera.orbit(dx * TURN, -dy * TURN), false);
    else if (how === 'pan') store.look(camera.pan(dx, dy), false);
    else store.look(camera.zoom(Math.exp(2.5 * dy), start.x, start.y), false);
  }, (e) => {
    if (moved && store.camera) store.look(store.camera, true);
    else if (e.type === 'pointerup' && down.button === 0) click(start);
  });
}

/** Asks for the particle. @param {{x: number, y: number}} at */
async function click({ x, y }) {
  const answer = await store.ask('pick', { x, y });
  if (answer === undefined) return;
  store.picked = answer.picked;
  store.tell('picked');
}

/** Goes round the particle from now on. @param {HTMLCanvasElement} canvas @param {MouseEvent} e */
async function center(canvas, e) {
  if (store.tool !== 'move') return;
  const answer = await store.ask('pick', within(canvas, e));
  if (!answer?.picked || !store.camera) return;
  store.look(store.camera.about(answer.picked.position), true);
}

/** @param {HTMLCanvasElement} canvas */
function wheel(canvas) {
  /** @type {number|undefined} */
  let rest;
  canvas.addEventListener('wheel', (e) => {
    e.preventDefault();
    const camera = store.camera;
    if (!camera) return;
    leave();
    const lines = e.deltaMode === WheelEvent.DOM_DELTA_LINE ? 33 : e.deltaMode === WheelEvent.DOM_DELTA_PAGE ? 400 : 1;
    const { x, y } = within(canvas, e);
    const factor = Math.exp(Math.max(-300, Math.min(300, e.deltaY * lines)) / 600);
    store.look(camera.zoom(factor, x, y), false);
    clearTimeout(rest);
    rest = window.setTimeout(() => store.camera && store.look(store.camera, true), WHEEL_REST);
  }, { passive: false });
}

/** Two fingers. @param {HTMLCanvasElement} canvas @param {Map<number, PointerEvent>} touches */
function pinch(canvas, touches) {
  const ids = [...touches.keys()].slice(0, 2);
  const state = () => {
    const [a, b] = ids.map((id) => /** @type {PointerEvent} */ (touches.get(id)));
    return {
      x: (a.clientX + b.clientX) / 2,
      y: (a.clientY + b.clientY) / 2,
      apart: Math.hypot(b.clientX - a.clientX, b.clientY - a.clientY) || 1,
      angle: Math.atan2(b.clientY - a.clientY, b.clientX - a.clientX),
    };
  };
  let last = state();
  const done = new AbortController();
  canvas.addEventListener('pointermove', (e) => {
    const camera = store.camera;
    if (!ids.includes(e.pointerId) || !camera) return;
    const now = state();
    const at = within(canvas, { clientX: now.x, clientY: now.y });
    const height = canvas.clientHeight;
    const turned = Math.atan2(Math.sin(now.angle - last.angle), Math.cos(now.angle - last.angle));
    store.look(camera
      .pan((now.x - last.x) / height, (now.y - last.y) / height)
      .zoom(last.apart / now.apart, at.x, at.y)
      .roll(-turned), false);
    last = now;
  }, done);
  for (const name of ['pointerup', 'pointercancel']) {
    canvas.addEventListener(name, (e) => {
      if (!ids.includes(/** @type {PointerEvent} */ (e).pointerId)) return;
      done.abort();
      if (store.camera) store.look(store.camera, true);
    }, done);
  }
}
