/** @file `<motes-dock>`: the panels at the right, one open at a time; on a phone a sheet from below. */
import { h, Part } from './dom.js';
import { icon } from './icons.js';
import { store } from './store.js';
import './panel-look.js';
import './panel-types.js';
import './panel-filter.js';
import './panel-cut.js';
import './panel-light.js';
import './panel-picture.js';
import './panel-ask.js';
import './panel-all.js';
import './panel-log.js';

/** @type {[string, string, string][]} name, title, what it is about */
const PANELS = [
  ['look', 'Look', 'What particles look like'],
  ['types', 'Types', 'Types of particles: shown or not, their colours'],
  ['filter', 'Filter', 'Which particles are shown'],
  ['cut', 'Cut', 'Planes that cut things open'],
  ['light', 'Light', 'Light and shadow'],
  ['picture', 'Picture', 'Background, samples, camera, annotations'],
  ['ask', 'Measure', 'Measure, select, count'],
  ['all', 'All', 'Every parameter there is'],
  ['log', 'Log', 'Messages'],
];

class Dock extends Part {
  /** @type {any[]} */
  tabs = [];
  /** Name of the panel that is open. */
  open = '';

  start() {
    const wide = matchMedia('(min-width: 760px)').matches;
    this.open = localStorage.getItem('motes-panel') ?? (wide ? 'look' : '');
    this.tabs = PANELS.map(([name, title, about]) => h('button', {
      role: 'tab', id: `tab-${name}`, 'data-panel': name, title: about, 'aria-controls': 'panel',
      onclick: () => this.#toggle(name),
      onkeydown: (/** @type {KeyboardEvent} */ e) => this.#key(e),
    }, icon(name), h('span', {}, title)));
    this.body = h('section', { id: 'panel', role: 'tabpanel', tabindex: -1 });
    this.replaceChildren(this.body, h('nav', { role: 'tablist', 'aria-label': 'Panels', 'aria-orientation': 'vertical' }, this.tabs));
    this.listen(store, 'hello', () => {
      // A plain panel is there when the schema knows what it is about.
      this.#tab('cut').hidden = !store.has('section');
      if (this.open === 'cut' && !store.has('section')) this.open = 'look';
      this.#show();
    });
    this.listen(store, 'panel', (e) => this.open !== e.detail && this.#toggle(e.detail));
    this.listen(store, 'notice', (e) => e.detail.severity !== 'info' && this.#tab('log').classList.toggle('news', this.open !== 'log'));
    this.#show();
  }

  /** @param {string} name */
  #tab(name) {
    return this.tabs[PANELS.findIndex(([n]) => n === name)];
  }

  /** @param {string} name */
  #toggle(name) {
    this.open = this.open === name ? '' : name;
    localStorage.setItem('motes-panel', this.open);
    this.#show();
    if (this.open) this.body.scrollTop = 0;
  }

  /** @param {KeyboardEvent} e */
  #key(e) {
    const step = { ArrowDown: 1, ArrowRight: 1, ArrowUp: -1, ArrowLeft: -1 }[e.key];
    if (!step) return;
    e.preventDefault();
    const shown = this.tabs.filter((t) => !t.hidden);
    const at = shown.indexOf(/** @type {any} */ (e.currentTarget));
    shown[(at + step + shown.length) % shown.length].focus();
  }

  #show() {
    this.classList.toggle('folded', !this.open);
    for (const tab of this.tabs) {
      const on = tab.dataset.panel === this.open;
      tab.setAttribute('aria-selected', String(on));
      tab.tabIndex = on || (!this.open && tab === this.tabs[0]) ? 0 : -1;
      if (on) tab.classList.remove('news');
    }
    this.body.hidden = !this.open;
    if (!this.open) return this.body.replaceChildren();
    const [, title, about] = /** @type {[string, string, string]} */ (PANELS.find(([name]) => name === this.open));
    this.body.setAttribute('aria-labelledby', `tab-${this.open}`);
    // Before the server has said what there is, there is nothing to show; messages there always are.
    const ready = store.resolved || this.open === 'log';
    this.body.replaceChildren(
      h('header', {}, h('h2', { title: about }, title),
        h('button', { class: 'plain icon', title: 'Fold the panel', 'aria-label': 'Fold the panel', onclick: () => this.#toggle(this.open) }, icon('close'))),
      ready ? h(`motes-panel-${this.open}`) : '');
  }
}

customElements.define('motes-dock', Dock);
