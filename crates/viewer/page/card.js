/** @file `<motes-card>`: all that is known of the particle that was asked for. */
import { copy, h, Part } from './dom.js';
import { icon } from './icons.js';
import { number, values } from './format.js';
import { kind } from './hover.js';
import { store } from './store.js';

class Card extends Part {
  start() {
    this.setAttribute('role', 'region');
    this.setAttribute('aria-label', 'Particle');
    this.listen(store, 'picked', () => this.#show());
    this.hidden = true;
  }

  #show() {
    const picked = store.picked;
    this.hidden = !picked;
    if (!picked) return;
    const rows = this.#rows(picked);
    const close = () => {
      store.picked = null;
      store.tell('picked');
    };
    const copied = () => copy(rows.map(([name, value]) => `${name}\t${value}`).join('\n'), copier);
    const copier = h('button', { class: 'plain', title: 'Copy as a table', onclick: copied }, icon('copy'), 'Copy');
    const go = () => store.camera && store.look(store.camera.about(picked.position), true);
    this.replaceChildren(
      h('header', {},
        h('i', { class: 'dot', style: { background: this.#color(picked) } }),
        h('b', {}, kind(picked) || 'Particle'),
        h('span', { class: 'muted' }, store.systems.length > 1 ? picked.name : ''),
        h('button', { class: 'plain icon', title: 'Close', 'aria-label': 'Close', onclick: close }, icon('close'))),
      h('dl', {}, rows.map(([name, value]) => [h('dt', { title: name }, name), h('dd', {}, value)])),
      h('footer', {},
        h('button', { class: 'plain', title: 'Turn about this particle (double click in the picture)', onclick: go }, icon('target'), 'Centre'),
        copier));
  }

  /** @param {import('./types.js').Picked} picked @returns {[string, string][]} */
  #rows(picked) {
    const head = /** @type {[string, unknown][]} */ ([
      ['Index', String(picked.index)],
      ['Particle Identifier', picked.id === undefined || picked.id === null ? undefined : String(picked.id)],
      ['Element', picked.element],
      ['Type', picked.type === undefined || picked.type === null ? undefined : String(picked.type)],
      ['Position', picked.position.map((p) => number(p, 6)).join('  ')],
      ['Radius', number(picked.radius)],
    ]).filter(([, value]) => value !== undefined);
    const said = new Set(['Position', 'Radius', 'Particle Identifier', 'Particle Type', 'Element']);
    const rest = Object.entries(picked.properties ?? {}).filter(([name]) => !said.has(name));
    return [...head.map(([n, v]) => /** @type {[string, string]} */ ([n, String(v)])),
      ...rest.map(([n, v]) => /** @type {[string, string]} */ ([n, values(v)]))];
  }

  /** @param {import('./types.js').Picked} picked */
  #color(picked) {
    const types = store.systems[picked.system]?.types ?? [];
    const of = [picked.element, picked.type].map(String);
    return types.find((t) => of.includes(t.name))?.color ?? 'var(--accent)';
  }
}

customElements.define('motes-card', Card);
