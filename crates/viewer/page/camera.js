/**
 * @file The camera, as `motes-scene` has it: pixels of a picture that is 1 high and `aspect` wide.
 *
 * With f, r, u the unit vectors forward, right and up and k half the picture's height (at distance 1 in
 * perspective, tan(fov/2); in the world when orthographic), a point p of the world is seen at
 *   x = ½ + r·(p − eye) / (2·k·aspect·d),  y = ½ − u·(p − eye) / (2·k·d),  d = f·(p − eye), or 1.
 * All moves return a new camera.
 */
import { add, cross, dot, length, rotate, scale, sub, unit } from './vector.js';
import { tidy } from './format.js';

/** @typedef {import('./types.js').Vec3} Vec3 */

/** How near to looking straight up or down turning goes, radians. */
const POLE = 0.002;

export class Camera {
  /**
   * @param {import('./types.js').ResolvedCamera} resolved
   * @param {number} aspect width / height
   * @param {Vec3} upright what is up in the world
   */
  constructor(resolved, aspect, upright) {
    this.resolved = resolved;
    this.aspect = aspect;
    this.upright = upright;
    this.eye = resolved.position;
    this.target = resolved.target;
    this.distance = length(sub(this.target, this.eye)) || 1;
    /** @type {Vec3} */
    this.forward = unit(sub(this.target, this.eye));
    this.right = unit(cross(this.forward, resolved.up));
    this.up = cross(this.right, this.forward);
    this.flat = resolved.projection === 'orthographic';
    this.half = this.flat ? resolved.height / 2 : Math.tan((resolved.fov * Math.PI) / 360);
  }

  /** Half the picture's height in the world, at the target. */
  get halfAtTarget() {
    return this.flat ? this.half : this.half * this.distance;
  }

  /**
   * Where a point is in the picture: x and y in 0…1 from the top left, and its depth.
   * @param {Vec3} p
   */
  project(p) {
    const q = sub(p, this.eye);
    const depth = dot(q, this.forward);
    const k = 2 * this.half * (this.flat ? 1 : depth);
    return { x: 0.5 + dot(q, this.right) / (k * this.aspect), y: 0.5 - dot(q, this.up) / k, depth };
  }

  /**
   * The ray through a point of the picture.
   * @param {number} x 0…1
   * @param {number} y 0…1
   * @returns {{origin: Vec3, direction: Vec3}}
   */
  ray(x, y) {
    const a = (2 * x - 1) * this.half * this.aspect;
    const b = (1 - 2 * y) * this.half;
    const aside = add(scale(this.right, a), scale(this.up, b));
    return this.flat
      ? { origin: add(this.eye, aside), direction: this.forward }
      : { origin: this.eye, direction: unit(add(this.forward, aside)) };
  }

  /**
   * The axis about which turning to the side goes: the world's, unless the camera is rolled.
   * @returns {Vec3}
   */
  get axis() {
    if (Math.abs(dot(this.right, this.upright)) > 1e-3) return this.up;
    return dot(this.up, this.upright) < 0 ? scale(this.upright, -1) : this.upright;
  }

  /**
   * Goes round the target.
   * @param {number} across radians to the right
   * @param {number} along radians upward
   */
  orbit(across, along) {
    const axis = this.axis;
    const height = Math.asin(Math.max(-1, Math.min(1, dot(this.forward, axis))));
    const limit = Math.max(Math.PI / 2 - POLE, Math.abs(height));
    const to = Math.max(-limit, Math.min(limit, height + along));
    /** @type {(v: Vec3) => Vec3} */
    const turn = (v) => rotate(rotate(v, this.right, to - height), axis, -across);
    const forward = unit(turn(this.forward));
    return this.with({
      position: sub(this.target, scale(forward, this.distance)),
      up: unit(turn(this.up)),
    });
  }

  /**
   * Moves aside, so that what is at the target moves by a part of the picture's height.
   * @param {number} dx to the right
   * @param {number} dy downward
   */
  pan(dx, dy) {
    const k = 2 * this.halfAtTarget;
    return this.moved(add(scale(this.right, -dx * k), scale(this.up, dy * k)));
  }

  /** @param {Vec3} by */
  moved(by) {
    return this.with({ position: add(this.eye, by), target: add(this.target, by) });
  }

  /**
   * Comes nearer (`factor` below 1) to what is at (x, y) of the picture.
   * @param {number} factor
   * @param {number} [x] 0…1
   * @param {number} [y] 0…1
   */
  zoom(factor, x = 0.5, y = 0.5) {
    const k = 2 * this.halfAtTarget;
    const there = add(scale(this.right, (x - 0.5) * k * this.aspect), scale(this.up, (0.5 - y) * k));
    const target = add(this.target, scale(there, 1 - factor));
    if (this.flat) {
      return this.with({ target, position: add(this.eye, sub(target, this.target)), height: 2 * this.half * factor });
    }
    return this.with({ target, position: sub(target, scale(this.forward, this.distance * factor)) });
  }

  /** Walks on along the view, by a part of the distance. @param {number} part */
  walk(part) {
    return this.flat ? this.zoom(1 - part) : this.moved(scale(this.forward, this.distance * part));
  }

  /** Rolls to the right. @param {number} angle radians */
  roll(angle) {
    return this.with({ up: rotate(this.up, this.forward, -angle) });
  }

  /** Goes round `target` from now on, looking the same way. @param {Vec3} target */
  about(target) {
    const depth = this.flat ? this.distance : dot(sub(target, this.eye), this.forward);
    const position = sub(target, scale(this.forward, Math.max(depth, 1e-6 * this.distance)));
    return this.with({ target, position });
  }

  /** The other projection, with what is at the target as large as it is. */
  projected() {
    if (!this.flat) return this.with({ projection: 'orthographic', height: 2 * this.halfAtTarget });
    const distance = this.half / Math.tan((this.resolved.fov * Math.PI) / 360);
    return this.with({ projection: 'perspective', position: sub(this.target, scale(this.forward, distance)) });
  }

  /** @param {Partial<import('./types.js').ResolvedCamera>} changes */
  with(changes) {
    return new Camera({ ...this.resolved, ...changes }, this.aspect, this.upright);
  }

  /**
   * The camera as changes to the scene, in numbers as short as the eye allows.
   * @returns {import('./types.js').Changes}
   */
  changes() {
    const { projection } = this.resolved;
    /** @type {(v: Vec3, size: number) => number[]} */
    const short = (v, size) => v.map((n) => tidy(n, size));
    // Upright, nothing needs to be said; straight down, what is up does.
    const upright = dot(this.up, this.upright) > 0
      && Math.abs(dot(this.right, this.upright)) < 1e-6
      && Math.abs(dot(this.forward, this.upright)) < 1 - 1e-7;
    return {
      'camera.projection': projection,
      'camera.position': short(this.eye, this.distance),
      'camera.target': short(this.target, this.distance),
      'camera.up': upright ? null : short(this.up, 0.1),
      ...(this.flat ? { 'camera.height': tidy(2 * this.half, 2 * this.half) } : {}),
    };
  }
}
