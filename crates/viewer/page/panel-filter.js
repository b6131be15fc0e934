/** @file The panel Filter: the condition `where` with its error under it, and ranges of properties. */
import { h, quiet } from './dom.js';
import { histogram } from './histogram.js';
import { icon } from './icons.js';
import { count } from './format.js';
import { components, fill, Panel, system, systemChoice } from './panel.js';
import { store } from './store.js';

/** @typedef {{property: string, component?: string, min?: number|null, max?: number|null}} Filter */

class FilterPanel extends Panel {
  /** Asks how many it would be, once typing has stopped. */
  check = quiet(250, () => this.#check());
  /** What was typed and is not applied. @type {string|undefined} */
  typed = undefined;
  /** How often the server was asked: only its last answer counts. */
  asked = 0;

  plan() {
    const filters = this.filters();
    return JSON.stringify(filters.map((f) => [f.property, f.component]));
  }

  /** @returns {Filter[]} */
  filters() {
    return store.get(store.mine('filter')) ?? [];
  }

  build() {
    this.says = h('p', { class: 'says', role: 'status' });
    this.box = h('textarea', {
      id: 'where', rows: 3, spellcheck: 'false', autocapitalize: 'off', autocomplete: 'off',
      placeholder: 'all particles', 'aria-describedby': 'where-says',
      oninput: () => { this.typed = this.box.value; this.check(); },
      onchange: () => this.#apply(),
      onkeydown: (/** @type {KeyboardEvent} */ e) => {
        if (e.key === 'Enter' && !e.shiftKey) {
          e.preventDefault();
          this.#apply();
        }
      },
    });
    this.says.id = 'where-says';
    const names = [...(system()?.properties.map((p) => p.name) ?? []), 'Index'];
    const first = names.find((n) => n !== 'Position') ?? 'Position';
    return [
      systemChoice(),
      h('div', { class: 'block' },
        h('label', { for: 'where', title: store.field('system.where')?.meaning }, 'Show where'),
        this.box, this.says,
        h('div', { class: 'chips', 'aria-label': 'Properties' }, names.map((name) =>
          h('button', { class: 'chip', title: 'Into the condition', onclick: () => this.#insert(name) }, name))),
        h('p', { class: 'meaning' }, 'As in ', h('code', {}, 'Mass > 2 && Position.Z < 10'), ', ', h('code', {}, 'Particle Type == 1 || Velocity.X < 0'), '. Enter applies.')),
      h('h3', {}, 'Ranges'),
      this.filters().map((f, i) => this.#range(f, i, names)),
      h('button', { class: 'wide', onclick: () => this.#set([...this.filters(), { property: first, component: 'magnitude' }]) }, icon('add'), 'Add a range'),
    ];
  }

  /** @param {Filter} filter @param {number} index @param {string[]} names */
  #range(filter, index, names) {
    const change = (/** @type {Partial<Filter>} */ changes, mark = true) =>
      this.#set(this.filters().map((f, i) => (i === index ? { ...f, ...changes } : f)), mark);
    const select = h('select', { 'aria-label': 'Property', id: `range-${index}`, onchange: () => change({ property: select.value, component: 'magnitude', min: null, max: null }) },
      names.map((name) => h('option', { value: name, selected: name === filter.property }, name)));
    const of = components(filter.property);
    const part = of.length > 0 && h('select', { 'aria-label': 'Component', onchange: (/** @type {any} */ e) => change({ component: e.target.value, min: null, max: null }) },
      of.map((c) => h('option', { value: c, selected: c === (filter.component ?? 'magnitude') }, c === 'magnitude' ? 'Length' : c.toUpperCase())));
    const plot = histogram((range, mark) => change({
      // At the ends of what there is, there is no limit.
      min: range && range[0] > (plot.data?.min ?? -Infinity) ? range[0] : null,
      max: range && range[1] < (plot.data?.max ?? Infinity) ? range[1] : null,
    }, mark));
    plot.dataset.index = index;
    fill(plot, filter.property, filter.component ?? 'magnitude').then(() => this.update());
    return h('div', { class: 'block card' },
      h('div', { class: 'row' }, select, part,
        h('button', { class: 'plain icon', title: 'Take this range away', 'aria-label': `Take the range of ${filter.property} away`, onclick: () => this.#set(this.filters().filter((_, i) => i !== index)) }, icon('remove'))),
      plot);
  }

  update() {
    const where = store.get(store.mine('where')) ?? '';
    if (this.box.value !== (this.typed ?? where)) {
      this.box.value = this.typed ?? where;
      this.check();
    }
    for (const plot of /** @type {NodeListOf<any>} */ (this.querySelectorAll('motes-histogram'))) {
      const f = this.filters()[plot.dataset.index];
      if (!f) continue;
      const none = (f.min ?? null) === null && (f.max ?? null) === null;
      plot.range = none ? null : [f.min ?? plot.data?.min ?? 0, f.max ?? plot.data?.max ?? 1];
      plot.draw();
    }
  }

  /** @param {Filter[]} filters @param {boolean} [mark] */
  #set(filters, mark = true) {
    const plain = filters.map((f) => Object.fromEntries(Object.entries(f).filter(([, v]) => v !== null && v !== undefined)));
    store.change({ [store.mine('filter')]: plain }, mark);
  }

  /** @param {string} name */
  #insert(name) {
    const plain = /^[A-Za-z_][\w ]*$/.test(name) ? name : `\`${name}\``;
    this.box.setRangeText(plain, this.box.selectionStart, this.box.selectionEnd, 'end');
    this.box.focus();
    this.typed = this.box.value;
    this.check();
  }

  /** Asks how many it would be, or what is wrong. */
  async #check() {
    const where = this.box.value.trim();
    const mine = (this.asked += 1);
    const say = (/** @type {string} */ text, /** @type {boolean} */ bad) => mine === this.asked && this.#say(text, bad);
    try {
      const { count: n } = await store.line.ask('check', { system: store.system, where });
      say(where === '' ? '' : `${count(n)} of ${count(system()?.particles ?? n)} particles`, false);
      return true;
    } catch (error) {
      say(/** @type {Error} */ (error).message, true);
      return false;
    }
  }

  async #apply() {
    const where = this.box.value.trim();
    if (where === (store.get(store.mine('where')) ?? '')) {
      this.typed = undefined;
      return this.#check();
    }
    // What was typed stays, with what is wrong with it under it.
    if (!(await this.#check())) return;
    try {
      await store.set({ [store.mine('where')]: where });
      this.typed = undefined;
      this.#check();
    } catch (error) {
      this.#say(/** @type {Error} */ (error).message, true);
    }
  }

  /** @param {string} text @param {boolean} bad */
  #say(text, bad) {
    this.says.textContent = text;
    this.says.classList.toggle('bad', bad);
    this.box.toggleAttribute('aria-invalid', bad);
  }
}

customElements.define('motes-panel-filter', FilterPanel);
