/** @file What panels have in common: they are built anew when the particles or the chosen system change. */
import { h, Part } from './dom.js';
import { store } from './store.js';

export class Panel extends Part {
  start() {
    this.listen(store, 'system', () => this.#build());
    // Built anew in the middle of a drag, a panel would lose it: only when it has to be.
    this.listen(store, 'systems scene', () => {
      if (this.#planned() === this.built) this.update();
      else this.#build();
    });
    this.#build();
  }

  #planned() {
    const kinds = store.systems.map((s) => [s.name, s.properties.map((p) => [p.name, p.components]), s.types.map((t) => t.name)]);
    return JSON.stringify([store.system, kinds, this.plan()]);
  }

  #build() {
    this.built = this.#planned();
    const held = document.activeElement?.id;
    this.replaceChildren(...this.build().flat(9).filter(Boolean));
    this.update();
    if (held) /** @type {any} */ (document.getElementById(held))?.focus({ preventScroll: true });
  }

  /** What the contents depend on, as text; when it changes they are built again. @returns {string} */
  plan() {
    return '';
  }

  /** The contents. @returns {any[]} */
  build() {
    return [];
  }

  /** After every change of the scene. */
  update() {}
}

/** Which set of particles a panel is about, where there are several. */
export function systemChoice() {
  if (store.systems.length < 2) return null;
  const select = h('select', {
    'aria-label': 'Set of particles', class: 'system',
    onchange: () => {
      store.system = Number(select.value);
      store.tell('system');
    },
  }, store.systems.map((s, i) => h('option', { value: i, selected: i === store.system }, s.name || s.source)));
  const shown = h('motes-field', { path: `system.${store.system}.visible` });
  shown.options = { label: 'Shown' };
  return h('div', { class: 'which' }, select, shown);
}

/** The system that panels are about. */
export const system = () => store.systems[store.system];

/** A property of it by name. @param {string} name */
export const property = (name) => system()?.properties.find((p) => p.name === name);

/** What components a property has, as the scene names them. @param {string} name */
export function components(name) {
  const n = property(name)?.components ?? 1;
  return n === 1 ? [] : ['magnitude', ...['x', 'y', 'z'].slice(0, n)];
}

/**
 * Gets a histogram for a property into its element.
 * @param {any} part the element
 * @param {string} name
 * @param {string} component
 */
export async function fill(part, name, component) {
  if (!store.line?.open || !property(name)) return;
  try {
    const answer = await store.line.ask('histogram', {
      system: store.system, property: name, bins: 128, ...(components(name).length ? { component } : {}),
    });
    part.data = answer.min === null || answer.min === undefined ? null : answer;
    part.draw();
  } catch {
    part.data = null;
    part.draw();
  }
}
