/** @file `<motes-save>`: pictures, layers, films, the scene, the command line, the address. */
import { copy, h, Part } from './dom.js';
import { icon } from './icons.js';
import { share } from './address.js';
import { store } from './store.js';

/** @type {[string, number, number][]} */
const SIZES = [['1280 × 720', 1280, 720], ['1920 × 1080', 1920, 1080], ['3840 × 2160', 3840, 2160], ['Square 2048', 2048, 2048], ['A4 300 dpi', 3508, 2480]];

class Save extends Part {
  start() {
    this.listen(store, 'save', () => this.#open());
  }

  async #open() {
    if (!store.resolved) return;
    const [seenWidth, seenHeight] = /** @type {any} */ (document.querySelector('motes-stage')).size.split('×').map(Number);
    const number = (/** @type {string} */ label, /** @type {number} */ value) => h('input', { type: 'number', min: 1, max: 32768, value, 'aria-label': label });
    this.width = number('Width, pixels', seenWidth);
    this.height = number('Height, pixels', seenHeight);
    this.samples = h('input', { type: 'number', min: 1, max: 4096, placeholder: 'as now', 'aria-label': 'Rays per pixel' });
    const sizes = [['As seen', seenWidth, seenHeight], ...SIZES].map(([name, w, hh]) => h('button', { class: 'chip', onclick: () => { this.width.value = w; this.height.value = hh; } }, name));
    const dialog = h('dialog', { 'aria-labelledby': 'save-title', onclose: () => dialog.remove() },
      h('header', {}, h('h2', { id: 'save-title' }, 'Save'), h('form', { method: 'dialog' }, h('button', { class: 'plain icon', 'aria-label': 'Close', title: 'Close' }, icon('close')))),
      h('section', {}, h('h3', {}, 'Picture'),
        h('div', { class: 'chips' }, sizes),
        h('div', { class: 'row' }, this.width, '×', this.height, h('span', { class: 'muted' }, 'pixels'), h('span', { class: 'gap' }), h('label', {}, 'Rays per pixel ', this.samples)),
        h('div', { class: 'buttons' },
          this.#get('PNG', 'picture.png', 'The picture, with its scene in it', true),
          this.#get('EXR', 'picture.exr', 'Linear light and all layers, for compositing', true),
          this.#get('Layers', 'layers.npz', 'Colour, depth, normal, id for NumPy', true))),
      this.#film(), this.#scene());
    this.replaceChildren(dialog);
    dialog.showModal();
  }

  /** @param {string} text @param {string} file @param {string} title @param {boolean} prime @param {() => Record<string, any>} [more] */
  #get(text, file, title, prime, more) {
    return h('button', { class: prime ? 'prime' : '', title, onclick: () => {
      const size = { width: this.width.value, height: this.height.value, samples: this.samples.value || undefined };
      const query = more ? { ...size, ...more() } : file.endsWith('.toml') ? {} : size;
      h('a', { href: store.address(file, query), download: file }).click();
      store.notice(`${text} is being made; the browser keeps it when it is done.`);
    } }, icon('save'), text);
  }

  #film() {
    const frames = store.resolved.frames;
    const [first, last, fps] = [[0, 0], [frames - 1, frames - 1], [Number(store.get('film.fps') ?? 25), 240]].map(([value, max]) => h('input', { type: 'number', min: 0, max: Math.max(0, max), value }));
    return h('section', {}, h('h3', {}, 'Film'),
      frames > 1 ? h('div', { class: 'row' }, h('label', {}, 'Frames ', first), h('label', {}, ' to ', last), h('span', { class: 'gap' }), h('label', {}, 'Pictures/s ', fps))
        : h('p', { class: 'muted' }, 'Of a single frame that the camera goes around: set “Turn” under Picture, Film.'),
      h('div', { class: 'buttons' }, this.#get('MP4', 'film.mp4', 'A film in H.264, at the size above', true, () => (frames > 1 ? { first: first.value, last: last.value, fps: fps.value } : { fps: fps.value }))));
  }

  #scene() {
    const text = h('textarea', { readonly: true, rows: 4, 'aria-label': 'Command line', spellcheck: 'false' });
    store.ask('command').then((answer) => { text.value = answer?.text ?? ''; });
    const copier = h('button', { onclick: () => copy(text.value, copier) }, icon('copy'), 'Copy the command');
    const link = h('button', { onclick: async () => copy((await share()) ?? '', link) }, icon('share'), 'Copy the address');
    return h('section', {}, h('h3', {}, 'Again'),
      h('p', { class: 'muted' }, 'This command makes this very picture:'), text,
      h('div', { class: 'buttons' }, copier, this.#get('Scene', 'scene.toml', 'What differs from the defaults, for --scene', false), link));
  }
}

customElements.define('motes-save', Save);
