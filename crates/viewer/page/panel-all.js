/** @file The panel All: every parameter of the schema, with its meaning, to be searched. */
import { h, quiet } from './dom.js';
import { field } from './field.js';
import { icon } from './icons.js';
import { label } from './format.js';
import { Panel } from './panel.js';
import { store } from './store.js';

/** @typedef {import('./types.js').Field} Field */

class All extends Panel {
  /** Paths of folds that are open. @type {Set<string>} */
  opened = new Set();
  /** What is searched for. */
  words = '';

  plan() {
    // Lists grow and shrink; what is in them shows by itself.
    return JSON.stringify(this.#lengths(store.schema, ''));
  }

  /** @param {import('./types.js').Shape} shape @param {string} path @returns {any[]} */
  #lengths(shape, path) {
    return (shape.fields ?? []).flatMap((f) => {
      const at = path ? `${path}.${f.name}` : f.name;
      if (f.shape.kind === 'table') return this.#lengths(f.shape, at);
      if (f.shape.kind !== 'list' || f.shape.of?.kind !== 'table') return [];
      const entries = store.get(at) ?? [];
      return [entries.length, ...entries.flatMap((/** @type {any} */ _, /** @type {number} */ i) => this.#lengths(/** @type {any} */ (f.shape.of), `${at}.${i}`))];
    });
  }

  build() {
    const box = h('input', {
      type: 'search', id: 'search', placeholder: 'Search names and meanings', 'aria-label': 'Search parameters', spellcheck: 'false',
      value: this.words,
      oninput: quiet(120, () => { this.words = box.value; this.#fill(); }),
    });
    this.tree = h('div', { class: 'tree' });
    this.#fill();
    return [box, this.tree];
  }

  #fill() {
    const words = this.words.toLowerCase().split(/\s+/).filter(Boolean);
    if (!words.length) {
      this.tree.replaceChildren(...this.#table(store.schema, '', true));
      return;
    }
    const found = this.#leaves(store.schema, '').filter(({ path, field: f }) => {
      const text = `${path} ${label(f.name)} ${f.meaning}`.toLowerCase();
      return words.every((w) => text.includes(w));
    });
    this.tree.replaceChildren(...(found.length ? found.slice(0, 60).map(({ path }) => h('div', { class: 'hit' }, h('code', {}, path), field(path, { explain: true })))
      : [h('p', { class: 'empty' }, 'Nothing of that name or meaning.')]));
  }

  /** Every parameter there is, with the indices of lists. @param {import('./types.js').Shape} shape @param {string} path @returns {{path: string, field: Field}[]} */
  #leaves(shape, path) {
    return (shape.fields ?? []).flatMap((f) => {
      const at = path ? `${path}.${f.name}` : f.name;
      if (f.shape.kind === 'table') return this.#leaves(f.shape, at);
      if (f.shape.kind === 'list' && f.shape.of?.kind === 'table') {
        return (store.get(at) ?? []).flatMap((/** @type {any} */ _, /** @type {number} */ i) => this.#leaves(/** @type {any} */ (f.shape.of), `${at}.${i}`));
      }
      return [{ path: at, field: f }];
    });
  }

  /** @param {import('./types.js').Shape} shape @param {string} path @param {boolean} [top] @returns {any[]} */
  #table(shape, path, top = false) {
    return (shape.fields ?? []).map((f) => {
      const at = path ? `${path}.${f.name}` : f.name;
      if (f.shape.kind === 'table') return this.#branch(label(f.name), f.meaning, () => this.#table(f.shape, at), at);
      if (f.shape.kind === 'list' && f.shape.of?.kind === 'table') return this.#list(f, at, top);
      return field(at, { explain: true });
    }).filter(Boolean);
  }

  /** A fold that is filled when it is opened. @param {string} title @param {string} meaning @param {() => any[]} fill @param {string} path */
  #branch(title, meaning, fill, path) {
    const inside = h('div', { class: 'folded' });
    const part = h('details', { class: 'fold', open: this.opened.has(path), ontoggle: () => {
      if (part.open) this.opened.add(path);
      else this.opened.delete(path);
      if (part.open && !inside.children.length) inside.replaceChildren(h('p', { class: 'meaning' }, meaning), ...fill());
    } }, h('summary', { title: meaning }, icon('more'), title), inside);
    return part;
  }

  /** @param {Field} list @param {string} path @param {boolean} top */
  #list(list, path, top) {
    const entries = store.get(path) ?? [];
    const set = (/** @type {any[]} */ to) => store.change({ [path]: to });
    return this.#branch(`${label(list.name)} (${entries.length})`, list.meaning, () => [
      ...entries.map((/** @type {any} */ entry, /** @type {number} */ i) => this.#branch(entry?.name || entry?.property || `${label(list.name)} ${i + 1}`, '', () => [
        ...this.#table(/** @type {any} */ (list.shape.of), `${path}.${i}`),
        // Systems come from the command line.
        path === 'system' && top ? '' : h('button', { class: 'small', onclick: () => set(entries.filter((/** @type {any} */ _, /** @type {number} */ k) => k !== i)) }, icon('remove'), 'Delete'),
      ], `${path}.${i}`)),
      path === 'system' && top ? '' : h('button', { class: 'small', onclick: () => set([...entries, list.shape.default ?? {}]) }, icon('add'), 'Add'),
    ], path);
  }
}

customElements.define('motes-panel-all', All);
