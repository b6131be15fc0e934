/** @file `<motes-help>`: what mouse, fingers and keys do. */
import { h, Part } from './dom.js';
import { icon } from './icons.js';
import { KEYS } from './keys.js';
import { store } from './store.js';

/** @type {[string, string][]} */
const MOUSE = [
  ['Drag', 'Turn'],
  ['Right drag, Ctrl drag', 'Zoom'],
  ['Middle drag, Shift drag', 'Move aside'],
  ['Wheel', 'Zoom to the pointer'],
  ['Click', 'Ask for a particle'],
  ['Double click', 'Turn about that particle'],
  ['One finger, two fingers', 'Turn; move, zoom and roll'],
  ['Drag the name of a number', 'Change it'],
];

class Help extends Part {
  start() {
    this.listen(store, 'help', () => this.#open());
  }

  #open() {
    const rows = (/** @type {[string, string][]} */ list) => h('dl', { class: 'keys' }, list.map(([key, what]) => [h('dt', {}, h('kbd', {}, key)), h('dd', {}, what)]));
    const dialog = h('dialog', { 'aria-labelledby': 'help-title', class: 'help', onclose: () => dialog.remove() },
      h('header', {}, h('h2', { id: 'help-title' }, 'Mouse and keys'), h('form', { method: 'dialog' }, h('button', { class: 'plain icon', 'aria-label': 'Close', title: 'Close' }, icon('close')))),
      h('div', { class: 'columns' }, rows(MOUSE), rows(KEYS)));
    this.replaceChildren(dialog);
    dialog.showModal();
  }
}

customElements.define('motes-help', Help);
