/** @file `<motes-overlay>`: what is drawn over the picture, as SVG: measures, the held plane, the asked particle, drags. */
import { follow, svg, Part } from './dom.js';
import { store } from './store.js';
import { number } from './format.js';
import { measured } from './tools.js';
import { sections, setSection, outline, movedTo, diagonal, room } from './sections.js';
import { add, dot, length, rotate, scale, sub, unit } from './vector.js';

/** @typedef {import('./types.js').Vec3} Vec3 */

class Overlay extends Part {
  /** Width and height, pixels. @type {[number, number]} */
  room = [0, 0];

  start() {
    this.svg = svg('svg', { 'aria-hidden': 'true' });
    this.planes = svg('g');
    this.marks = svg('g');
    this.rubber = svg('g');
    this.svg.append(this.planes, this.marks, this.rubber);
    this.replaceChildren(this.svg);
    this.listen(store, 'camera measures picked section shown', () => this.#later());
    this.listen(store, 'scene', () => this.#later());
    this.listen(store, 'rubber', (e) => this.#rubber(e.detail));
    new ResizeObserver(([entry]) => {
      const { width, height } = entry.contentRect;
      this.room = [width, height];
      this.#later();
    }).observe(this);
  }

  /** Draws once before the next picture of the browser. */
  #later() {
    if (this.scheduled) return;
    this.scheduled = true;
    requestAnimationFrame(() => {
      this.scheduled = false;
      this.#draw();
    });
  }

  #draw() {
    const camera = store.camera;
    if (!camera) return;
    const [w, h] = this.room;
    this.view = { camera, w, h };
    this.marks.replaceChildren(...this.#picked(camera, h), ...store.measures.map((m) => this.#measure(m)));
    // A plane that is dragged keeps its handles: they hold the pointer.
    if (!this.dragging) this.#plane();
    else this.#plane(true);
  }

  /** Where a point is, pixels, and its depth. @param {Vec3} p */
  place(p) {
    if (!this.view) return { x: 0, y: 0, depth: 0 };
    const { x, y, depth } = this.view.camera.project(p);
    return { x: x * this.view.w, y: y * this.view.h, depth };
  }

  /** @param {import('./camera.js').Camera} camera @param {number} height */
  #picked(camera, height) {
    const picked = store.picked;
    if (!picked) return [];
    const at = this.place(picked.position);
    if (at.depth <= 0) return [];
    const radius = (picked.radius / (2 * camera.half * (camera.flat ? 1 : at.depth))) * height;
    const r = Math.max(6, radius + 2);
    return [svg('circle', { class: 'halo', cx: at.x, cy: at.y, r }), svg('circle', { class: 'ring', cx: at.x, cy: at.y, r })];
  }

  /** @param {{kind: string, points: import('./types.js').Picked[]}} measure */
  #measure(measure) {
    const points = measure.points.map((p) => this.place(p.position));
    if (points.some((p) => p.depth <= 0)) return svg('g');
    const line = points.map((p) => `${p.x},${p.y}`).join(' ');
    const value = measured(measure);
    const at = measure.kind === 'angle' && points.length === 3 ? points[1]
      : { x: (points[0].x + points[points.length - 1].x) / 2, y: (points[0].y + points[points.length - 1].y) / 2 };
    const text = value === undefined ? '' : measure.kind === 'angle' ? `${number(value, 4)}°` : number(value, 5);
    return svg('g', { class: 'measure' },
      svg('polyline', { class: 'halo', points: line }), svg('polyline', { points: line }),
      points.map((p) => svg('circle', { cx: p.x, cy: p.y, r: 3.5 })),
      text && svg('text', { x: at.x + 8, y: at.y - 8 }, text));
  }

  /** The held plane: its outline in the box, a foot to move it along its normal, a tip to tilt it. @param {boolean} [moving] */
  #plane(moving = false) {
    const section = sections()[store.section];
    if (!section) {
      this.planes.replaceChildren();
      this.handles = null;
      return;
    }
    const points = outline(section).map((p) => this.place(p));
    const inside = points.length > 2 && points.every((p) => p.depth > 0);
    const foot = this.#foot(section);
    const tip = add(foot, scale(unit(section.normal), diagonal() * 0.12));
    const [a, b] = [this.place(foot), this.place(tip)];
    if (!moving || !this.handles) {
      this.handles = {
        area: svg('polygon', { class: 'plane' }),
        line: svg('line', { class: 'normal' }),
        foot: svg('circle', { class: 'foot', r: 9, onpointerdown: (/** @type {PointerEvent} */ e) => this.#slide(e) }, svg('title', {}, 'Drag: move the plane along its normal')),
        tip: svg('circle', { class: 'tip', r: 8, onpointerdown: (/** @type {PointerEvent} */ e) => this.#tilt(e) }, svg('title', {}, 'Drag: tilt the plane')),
      };
      this.planes.replaceChildren(...Object.values(this.handles));
    }
    const { area, line } = this.handles;
    area.setAttribute('points', inside ? points.map((p) => `${p.x},${p.y}`).join(' ') : '');
    for (const [name, value] of Object.entries({ x1: a.x, y1: a.y, x2: b.x, y2: b.y })) line.setAttribute(name, value);
    for (const [handle, p] of /** @type {[any, any][]} */ ([[this.handles.foot, a], [this.handles.tip, b]])) {
      handle.setAttribute('cx', p.x);
      handle.setAttribute('cy', p.y);
      handle.toggleAttribute('hidden', p.depth <= 0);
    }
  }

  /** The point of the plane that its handles stand on: near the middle of what there is. @param {import('./types.js').Section} section */
  #foot(section) {
    const n = unit(section.normal);
    const { min, max } = room();
    const middle = scale(add(min, max), 0.5);
    return sub(middle, scale(n, dot(sub(middle, section.point), n)));
  }

  /** @param {PointerEvent} down */
  #slide(down) {
    const index = store.section;
    const start = sections()[index];
    const camera = store.camera;
    if (!camera) return;
    const n = unit(start.normal);
    const foot = this.#foot(start);
    const step = diagonal() * 0.01;
    const [a, b] = [this.place(foot), this.place(add(foot, scale(n, step)))];
    const [ux, uy] = [b.x - a.x, b.y - a.y];
    const size = ux * ux + uy * uy;
    const drop = () => { this.dragging = false; };
    this.dragging = true;
    /** @type {Vec3} */
    let point = start.point;
    follow(down, (e) => {
      const along = ((e.clientX - down.clientX) * ux + (e.clientY - down.clientY) * uy) / Math.max(size, 0.05);
      point = movedTo(start, dot(start.point, n) + along * step);
      setSection(index, { point }, false);
    }, () => { drop(); setSection(index, { point }); });
  }

  /** @param {PointerEvent} down */
  #tilt(down) {
    const index = store.section;
    const start = sections()[index];
    const camera = store.camera;
    if (!camera) return;
    const foot = this.#foot(start);
    this.dragging = true;
    /** @type {Vec3} */
    let normal = start.normal;
    follow(down, (e) => {
      // Across the screen it turns about the picture's up, along it about its right.
      const [dx, dy] = [e.clientX - down.clientX, e.clientY - down.clientY];
      const axis = add(scale(camera.up, dx), scale(camera.right, dy));
      const turned = rotate(unit(start.normal), unit(axis), length(axis) / 160);
      normal = /** @type {Vec3} */ (unit(turned).map((v) => Number(v.toFixed(5))));
      setSection(index, { normal, point: foot }, false);
    }, () => { this.dragging = false; setSection(index, { normal, point: foot }); });
  }

  /** @param {{kind: string, from: {x: number, y: number}, to: {x: number, y: number}}|null} drag */
  #rubber(drag) {
    if (!drag) return this.rubber.replaceChildren();
    const [w, h] = this.room;
    const [x0, y0, x1, y1] = [drag.from.x * w, drag.from.y * h, drag.to.x * w, drag.to.y * h];
    if (drag.kind === 'box') {
      this.rubber.replaceChildren(svg('rect', {
        class: 'band', x: Math.min(x0, x1), y: Math.min(y0, y1), width: Math.abs(x1 - x0), height: Math.abs(y1 - y0),
      }));
      return;
    }
    const far = Math.hypot(x1 - x0, y1 - y0) || 1;
    const [px, py] = [(-(y1 - y0) / far) * w, ((x1 - x0) / far) * w];
    this.rubber.replaceChildren(
      svg('line', { class: 'halo', x1: x0 - px, y1: y0 - py, x2: x0 + px, y2: y0 + py }),
      svg('line', { class: 'cutline', x1: x0 - px, y1: y0 - py, x2: x0 + px, y2: y0 + py }),
      svg('line', { class: 'normal', x1: x0, y1: y0, x2: x1, y2: y1 }),
      svg('circle', { class: 'tip', cx: x1, cy: y1, r: 5 }));
  }
}

customElements.define('motes-overlay', Overlay);
