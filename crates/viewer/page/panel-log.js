/** @file The panel Log: every message there was, and how long things took. */
import { copy, h, Part } from './dom.js';
import { icon } from './icons.js';
import { count, number } from './format.js';
import { messages } from './messages.js';
import { store } from './store.js';

/** The last word of the server on how long things took. @type {any} */
let stats = null;
store.addEventListener('stats', (e) => { stats = /** @type {CustomEvent} */ (e).detail; });

class Log extends Part {
  start() {
    this.listen(store, 'notice stats', () => this.#show());
    this.#show();
  }

  #show() {
    const copier = h('button', { class: 'plain small', onclick: () => copy(messages.map((m) => `${m.time} ${m.severity} ${m.text}`).join('\n'), copier) }, icon('copy'), 'Copy');
    const rows = /** @type {[string, string][]} */ ([
      ...Object.entries(stats?.ms ?? {}).filter(([, v]) => typeof v === 'number').map(([k, v]) => [k, `${number(v, 3)} ms`]),
      ...Object.entries(stats?.particles ?? {}).filter(([, v]) => typeof v === 'number').map(([k, v]) => [k, count(/** @type {number} */ (v))]),
      ['threads', stats?.threads], ['instructions', stats?.simd], ['hash', stats?.hash],
    ].filter(([, v]) => v !== undefined && v !== null));
    this.replaceChildren(
      messages.length ? h('ul', { class: 'log' }, [...messages].reverse().map((m) => h('li', { class: m.severity }, h('time', {}, m.time), h('span', {}, m.text)))) : h('p', { class: 'empty' }, 'No messages.'),
      messages.length ? copier : '',
      h('h3', {}, 'The exact picture'),
      stats ? h('dl', { class: 'stats' }, rows.map(([k, v]) => [h('dt', {}, k), h('dd', {}, String(v))])) : h('p', { class: 'empty' }, 'None yet.'),
      h('p', { class: 'muted' }, store.version ? `Motes ${store.version}` : ''));
  }
}

customElements.define('motes-panel-log', Log);
