/** @file `<motes-timeline>`: frames and playing them; the controls of a simulation that runs. */
import { h, Part } from './dom.js';
import { icon, change } from './icons.js';
import { count, parse } from './format.js';
import { store } from './store.js';

/** Pictures per second to choose from. */
const SPEEDS = [1, 2, 5, 10, 15, 24, 25, 30, 60];

class Timeline extends Part {
  start() {
    this.setAttribute('role', 'group');
    this.setAttribute('aria-label', 'Time');
    const button = (/** @type {string} */ glyph, /** @type {string} */ title, /** @type {() => void} */ onclick) =>
      h('button', { class: 'plain icon', title, 'aria-label': title, onclick }, icon(glyph));
    this.play = button('play', 'Play (Space)', () => this.#toggle());
    this.loop = h('button', { class: 'plain icon', title: 'Begin again at the end', 'aria-label': 'Begin again at the end', 'aria-pressed': 'true', onclick: () => {
      this.loop.setAttribute('aria-pressed', String(this.loop.getAttribute('aria-pressed') !== 'true'));
      if (this.playing) this.#send(true);
    } }, icon('loop'));
    this.slider = h('input', {
      type: 'range', min: 0, step: 1, 'aria-label': 'Frame',
      oninput: () => this.#go(Number(this.slider.value), false),
      onchange: () => this.#go(Number(this.slider.value), true),
    });
    this.ahead = h('i', { class: 'ahead' });
    this.box = h('input', { type: 'text', class: 'number', inputmode: 'numeric', 'aria-label': 'Frame, from 0', onchange: () => {
      const typed = parse(this.box.value);
      if (typed !== undefined) this.#go(Math.round(typed), true);
    } });
    this.of = h('span', { class: 'of' });
    this.speed = h('select', { 'aria-label': 'Pictures per second', onchange: () => this.playing && this.#send(true) }, SPEEDS.map((s) => h('option', { value: s, selected: s === 25 }, `${s}/s`)));
    this.drop = h('input', { type: 'checkbox', id: 'drop', onchange: () => this.playing && this.#send(true) });
    this.live = this.#live();
    this.film = h('div', { class: 'film' },
      h('div', { class: 'group' }, this.#far(button('first', 'First frame', () => this.#go(0, true))), button('back', 'Frame back (,)', () => this.#step(-1)), this.play, button('on', 'Frame on (.)', () => this.#step(1)), this.#far(button('last', 'Last frame', () => this.#go(this.frames - 1, true)))),
      h('div', { class: 'track' }, this.ahead, this.slider),
      h('div', { class: 'where' }, this.box, this.of),
      h('div', { class: 'group options' }, this.loop, this.speed, h('label', { for: 'drop', title: 'Leave frames out rather than fall behind' }, this.drop, 'in time')));
    this.replaceChildren(this.live, this.film);
    this.listen(store, 'scene systems', () => this.#update());
    this.listen(store, 'hello', () => this.#begin());
    this.listen(store, 'frame', (e) => this.#frame(e.detail));
    this.listen(store, 'ahead', (e) => this.#ahead(e.detail.frames));
    this.listen(store, 'toggle-play', () => this.#toggle());
    this.listen(store, 'step', (e) => this.#step(e.detail));
    this.#update();
  }

  /** Not on a phone. @param {any} button */
  #far(button) {
    button.classList.add('far');
    return button;
  }

  /** Pause, step, start again, and how fine, of a simulation. */
  #live() {
    this.run = h('button', { class: 'plain icon', title: 'Pause or go on', 'aria-label': 'Pause or go on', onclick: () => this.#run() }, icon('pause'));
    const particles = h('input', {
      type: 'range', min: Math.log(500), max: Math.log(2e6), step: 'any', 'aria-label': 'Particles of the simulation',
      oninput: () => { this.fine.textContent = count(round(particles.value)); },
      onchange: () => store.ask('live', { action: 'restart', particles: round(particles.value) }),
    });
    const round = (/** @type {string} */ v) => Number(Math.exp(Number(v)).toPrecision(2));
    this.particles = particles;
    this.fine = h('span', { class: 'of' });
    const live = (/** @type {string} */ action) => store.ask('live', { action });
    return h('div', { class: 'live', hidden: true },
      h('span', { class: 'label' }, 'Simulation'),
      h('div', { class: 'group' }, this.run,
        h('button', { class: 'plain icon', title: 'One frame on', 'aria-label': 'One frame of the simulation on', onclick: () => live('step') }, icon('step')),
        h('button', { class: 'plain icon', title: 'From the beginning', 'aria-label': 'Simulation from the beginning', onclick: () => live('restart') }, icon('restart'))),
      h('label', { class: 'fine' }, 'Particles', particles, this.fine));
  }

  #run() {
    store.ask('live', { action: this.playing ? 'pause' : 'run' });
  }

  /** A simulation that is looked at for the first time runs. */
  #begin() {
    const fresh = !store.undo && !this.playing && !store.get('image.frame') && !location.hash;
    if (fresh && !this.begun && store.systems.some((s) => s.live)) this.#run();
    this.begun = true;
  }

  get frames() {
    return store.resolved?.frames ?? 1;
  }

  get playing() {
    return Boolean(store.resolved?.playing);
  }

  #update() {
    const live = store.systems.find((s) => s.live);
    this.live.hidden = !live;
    this.film.hidden = this.frames < 2;
    this.hidden = this.live.hidden && this.film.hidden;
    document.body.classList.toggle('timed', !this.hidden);
    if (live && !this.particles.matches(':active')) {
      this.particles.value = Math.log(Math.max(500, live.particles));
      this.fine.textContent = count(live.particles);
    }
    this.slider.max = Math.max(0, this.frames - 1);
    this.of.textContent = `of ${count(this.frames)}`;
    for (const button of [this.play, this.run]) change(button, this.playing ? 'pause' : 'play');
    this.play.setAttribute('aria-pressed', String(this.playing));
    if (!this.playing) this.#at(store.get('image.frame') ?? 0);
  }

  /** @param {import('./types.js').Frame} frame */
  #frame(frame) {
    if (frame.playing) this.#at(frame.frame);
  }

  /** @param {number} frame */
  #at(frame) {
    if (!this.slider.matches(':active')) this.slider.value = frame;
    if (document.activeElement !== this.box) this.box.value = frame;
    this.slider.style.setProperty('--at', `${(100 * frame) / Math.max(1, this.frames - 1)}%`);
  }

  /** Frames that lie ready. @param {[number, number]|null} range */
  #ahead(range) {
    const most = Math.max(1, this.frames - 1);
    this.ahead.hidden = !range;
    if (!range) return;
    this.ahead.style.left = `${(100 * range[0]) / most}%`;
    this.ahead.style.width = `${(100 * (range[1] - range[0])) / most}%`;
  }

  /** @param {number} to @param {boolean} mark */
  #go(to, mark) {
    const frame = Math.max(0, Math.min(this.frames - 1, to));
    store.change({ 'image.frame': frame }, mark);
    this.#at(frame);
  }

  /** @param {number} by */
  #step(by) {
    if (this.frames < 2) return;
    if (this.playing) this.#send(false);
    this.#go((Number(this.slider.value) + by + this.frames) % this.frames, true);
  }

  #toggle() {
    if (!this.live.hidden) this.#run();
    else if (this.frames > 1) this.#send(!this.playing);
  }

  /** @param {boolean} on */
  #send(on) {
    store.ask('play', { on, fps: Number(this.speed.value), loop: this.loop.getAttribute('aria-pressed') === 'true', drop: this.drop.checked });
  }
}

customElements.define('motes-timeline', Timeline);
