/** @file Vectors of three numbers. */

/** @typedef {import('./types.js').Vec3} Vec3 */

/** @param {Vec3} a @param {Vec3} b @returns {Vec3} */
export const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];

/** @param {Vec3} a @param {Vec3} b @returns {Vec3} */
export const sub = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];

/** @param {Vec3} a @param {number} s @returns {Vec3} */
export const scale = (a, s) => [a[0] * s, a[1] * s, a[2] * s];

/** @param {Vec3} a @param {Vec3} b */
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

/** @param {Vec3} a @param {Vec3} b @returns {Vec3} */
export const cross = (a, b) => [
  a[1] * b[2] - a[2] * b[1],
  a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0],
];

/** @param {Vec3} a */
export const length = (a) => Math.hypot(...a);

/** The unit vector; of zero, zero. @param {Vec3} a @returns {Vec3} */
export const unit = (a) => scale(a, 1 / (length(a) || 1));

/**
 * `v` turned about the unit vector `axis`, counter-clockwise as seen from its tip (Rodrigues).
 * @param {Vec3} v
 * @param {Vec3} axis
 * @param {number} angle radians
 * @returns {Vec3}
 */
export function rotate(v, axis, angle) {
  const [c, s] = [Math.cos(angle), Math.sin(angle)];
  const along = scale(axis, dot(axis, v) * (1 - c));
  return add(add(scale(v, c), scale(cross(axis, v), s)), along);
}

/** Some unit vector across `a`. @param {Vec3} a @returns {Vec3} */
export const across = (a) => unit(cross(a, Math.abs(a[0]) < 0.6 * length(a) ? [1, 0, 0] : [0, 1, 0]));

/** The eight corners of a box. @param {{min: Vec3, max: Vec3}} box @returns {Vec3[]} */
export const corners = ({ min, max }) => [0, 1, 2, 3, 4, 5, 6, 7].map((i) => [
  i & 1 ? max[0] : min[0],
  i & 2 ? max[1] : min[1],
  i & 4 ? max[2] : min[2],
]);
