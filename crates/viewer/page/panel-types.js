/** @file The panel Types: each type of particles with its switch, its colour and its radius. */
import { h } from './dom.js';
import { field } from './field.js';
import { count, parse } from './format.js';
import { Panel, property, system, systemChoice } from './panel.js';
import { hidden, withHidden } from './where.js';
import { store } from './store.js';

class Types extends Panel {
  /** @type {{name: string, element: any, on: any, color: any, radius: any, number: any}[]} */
  rows = [];

  build() {
    const types = system()?.types ?? [];
    this.rows = [];
    if (!types.length) {
      return [systemChoice(), h('p', { class: 'empty' }, 'These particles have no types. Colour them by a property in Look, show some of them by a Filter.')];
    }
    this.rows = types.map((type) => this.#row(type));
    const all = (/** @type {string[]} */ names) => this.#hide(names);
    return [
      systemChoice(),
      h('div', { class: 'row' }, h('span', { class: 'muted' }, `${types.length} types`),
        h('span', { class: 'gap' }),
        h('button', { class: 'plain small', onclick: () => all([]) }, 'Show all'),
        h('button', { class: 'plain small', onclick: () => all(types.map((t) => t.name)) }, 'Hide all')),
      h('ul', { class: 'types' }, this.rows.map((r) => r.element)),
      field(store.mine('color.palette')),
    ];
  }

  /** @param {import('./types.js').ParticleType} type */
  #row(type) {
    const on = h('input', { type: 'checkbox', class: 'switch', role: 'switch', 'aria-label': `Show ${type.name}`, onchange: () => this.#switch(type.name, on.checked) });
    const color = h('input', {
      type: 'color', 'aria-label': `Colour of ${type.name}`,
      oninput: () => this.#entry('color.colors', type.name, color.value, false),
      onchange: () => this.#entry('color.colors', type.name, color.value, true),
    });
    const radius = h('input', {
      type: 'text', class: 'number', inputmode: 'decimal', placeholder: 'r', 'aria-label': `Radius of ${type.name}`, title: 'Radius; empty: that of the file or the element',
      onchange: () => this.#entry('radii', type.name, parse(radius.value) ?? null, true),
    });
    const only = h('button', { class: 'plain small', title: `Show ${type.name} only`, onclick: () => this.#hide((system()?.types ?? []).map((t) => t.name).filter((n) => n !== type.name)) }, 'only');
    const number = h('span', { class: 'count' });
    const element = h('li', {}, on, color, h('span', { class: 'type', title: type.name }, type.name), number, only, radius);
    return { name: type.name, element, on, color, radius, number };
  }

  update() {
    const gone = this.#hidden();
    const colors = store.get(store.mine('color.colors')) ?? {};
    const radii = store.get(store.mine('radii')) ?? {};
    for (const { name, on, color, radius, element, number } of this.rows) {
      const type = system()?.types.find((t) => t.name === name);
      on.checked = !gone.includes(name);
      element.classList.toggle('off', !on.checked);
      number.textContent = count(type?.count ?? 0);
      const shown = String(colors[name] ?? type?.color);
      if (/^#[0-9a-f]{6}/i.test(shown)) color.value = shown.slice(0, 7);
      if (document.activeElement !== radius) radius.value = radii[name] === undefined ? '' : String(radii[name]);
    }
  }

  #hidden() {
    return hidden(store.get(store.mine('where')) ?? '');
  }

  /** @param {string} name @param {boolean} on */
  #switch(name, on) {
    const gone = this.#hidden().filter((n) => n !== name);
    this.#hide(on ? gone : [...gone, name]);
  }

  /** @param {string[]} names */
  #hide(names) {
    const text = property('Particle Type')?.type === 'names';
    store.change({ [store.mine('where')]: withHidden(store.get(store.mine('where')) ?? '', names, text) });
  }

  /** Puts a value into a map of the scene. @param {string} path @param {string} name @param {unknown} value @param {boolean} mark */
  #entry(path, name, value, mark) {
    const map = { ...(store.get(store.mine(path)) ?? {}) };
    if (value === null) delete map[name];
    else map[name] = value;
    store.change({ [store.mine(path)]: map }, mark);
  }
}

customElements.define('motes-panel-types', Types);
