/** @file Cutting planes: the list `section` of the scene, and what is done to it. */
import { store } from './store.js';
import { corners, dot, scale, add, sub, unit, across, cross } from './vector.js';
import { tidy } from './format.js';

/** @typedef {import('./types.js').Vec3} Vec3 */
/** @typedef {import('./types.js').Section} Section */

/** The planes. @returns {Section[]} */
export const sections = () => store.get('section') ?? [];

/** Takes these planes from now on. @param {Section[]} list @param {boolean} [mark] */
export function setSections(list, mark = true) {
  store.change({ section: list }, mark);
}

/** Changes one plane. @param {number} index @param {Partial<Section>} changes @param {boolean} [mark] */
export function setSection(index, changes, mark = true) {
  setSections(sections().map((s, i) => (i === index ? { ...s, ...changes } : s)), mark);
}

/** Adds a plane, and holds it. @param {Vec3} point @param {Vec3} normal */
export function newSection(point, normal) {
  const base = /** @type {any} */ (store.field('section')?.shape.default ?? {});
  const size = diagonal();
  const list = sections();
  const section = {
    ...base,
    point: point.map((n) => tidy(n, size)),
    normal: unit(normal).map((n) => Number(n.toFixed(5))),
  };
  setSections([...list, section]);
  store.section = list.length;
  store.tell('section');
}

/** The box that planes are moved in. @returns {{min: Vec3, max: Vec3}} */
export function room() {
  return store.resolved?.bounds ?? { min: [-1, -1, -1], max: [1, 1, 1] };
}

/** Size of what there is. */
export function diagonal() {
  const { min, max } = room();
  return Math.hypot(...sub(max, min)) || 1;
}

/** The middle of what there is. @returns {Vec3} */
export const middle = () => scale(add(room().min, room().max), 0.5);

/** How far a plane may go along its normal and where it is. @param {Section} section */
export function travel({ point, normal }) {
  const n = unit(normal);
  const all = corners(room()).map((c) => dot(c, n));
  return { least: Math.min(...all), most: Math.max(...all), at: dot(point, n) };
}

/** The plane moved along its normal to a place of `travel`. @param {Section} section @param {number} to @returns {Vec3} */
export function movedTo({ point, normal }, to) {
  const n = unit(normal);
  const size = diagonal();
  const moved = add(point, scale(n, to - dot(point, n)));
  return /** @type {Vec3} */ (moved.map((v) => tidy(v, size)));
}

/** Where a plane cuts the box: corners in order around. @param {Section} section @returns {Vec3[]} */
export function outline({ point, normal }) {
  const n = unit(normal);
  const c = corners(room());
  /** @type {Vec3[]} */
  const points = [];
  for (let i = 0; i < 8; i++) {
    for (const bit of [1, 2, 4]) {
      if (i & bit) continue;
      const [a, b] = [c[i], c[i | bit]];
      const [da, db] = [dot(sub(a, point), n), dot(sub(b, point), n)];
      if (da * db < 0) points.push(add(a, scale(sub(b, a), da / (da - db))));
    }
  }
  const u = across(n);
  const v = cross(n, u);
  const m = points.reduce((s, p) => add(s, p), /** @type {Vec3} */ ([0, 0, 0]));
  const center = scale(m, 1 / (points.length || 1));
  const angle = (/** @type {Vec3} */ p) => Math.atan2(dot(sub(p, center), v), dot(sub(p, center), u));
  return points.sort((a, b) => angle(a) - angle(b));
}
