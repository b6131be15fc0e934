/** @file `<motes-toolbar>`: tools, views, undo, saving. */
import { h, Part, copy } from './dom.js';
import { icon, change } from './icons.js';
import { project, turned, VIEWS } from './keys.js';
import { share } from './address.js';
import { store } from './store.js';
import { dark, turn } from './theme.js';

/** @type {[string, string, string][]} tool, icon, what it does */
const TOOLS = [
  ['move', 'move', 'Turn and ask (Esc)'],
  ['distance', 'distance', 'Measure a distance (M)'],
  ['angle', 'angle', 'Measure an angle (N)'],
  ['box', 'box', 'Select by a box (B)'],
  ['cut', 'cut', 'Cut by dragging (X)'],
];

const SIDES = ['Front', 'Right', 'Top', 'Back', 'Left', 'Bottom'];

class Toolbar extends Part {
  /** @type {any[]} */
  tools = [];

  start() {
    this.setAttribute('role', 'toolbar');
    this.setAttribute('aria-label', 'Tools');
    this.source = h('span', { class: 'source' });
    this.state = h('button', { class: 'plain state', hidden: true, onclick: () => store.line?.retry() });
    this.tools = TOOLS.map(([tool, glyph, title]) => this.#button(glyph, title, () => store.use(store.tool === tool ? 'move' : tool), { 'data-tool': tool, 'aria-pressed': 'false' }));
    this.projection = this.#button('perspective', 'Perspective or orthographic (P, O)', () => project(store.get('camera.projection') === 'perspective' ? 'orthographic' : 'perspective'));
    this.undo = this.#button('undo', 'Undo (Ctrl Z)', () => store.ask('undo'));
    this.redo = this.#button('redo', 'Redo (Ctrl Shift Z)', () => store.ask('redo'));
    this.theme = this.#button(dark() ? 'light' : 'dark', 'Dark or light', turn);
    const link = this.#button('share', 'Copy the address of this view', async () => {
      const address = await share();
      if (!address) return;
      await copy(address, link);
      store.notice('The address of this view is copied: opened again, it gives the same view.');
    });
    const group = (/** @type {any[]} */ ...parts) => h('div', { class: 'group' }, parts);
    this.replaceChildren(
      h('div', { class: 'name' }, h('img', { src: '/page/icon.svg', alt: '', width: 18, height: 18 }), h('b', {}, 'Motes'), this.source),
      group(this.tools),
      group(this.#button('fit', 'Fit what is visible (F)', () => store.fit()), this.#views(), this.projection),
      group(this.undo, this.redo),
      h('span', { class: 'gap' }),
      this.state,
      group(h('button', { class: 'prime', title: 'Save a picture, a film, a scene (Ctrl S)', onclick: () => store.tell('save') }, icon('save'), h('span', {}, 'Save')), link),
      group(this.theme, this.#button('help', 'Keys and mouse (?)', () => store.tell('help'))));
    this.listen(store, 'scene hello', () => this.#update());
    this.listen(store, 'systems', () => this.#update());
    this.listen(store, 'tool', () => this.#tools());
    this.listen(store, 'link', (e) => this.#link(e.detail));
    this.listen(document, 'theme', () => change(this.theme, dark() ? 'light' : 'dark'));
    this.#tools();
    this.#update();
  }

  /** @param {string} glyph @param {string} title @param {() => void} onclick @param {Record<string, any>} [more] */
  #button(glyph, title, onclick, more = {}) {
    return h('button', { class: 'plain icon', title, 'aria-label': title.replace(/ \(.*\)/, ''), onclick, ...more }, icon(glyph));
  }

  #views() {
    const list = h('div', { class: 'menu', role: 'menu', id: 'views', popover: 'auto' }, SIDES.map((side, i) =>
      h('button', { role: 'menuitem', onclick: () => { list.hidePopover(); store.fit(turned(VIEWS[i])); } }, side, h('kbd', {}, i + 1))));
    const button = this.#button('axes', 'Look along an axis (1–6)', () => {}, { popovertarget: 'views', 'aria-haspopup': 'menu' });
    list.addEventListener('beforetoggle', () => {
      const box = button.getBoundingClientRect();
      list.style.left = `${box.left}px`;
      list.style.top = `${box.bottom + 6}px`;
    });
    return [button, list];
  }

  #update() {
    const names = store.systems.map((s) => s.name || s.source);
    this.source.textContent = names.join(', ');
    this.source.title = store.systems.map((s) => `${s.source} · ${s.format} · ${s.particles} particles`).join('\n');
    this.undo.disabled = !store.undo;
    this.redo.disabled = !store.redo;
    change(this.projection, store.get('camera.projection') === 'orthographic' ? 'orthographic' : 'perspective');
    for (const tool of this.tools) if (tool.dataset.tool === 'cut') tool.hidden = !store.has('section');
  }

  #tools() {
    for (const tool of this.tools) tool.setAttribute('aria-pressed', String(tool.dataset.tool === store.tool));
  }

  /** @param {{state: string, retry?: number, attempt?: number}} link */
  #link({ state, attempt = 0 }) {
    this.state.hidden = state === 'open';
    this.state.textContent = state === 'refused' ? 'Needs its address again'
      : attempt > 2 || state === 'ended' ? 'Not connected · try again' : 'Connecting…';
  }
}

customElements.define('motes-toolbar', Toolbar);
