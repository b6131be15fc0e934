/** @file The panel Measure: distances, angles, and what was selected by a box. */
import { copy, h } from './dom.js';
import { icon } from './icons.js';
import { count, number, values } from './format.js';
import { kind } from './hover.js';
import { Panel } from './panel.js';
import { store } from './store.js';
import { measured } from './tools.js';
import { and, inBox } from './where.js';

class Ask extends Panel {
  start() {
    super.start();
    this.listen(store, 'measures selection tool', () => store.tell('system'));
  }

  build() {
    const tool = (/** @type {string} */ name, /** @type {string} */ text) => h('button', {
      class: 'wide', 'aria-pressed': String(store.tool === name), onclick: () => store.use(store.tool === name ? 'move' : name),
    }, icon(name), text);
    return [
      h('div', { class: 'three' }, tool('distance', 'Distance'), tool('angle', 'Angle'), tool('box', 'Box')),
      h('p', { class: 'meaning' }, 'A click in the picture asks for a particle at any time; a rest of the mouse names it.'),
      store.measures.length > 0 && [
        h('h3', {}, 'Measures'),
        h('ol', { class: 'measures' }, store.measures.map((m, i) => this.#measure(m, i))),
        h('button', { class: 'plain small', onclick: () => { store.measures = []; store.tell('measures'); } }, 'Clear'),
      ],
      store.selection && this.#selection(store.selection),
    ];
  }

  /** @param {{kind: string, points: import('./types.js').Picked[]}} measure @param {number} index */
  #measure(measure, index) {
    const value = measured(measure);
    const who = measure.points.map((p) => `${kind(p)} ${p.id ?? p.index}`.trim()).join(' – ');
    const text = value === undefined ? '…' : measure.kind === 'angle' ? `${number(value, 6)}°` : number(value, 7);
    const copier = h('button', { class: 'plain icon', title: 'Copy', 'aria-label': 'Copy the measure', onclick: () => copy(text, copier) }, icon('copy'));
    return h('li', {}, h('span', { class: 'muted' }, who), h('b', {}, text), copier,
      h('button', { class: 'plain icon', title: 'Take it away', 'aria-label': 'Take the measure away', onclick: () => { store.measures.splice(index, 1); store.tell('measures'); } }, icon('close')));
  }

  /** @param {any} selection */
  #selection(selection) {
    const rows = Object.entries(selection.properties ?? {});
    const one = (/** @type {any} */ v) => (Array.isArray(v) ? v.map((x) => number(x, 4)).join(' ') : number(v, 4));
    const table = h('table', {},
      h('thead', {}, h('tr', {}, ['', 'least', 'mean', 'greatest'].map((t) => h('th', { scope: 'col' }, t)))),
      h('tbody', {}, rows.map(([name, s]) => h('tr', {}, h('th', { scope: 'row', title: name }, name), ['min', 'mean', 'max'].map((k) => h('td', { title: values(/** @type {any} */ (s)[k]) }, one(/** @type {any} */ (s)[k])))))));
    const copier = h('button', { class: 'plain small', onclick: () => copy(this.#text(selection), copier) }, icon('copy'), 'Copy');
    const keep = (/** @type {boolean} */ these) => {
      const where = store.get('system.0.where') ?? '';
      const box = inBox(selection.box, selection.camera);
      store.change(Object.fromEntries(store.systems.map((_, i) => [`system.${i}.where`, and(i ? store.get(`system.${i}.where`) ?? '' : where, these ? box : `!(${box})`)])));
      store.selection = null;
      store.tell('selection');
    };
    return [
      h('h3', {}, 'Selected'),
      h('p', {}, h('b', { class: 'big' }, count(selection.count)), selection.count === 1 ? ' particle' : ' particles'),
      h('div', { class: 'buttons' },
        h('button', { class: 'small', disabled: !selection.count, onclick: () => keep(true) }, 'Keep only these'),
        h('button', { class: 'small', disabled: !selection.count, onclick: () => keep(false) }, 'Hide these'),
        copier,
        h('button', { class: 'plain small', onclick: () => { store.selection = null; store.tell('selection'); } }, 'Clear')),
      rows.length > 0 && h('div', { class: 'scroll' }, table),
    ];
  }

  /** @param {any} selection */
  #text(selection) {
    const rows = Object.entries(selection.properties ?? {}).map(([name, s]) => [name, /** @type {any} */ (s).min, /** @type {any} */ (s).mean, /** @type {any} */ (s).max].join('\t'));
    return [`particles\t${selection.count}`, 'property\tmin\tmean\tmax', ...rows, `indices\t${(selection.indices ?? []).join(' ')}`].join('\n');
  }
}

customElements.define('motes-panel-ask', Ask);
