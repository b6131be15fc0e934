/** @file The panel Look: the way of seeing, sizes and colours. */
import { h, quiet } from './dom.js';
import { field, fold } from './field.js';
import { histogram } from './histogram.js';
import { gradient, sampler } from './colormap.js';
import { components, fill, Panel, property, system, systemChoice } from './panel.js';
import { store } from './store.js';
import { reach } from './paths.js';

/** Ways to colour that are no property. @type {[string, string][]} */
const WAYS = [['auto', 'Automatic'], ['uniform', 'One colour'], ['element', 'Element'], ['type', 'Type'], ['chain', 'Chain'], ['residue', 'Residue']];

class Look extends Panel {
  /** What the histogram is of. */
  key = '';

  plan() {
    const by = store.get(store.mine('color.by'));
    return JSON.stringify([by, store.get('renderer'), store.get('surface.mode'), store.get('cue.on')]);
  }

  build() {
    const renderer = store.get('renderer');
    return [
      field('renderer', { label: 'Way of seeing' }),
      systemChoice(),
      this.#colors(),
      fold('Size', true,
        field(store.mine('radius_scale'), { label: 'Radius ×', slide: [0.1, 10], log: true }),
        field(store.mine('radius'), { label: 'Radius' }),
        field(store.mine('opacity'), { slide: [0, 1] })),
      renderer === 'surface' && fold('Liquid', true, this.#surface()),
      renderer === 'density' && fold('Liquid', true,
        ['resolution', 'support', 'threshold', 'depth', 'ior', 'absorption', 'environment'].map((n) => field(`density.${n}`, n === 'support' ? { slide: [1, 12] } : n === 'ior' ? { slide: [1, 2.5] } : {}))),
      store.has('cue.on') && fold('Edges and depth', false, this.#cues()),
    ];
  }

  /** Cues: which are on, and how strong these are. */
  #cues() {
    const on = this.#on();
    const words = ['edges', 'depth', 'halo', 'rim', 'seam', 'sprite'];
    const turn = (/** @type {string} */ w) => store.change({ 'cue.on': (on.includes(w) ? on.filter((o) => o !== w) : [...on, w]).join(', ') });
    const shown = reach(/** @type {any} */ (store.field('cue')).shape, 'cue').filter(({ field: f }) => on.some((w) => f.name === w || f.name.startsWith(`${w}_`)));
    return [
      h('div', { class: 'chips', role: 'group', 'aria-label': 'Cues' }, words.map((w) => h('button', { class: 'chip', 'aria-pressed': String(on.includes(w)), onclick: () => turn(w) }, w))),
      shown.map(({ path, field: f }) => field(path, words.includes(f.name) ? { slide: [0, 1], label: `${f.name.charAt(0).toUpperCase()}${f.name.slice(1)}, strength` } : {})),
      field('cue.structure'),
    ];
  }

  /** The cues that are on. @returns {string[]} */
  #on() {
    return String(store.get('cue.on') ?? '').split(/[,\s]+/).filter(Boolean);
  }

  #surface() {
    const mode = store.get('surface.mode');
    const names = ['mode', 'smoothing', 'ball', 'gap', ...(mode === 'refractive' ? ['ior', 'depth', 'absorption'] : mode === 'translucent' ? ['absorption', 'scattering', 'color'] : ['color']), 'spray', 'environment'];
    const slides = /** @type {Record<string, [number, number]>} */ ({ ior: [1, 2.5], ball: [1, 4] });
    return names.map((n) => field(`surface.${n}`, slides[n] ? { slide: slides[n] } : {}));
  }

  #colors() {
    const by = store.get(store.mine('color.by')) ?? 'auto';
    const names = system()?.properties.map((p) => p.name) ?? [];
    const select = h('select', {
      id: 'color-by', 'aria-label': 'Colour by',
      onchange: () => store.change({ [store.mine('color.by')]: select.value, [store.mine('color.range')]: null, [store.mine('color.component')]: null }),
    },
    WAYS.filter(([way]) => this.#can(way, by)).map(([way, title]) => h('option', { value: way, selected: way === by }, title)),
    h('optgroup', { label: 'Property' }, names.map((name) => h('option', { value: name, selected: name === by }, name))));
    const parts = components(by);
    const valued = property(by) !== undefined && !WAYS.some(([way]) => way === by);
    return h('div', { class: 'block' },
      h('div', { class: 'row' }, h('label', { for: 'color-by' }, 'Colour by'), select),
      valued && parts.length > 0 && field(store.mine('color.component'), { choices: parts, label: 'Component', words: { magnitude: 'Length', x: 'X', y: 'Y', z: 'Z' } }),
      valued ? this.#map(by) : by === 'uniform' ? field(store.mine('color.uniform'), { label: 'Colour' }) : field(store.mine('color.palette')));
  }

  /** Whether particles can be coloured in a way. @param {string} way @param {string} by */
  #can(way, by) {
    if (way === 'auto' || way === 'uniform' || way === by) return true;
    const has = (/** @type {RegExp} */ name) => system()?.properties.some((p) => name.test(p.name));
    return has(/** @type {any} */ ({ element: /type|element/i, type: /type/i, chain: /chain/i, residue: /resid/i })[way]);
  }

  /** @param {string} by */
  #map(by) {
    this.plot = histogram((range, mark) => this.#ranged(by, range, mark));
    this.cull = h('input', { type: 'checkbox', class: 'switch', role: 'switch', id: 'cull', onchange: () => this.#cull(by) });
    this.again = quiet(150, () => fill(this.plot, by, this.#component()));
    this.key = '';
    return [
      h('div', { class: 'row' }, h('span', { class: 'label' }, 'Colour map'), h('motes-colormap')),
      this.plot,
      h('div', { class: 'ramp' }),
      h('div', { class: 'row' }, h('label', { for: 'cull', title: 'A filter with the range of the colours' }, 'Hide what is outside'), this.cull),
      fold('More about colours', false,
        field(store.mine('color.reverse'), { label: 'Backwards' }),
        field(store.mine('color.log'), { label: 'Logarithm' }),
        field(store.mine('color.range_over'), { label: 'Ends from' }),
        field(store.mine('color.missing'), { label: 'Missing values' })),
    ];
  }

  #component() {
    return store.get(store.mine('color.component')) ?? 'magnitude';
  }

  update() {
    if (!this.plot?.isConnected) return;
    const by = store.get(store.mine('color.by'));
    const map = store.get(store.mine('color.map')) ?? 'viridis';
    const reverse = Boolean(store.get(store.mine('color.reverse')));
    this.plot.range = store.get(store.mine('color.range')) ?? null;
    this.plot.colors = sampler(map, reverse);
    this.plot.draw();
    const ramp = /** @type {any} */ (this.querySelector('.ramp'));
    if (ramp) ramp.style.backgroundImage = gradient(map, reverse);
    const filter = this.#filter(by);
    this.cull.checked = filter >= 0;
    const key = JSON.stringify([by, this.#component(), store.resolved?.frame]);
    if (key !== this.key) {
      this.key = key;
      this.again?.();
    }
  }

  /** The filter on the property of the colours, or −1. @param {string} by */
  #filter(by) {
    const filters = store.get(store.mine('filter')) ?? [];
    return filters.findIndex((/** @type {any} */ f) => f.property === by && (f.component ?? 'magnitude') === this.#component());
  }

  /** @param {string} by @param {[number, number]|null} range @param {boolean} mark */
  #ranged(by, range, mark) {
    /** @type {import('./types.js').Changes} */
    const changes = { [store.mine('color.range')]: range };
    const at = this.#filter(by);
    if (at >= 0) changes[store.mine('filter')] = this.#filters(by, at, range);
    store.change(changes, mark);
  }

  /** @param {string} by @param {number} at @param {[number, number]|null} range */
  #filters(by, at, range) {
    const filters = [...(store.get(store.mine('filter')) ?? [])];
    const one = { property: by, component: this.#component(), min: range?.[0] ?? null, max: range?.[1] ?? null };
    if (at >= 0) filters[at] = one;
    else filters.push(one);
    return filters.map((f) => Object.fromEntries(Object.entries(f).filter(([, v]) => v !== null)));
  }

  /** @param {string} by */
  #cull(by) {
    const at = this.#filter(by);
    const filters = store.get(store.mine('filter')) ?? [];
    const to = this.cull.checked
      ? this.#filters(by, -1, this.plot.ends)
      : filters.filter((/** @type {any} */ _, /** @type {number} */ i) => i !== at);
    store.change({ [store.mine('filter')]: to, ...(this.cull.checked ? { [store.mine('color.range')]: this.plot.ends } : {}) });
  }
}

customElements.define('motes-panel-look', Look);
