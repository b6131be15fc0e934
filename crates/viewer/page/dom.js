/** @file Elements out of words: the few helpers that every part of the page is written with. */

/** @typedef {Node|string|number|null|undefined|false|any[]} Child a list of them, too */

/**
 * An element: `h('button', {class: 'x', onclick: f}, 'text')`. Names with `on` are listeners, `style` is an
 * object, booleans are present or absent, everything else is an attribute.
 * @param {string} tag
 * @param {Record<string, any>} [attributes]
 * @param {...Child} children
 * @returns {any}
 */
export function h(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  set(element, attributes);
  append(element, children);
  return element;
}

const SVG = 'http://www.w3.org/2000/svg';

/**
 * As `h`, of SVG.
 * @param {string} tag
 * @param {Record<string, any>} [attributes]
 * @param {...Child} children
 * @returns {any}
 */
export function svg(tag, attributes = {}, ...children) {
  const element = document.createElementNS(SVG, tag);
  set(element, attributes);
  append(element, children);
  return element;
}

/** @param {Element} element @param {Record<string, any>} attributes */
function set(element, attributes) {
  for (const [name, value] of Object.entries(attributes)) {
    if (value === undefined || value === null || value === false) continue;
    if (name.startsWith('on')) element.addEventListener(name.slice(2), value);
    else if (name === 'style') Object.assign(/** @type {any} */ (element).style, value);
    else element.setAttribute(name, value === true ? '' : String(value));
  }
}

/** @param {Element} element @param {Child[]} children */
function append(element, children) {
  for (const child of children.flat(9)) {
    if (child === null || child === undefined || child === false) continue;
    element.append(/** @type {any} */ (child instanceof Node ? child : String(child)));
  }
}

/**
 * A custom element that draws itself once and listens while it is in the page.
 */
export class Part extends HTMLElement {
  #gone = new AbortController();

  connectedCallback() {
    this.#gone = new AbortController();
    this.start();
  }

  disconnectedCallback() {
    this.#gone.abort();
  }

  /** Builds the contents; for those who extend this. */
  start() {}

  /**
   * Listens to `target` for as long as this is in the page.
   * @param {EventTarget} target
   * @param {string} names separated by blanks
   * @param {(event: any) => void} listener
   * @param {AddEventListenerOptions} [options]
   */
  listen(target, names, listener, options = {}) {
    for (const name of names.split(' ')) {
      target.addEventListener(name, listener, { ...options, signal: this.#gone.signal });
    }
  }
}

/**
 * Follows a pointer from its pressing to its release.
 * @param {PointerEvent} down
 * @param {(event: PointerEvent) => void} move
 * @param {(event: PointerEvent) => void} [end]
 */
export function follow(down, move, end) {
  const target = /** @type {Element} */ (down.currentTarget);
  const done = new AbortController();
  const mine = (/** @type {any} */ event) => event.pointerId === down.pointerId;
  target.setPointerCapture(down.pointerId);
  target.addEventListener('pointermove', (e) => mine(e) && move(/** @type {PointerEvent} */ (e)), done);
  for (const name of ['pointerup', 'pointercancel']) {
    target.addEventListener(name, (e) => {
      if (!mine(e)) return;
      done.abort();
      end?.(/** @type {PointerEvent} */ (e));
    }, done);
  }
}

/** Where an event is in the picture, 0…1. @param {Element} canvas @param {{clientX: number, clientY: number}} e */
export function within(canvas, e) {
  const box = canvas.getBoundingClientRect();
  return { x: (e.clientX - box.left) / box.width, y: (e.clientY - box.top) / box.height };
}

/**
 * `f` once things have been quiet for `ms`.
 * @template {any[]} A
 * @param {number} ms
 * @param {(...args: A) => void} f
 * @returns {(...args: A) => void}
 */
export function quiet(ms, f) {
  /** @type {number|undefined} */
  let timer;
  return (...args) => {
    clearTimeout(timer);
    timer = window.setTimeout(() => f(...args), ms);
  };
}

/**
 * Copies text, and says so.
 * @param {string} text
 * @param {HTMLElement} [button] that shows a tick for a moment
 */
export async function copy(text, button) {
  try {
    await navigator.clipboard.writeText(text);
  } catch {
    // Pages over plain HTTP from elsewhere have no clipboard of their own.
    const area = h('textarea', { class: 'offscreen' });
    area.value = text;
    (document.querySelector('dialog[open]') ?? document.body).append(area);
    area.select();
    document.execCommand('copy');
    area.remove();
  }
  if (!button) return;
  button.classList.add('done');
  setTimeout(() => button.classList.remove('done'), 1200);
}
