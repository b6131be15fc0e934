/**
 * @file `<motes-histogram>`: how often values occur, and two handles that hold a range of them.
 *
 * Heights are square roots of counts, so that rare values show. Event `range` (detail: `range` [a, b] or
 * null for all, `mark`).
 */
import { follow, h, svg, Part } from './dom.js';
import { number, parse } from './format.js';

const [W, H] = [280, 64];

class Histogram extends Part {
  /** @type {{min: number, max: number, counts: number[], missing?: number}|null} */
  data = null;
  /** @type {[number, number]|null} */
  range = null;
  /** @type {((part: number) => string)|null} colour of a place between the handles, 0…1 */
  colors = null;
  /** @type {any[]} the two handles, the two fields */
  handles = [];
  /** @type {any[]} */
  inputs = [];

  start() {
    if (this.plot) return;
    this.bars = svg('g');
    this.shade = svg('g');
    this.plot = svg('svg', { viewBox: `0 0 ${W} ${H}`, preserveAspectRatio: 'none', 'aria-hidden': 'true' }, this.bars, this.shade);
    this.handles = [0, 1].map((end) => h('div', {
      class: 'handle', role: 'slider', tabindex: 0, 'aria-label': end ? 'Greatest value' : 'Least value',
      onpointerdown: (/** @type {PointerEvent} */ e) => this.#drag(e, end),
      onkeydown: (/** @type {KeyboardEvent} */ e) => this.#key(e, end),
    }));
    const field = h('div', { class: 'plot', onpointerdown: (/** @type {PointerEvent} */ e) => this.#move(e), ondblclick: () => this.#say(null, true) }, this.plot, this.handles);
    this.inputs = [0, 1].map((end) => h('input', {
      type: 'text', class: 'number', inputmode: 'decimal', 'aria-label': end ? 'To' : 'From', spellcheck: 'false',
      onchange: () => this.#typed(end),
    }));
    this.all = h('button', { class: 'plain small', title: 'From the least to the greatest (double click in the plot)', onclick: () => this.#say(null, true) }, 'All');
    this.replaceChildren(field, h('div', { class: 'ends' }, this.inputs[0], this.all, this.inputs[1]));
    this.draw();
  }

  /** The ends of the range, as values. @returns {[number, number]} */
  get ends() {
    return this.range ?? (this.data ? [this.data.min, this.data.max] : [0, 1]);
  }

  /** Where a value is in the plot, 0…1. @param {number} value */
  #part(value) {
    if (!this.data || this.data.max <= this.data.min) return 0;
    return Math.max(0, Math.min(1, (value - this.data.min) / (this.data.max - this.data.min)));
  }

  draw() {
    if (!this.plot) return;
    const counts = this.data?.counts ?? [];
    const most = Math.sqrt(Math.max(1, ...counts));
    const [a, b] = this.ends;
    const [pa, pb] = [this.#part(a), this.#part(b)];
    const width = W / (counts.length || 1);
    this.bars.replaceChildren(...counts.map((n, i) => {
      if (!n) return '';
      const at = (i + 0.5) / counts.length;
      const height = Math.max(1, (Math.sqrt(n) / most) * (H - 3));
      const inside = at >= pa - 1e-9 && at <= pb + 1e-9;
      const part = pb > pa ? Math.max(0, Math.min(1, (at - pa) / (pb - pa))) : 0.5;
      return svg('rect', {
        x: i * width, y: H - height, width: width * 1.02, height, class: inside ? '' : 'out',
        ...(inside && this.colors ? { fill: this.colors(part) } : {}),
      });
    }).filter(Boolean));
    [pa, pb].forEach((p, end) => {
      const handle = this.handles[end];
      handle.style.left = `${p * 100}%`;
      handle.setAttribute('aria-valuenow', String(this.ends[end]));
      handle.setAttribute('aria-valuetext', number(this.ends[end]));
      if (this.data) {
        handle.setAttribute('aria-valuemin', String(this.data.min));
        handle.setAttribute('aria-valuemax', String(this.data.max));
      }
      if (document.activeElement !== this.inputs[end]) this.inputs[end].value = number(this.ends[end], 6);
    });
    this.all.disabled = this.range === null;
    this.classList.toggle('empty', !this.data);
  }

  /** @param {[number, number]|null} range @param {boolean} mark */
  #say(range, mark) {
    this.range = range;
    this.draw();
    this.dispatchEvent(new CustomEvent('range', { detail: { range, mark } }));
  }

  /** A value as short as the width of the plot allows. @param {number} value */
  #short(value) {
    const step = this.data ? (this.data.max - this.data.min) / 1000 : 1;
    const digits = Math.min(12, Math.max(0, 1 - Math.floor(Math.log10(step || 1))));
    return Number(value.toFixed(digits));
  }

  /** @param {number} end @param {number} value @param {boolean} mark */
  #set(end, value, mark) {
    if (!this.data) return;
    const ends = [...this.ends];
    // At the edge of the plot it is exactly the least or greatest.
    const v = Math.max(this.data.min, Math.min(this.data.max, value));
    const edge = v === this.data.min || v === this.data.max;
    ends[end] = edge ? v : this.#short(v);
    if (ends[0] > ends[1]) ends[1 - end] = ends[end];
    this.#say(/** @type {[number, number]} */ (ends), mark);
  }

  /** @param {PointerEvent} down @param {number} end */
  #drag(down, end) {
    down.stopPropagation();
    if (!this.data) return;
    const { min, max } = this.data;
    const width = /** @type {any} */ (this.plot).clientWidth || 1;
    const from = this.ends[end];
    let value = from;
    follow(down, (e) => {
      value = from + ((e.clientX - down.clientX) / width) * (max - min);
      this.#set(end, value, false);
    }, () => value !== from && this.#set(end, value, true));
  }

  /** Between the handles, both move. @param {PointerEvent} down */
  #move(down) {
    if (!this.data || !this.range || down.button !== 0) return;
    const { min, max } = this.data;
    const width = /** @type {any} */ (this.plot).clientWidth || 1;
    const [a, b] = this.ends;
    let by = 0;
    const to = (/** @type {boolean} */ mark) => this.#say([this.#short(a + by), this.#short(b + by)], mark);
    follow(down, (e) => {
      by = ((e.clientX - down.clientX) / width) * (max - min);
      by = Math.max(min - a, Math.min(max - b, by));
      to(false);
    }, () => by !== 0 && to(true));
  }

  /** @param {KeyboardEvent} e @param {number} end */
  #key(e, end) {
    const steps = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1, PageUp: 10, PageDown: -10 }[e.key];
    if (!this.data || (!steps && e.key !== 'Home' && e.key !== 'End')) return;
    e.preventDefault();
    const { min, max } = this.data;
    const to = steps ? this.ends[end] + (steps * (max - min)) / 100 : e.key === 'Home' ? min : max;
    this.#set(end, to, true);
  }

  /** @param {number} end */
  #typed(end) {
    const value = parse(this.inputs[end].value);
    if (value === undefined) return this.draw();
    const ends = [...this.ends];
    ends[end] = value;
    this.#say(/** @type {[number, number]} */ (ends[0] <= ends[1] ? ends : [ends[1], ends[0]]), true);
  }
}

customElements.define('motes-histogram', Histogram);

/** A histogram; `changed` hears of its range. @param {(range: [number, number]|null, mark: boolean) => void} changed */
export function histogram(changed) {
  return h('motes-histogram', { onrange: (/** @type {CustomEvent} */ e) => changed(e.detail.range, e.detail.mark) });
}
