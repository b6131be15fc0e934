/** @file `<motes-stage>`: the picture, as large as the room it has; what is drawn over it; what comes of touching it. */
import { h, quiet, Part } from './dom.js';
import { store } from './store.js';
import { count, number } from './format.js';
import { gestures } from './gestures.js';
import './overlay.js';
import './card.js';

/** More pixels than this are not asked for: width × height. */
const MOST_PIXELS = 3840 * 2160;
/** Milliseconds that words under the picture stand at least. */
const READING = 250;

class Stage extends Part {
  /** The size of the picture, `1280×720`, and the one that was asked for. */
  size = '';
  asked = '';
  /** Times of the last pictures. @type {number[]} */
  times = [];
  /** When the words were written last. */
  read = 0;
  resized = quiet(60, () => this.#resize());

  start() {
    this.canvas = h('canvas', {
      tabindex: 0, role: 'img', 'aria-label': 'The picture. Arrow keys turn it; press ? for all keys.',
    });
    // The browser enlarges coarse pictures while it puts the page together: quicker than to draw them larger.
    this.context = /** @type {ImageBitmapRenderingContext} */ (this.canvas.getContext('bitmaprenderer'));
    this.readout = h('div', { class: 'readout' });
    this.hint = h('div', { class: 'hint', role: 'status', hidden: true });
    this.wait = h('div', { class: 'wait' }, h('span', { class: 'ring' }), h('span', {}, 'Opening…'));
    this.replaceChildren(this.canvas, h('motes-overlay'), this.hint, this.readout, h('motes-card'), this.wait);
    gestures(this.canvas);
    store.measure = () => {
      const size = this.#measure();
      this.asked = this.size;
      return size;
    };

    new ResizeObserver(() => this.resized()).observe(this);
    this.listen(store, 'frame', (e) => this.#show(e.detail));
    this.listen(store, 'hello', () => this.#hello());
    this.listen(store, 'stats', (e) => { this.stats = e.detail; this.#read(); });
    this.listen(store, 'progress', (e) => this.#progress(e.detail));
    this.listen(store, 'tool', () => { this.dataset.tool = store.tool; });
    this.listen(store, 'hint', (e) => { this.hint.hidden = !e.detail; this.hint.textContent = e.detail ?? ''; });
    this.listen(store, 'link', (e) => this.classList.toggle('stale', e.detail.state !== 'open'));
    this.dataset.tool = store.tool;
  }

  #hello() {
    this.#resize();
    const names = store.systems.map((s) => s.name || s.source).join(', ');
    document.title = names ? `${names} – Motes` : 'Motes';
  }

  /** How large the picture is to be, in device pixels. */
  #measure() {
    const room = this.getBoundingClientRect();
    const [w, h] = [Math.max(2, room.width), Math.max(2, room.height)];
    const sharp = Math.min(devicePixelRatio || 1, Math.sqrt(MOST_PIXELS / (w * h)));
    const [width, height] = [Math.round(w * sharp), Math.round(h * sharp)];
    store.aspect = width / height;
    this.size = `${width}×${height}`;
    return { width, height };
  }

  /** Tells the server if the size has changed. */
  #resize() {
    // What is hidden has no size.
    if (this.clientWidth < 2 || this.clientHeight < 2) return;
    const size = this.#measure();
    store.tell('camera');
    if (this.size === this.asked || !store.line?.open) return;
    this.asked = this.size;
    store.ask('resize', size);
  }

  /** @param {import('./types.js').Frame} frame */
  async #show(frame) {
    let picture;
    try {
      picture = await createImageBitmap(frame.blob);
    } catch {
      store.line.say('shown', { serial: frame.serial });
      return;
    }
    store.line.say('shown', { serial: frame.serial });
    // Decoding may overtake: an older picture is never drawn over a newer one.
    if (this.frame && frame.serial < this.frame.serial && frame.serial > 1) return picture.close();
    // A picture of another shape, made before the window changed, keeps its own.
    const [width, height] = this.size.split('×').map(Number);
    const fits = Math.abs((width * frame.height) / (height * frame.width) - 1) < 0.03;
    this.canvas.classList.toggle('other', !fits);
    if (this.canvas.width !== frame.width || this.canvas.height !== frame.height) {
      this.canvas.width = frame.width;
      this.canvas.height = frame.height;
    }
    /** @type {ImageBitmapRenderingContext} */ (this.context).transferFromImageBitmap(picture);
    this.frame = frame;
    this.wait.hidden = true;
    this.canvas.dataset.serial = frame.serial;
    this.canvas.dataset.state = frame.state;
    this.canvas.dataset.hash = frame.exact ? frame.hash : '';
    this.canvas.dataset.exact = frame.exact;
    const now = performance.now();
    this.times = [...this.times, now].filter((t) => now - t < 1000);
    // Faster than one can read, words only cost time.
    if (frame.exact || now - this.read > READING) this.#read();
    store.tell('shown', frame);
  }

  /** What the picture is: particles, size, time. */
  #read() {
    const frame = this.frame;
    if (!frame) return;
    this.read = performance.now();
    const particles = store.systems.reduce((n, s) => n + s.particles, 0);
    const visible = this.stats?.particles?.visible;
    const moving = this.times.length > 2 && !frame.exact;
    this.readout.replaceChildren(
      h('span', {}, visible !== undefined && visible !== particles
        ? `${count(visible)} of ${count(particles)} particles` : `${count(particles)} particles`),
      h('span', {}, `${frame.width} × ${frame.height}`),
      h('span', { title: frame.exact ? `Hash of the picture: ${frame.hash}` : 'Drawn quickly while things move' },
        moving ? `${this.times.length} pictures/s` : `${number(frame.ms, 2)} ms`),
      h('span', { class: frame.exact ? 'exact' : 'coarse' }, frame.exact ? 'exact' : 'refining…'),
    );
  }

  /** @param {{stage: string, done: number, total: number}} progress */
  #progress({ stage, done, total }) {
    const over = total > 0 && done >= total;
    this.wait.hidden = over && Boolean(this.frame);
    this.wait.classList.toggle('small', Boolean(this.frame));
    const part = total > 0 ? ` ${Math.round((100 * done) / total)} %` : '';
    /** @type {any} */ (this.wait.lastElementChild).textContent = `${stage}${part}`;
  }
}

customElements.define('motes-stage', Stage);
