/** @file The panel Cut: the list of cutting planes. */
import { h } from './dom.js';
import { field, fold } from './field.js';
import { icon } from './icons.js';
import { Panel } from './panel.js';
import { middle, movedTo, newSection, sections, setSection, setSections, travel } from './sections.js';
import { store } from './store.js';
import { rotate, scale, unit } from './vector.js';

/** What the three ways to cut are called. */
const WORDS = { caps: 'Flat', open: 'Open', centre: 'Whole' };
/** Fields that have controls of their own. */
const OWN = ['on', 'point', 'normal', 'cut', 'name'];

class Cut extends Panel {
  /** @type {{on: any, name: any, range: any}[]} */
  rows = [];

  plan() {
    return JSON.stringify([sections().length, store.section]);
  }

  start() {
    super.start();
    this.listen(store, 'section', () => store.tell('system'));
  }

  build() {
    /** @type {import('./types.js').Vec3[]} */
    const axes = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
    this.rows = [];
    return [
      h('button', { class: 'wide prime', onclick: () => store.use('cut') }, icon('cut'), 'Cut by dragging in the picture'),
      h('div', { class: 'row' }, h('span', { class: 'label' }, 'Through the middle'),
        h('div', { class: 'buttons' },
          axes.map((axis, i) => h('button', { class: 'small', title: `A plane across ${'xyz'[i]}`, onclick: () => newSection(middle(), axis) }, 'XYZ'[i])),
          h('button', { class: 'small', title: 'A plane across the view', onclick: () => store.camera && newSection(middle(), store.camera.forward) }, 'View'))),
      sections().length === 0 && h('p', { class: 'empty' }, 'No planes. What lies on the side that the arrow points to is kept.'),
      h('ol', { class: 'cuts' }, sections().map((_, i) => this.#row(i))),
    ];
  }

  /** @param {number} index */
  #row(index) {
    const base = `section.${index}`;
    const held = store.section === index;
    const section = () => sections()[index];
    const on = h('input', { type: 'checkbox', class: 'switch', role: 'switch', 'aria-label': `Plane ${index + 1} cuts`, onchange: () => setSection(index, { on: on.checked }) });
    const name = h('input', { type: 'text', class: 'bare', 'aria-label': `Name of plane ${index + 1}`, placeholder: `Plane ${index + 1}`, onchange: () => setSection(index, { name: name.value }) });
    const range = h('input', {
      type: 'range', 'aria-label': `Plane ${index + 1} along its normal`, step: 'any',
      oninput: () => this.#slide(index, Number(range.value), false),
      onchange: () => this.#slide(index, Number(range.value), true),
      onfocus: () => this.#hold(index),
    });
    const button = (/** @type {string} */ glyph, /** @type {string} */ title, /** @type {() => void} */ onclick, more = {}) =>
      h('button', { class: 'plain icon', title, 'aria-label': `Plane ${index + 1}: ${title}`, onclick, ...more }, icon(glyph));
    const tilt = (/** @type {string} */ text, /** @type {"up"|"right"} */ axis) => h('button', {
      class: 'small', title: 'Tilt by 5°; with Shift, back', 'aria-label': `Plane ${index + 1}: tilt ${text}`,
      onclick: (/** @type {MouseEvent} */ e) => this.#tilt(index, axis, e.shiftKey ? -5 : 5),
    }, text);
    const row = h('li', { class: held ? 'card held' : 'card' },
      h('div', { class: 'row' }, on, name,
        button('eye', held ? 'Put the handles away' : 'Show the handles in the picture', () => this.#hold(held ? -1 : index), { 'aria-pressed': String(held) }),
        button('flip', 'Keep the other side', () => setSection(index, { normal: scale(unit(section().normal), -1) })),
        button('remove', 'Delete', () => this.#remove(index))),
      h('div', { class: 'row slide' }, h('span', { class: 'label' }, 'Move'), range),
      held && [
        h('div', { class: 'row' }, h('span', { class: 'label' }, 'Tilt'), h('div', { class: 'buttons' }, tilt('↔', 'up'), tilt('↕', 'right'))),
        field(`${base}.cut`, { label: 'Spheres', words: WORDS }),
        fold('More', false, field(`${base}.point`), field(`${base}.normal`),
          (store.field('section')?.shape.of?.fields ?? []).filter((f) => !OWN.includes(f.name)).map((f) => field(`${base}.${f.name}`))),
      ]);
    this.rows.push({ on, name, range });
    return row;
  }

  update() {
    this.rows.forEach(({ on, name, range }, i) => {
      const section = sections()[i];
      if (!section) return;
      const { least, most, at } = travel(section);
      on.checked = section.on !== false;
      if (document.activeElement !== name) name.value = section.name ?? '';
      range.min = least;
      range.max = most;
      range.value = at;
      range.style.setProperty('--at', `${Math.max(0, Math.min(100, (100 * (at - least)) / (most - least || 1)))}%`);
    });
  }

  /** @param {number} index */
  #hold(index) {
    if (store.section === index) return;
    store.section = index;
    store.tell('section');
  }

  /** @param {number} index @param {number} to @param {boolean} mark */
  #slide(index, to, mark) {
    setSection(index, { point: movedTo(sections()[index], to) }, mark);
  }

  /** @param {number} index @param {"up"|"right"} about an axis of the picture @param {number} degrees */
  #tilt(index, about, degrees) {
    const camera = store.camera;
    if (!camera) return;
    const section = sections()[index];
    const normal = rotate(unit(section.normal), camera[about], (degrees * Math.PI) / 180);
    setSection(index, { normal: /** @type {any} */ (unit(normal).map((v) => Number(v.toFixed(5)))) });
  }

  /** @param {number} index */
  #remove(index) {
    store.section = -1;
    setSections(sections().filter((_, i) => i !== index));
    store.tell('section');
  }
}

customElements.define('motes-panel-cut', Cut);
