/** @file `<motes-field>`: one parameter of the scene: label, meaning, unit, what edits it, reset, and its error. */
import { follow, h, Part } from './dom.js';
import { editor } from './editors.js';
import { icon } from './icons.js';
import { label } from './format.js';
import { same } from './paths.js';
import { store } from './store.js';

let ids = 0;

/**
 * @typedef {object} Options
 * @property {string} [label]
 * @property {[number, number]} [slide] ends of a slider
 * @property {boolean} [log] whether the slider goes by factors
 * @property {Record<string, string>} [words] what choices are called
 * @property {string[]} [choices] for what the schema knows as text
 * @property {boolean} [explain] whether the meaning is written out
 */

class FieldPart extends Part {
  /** @type {Options} */
  options = {};

  start() {
    const path = /** @type {string} */ (this.getAttribute('path'));
    const field = store.field(path);
    if (!field) return this.remove();
    this.path = path;
    const name = this.options.label ?? label(field.name);
    const shape = this.options.choices ? { ...field.shape, type: /** @type {"choice"} */ ('choice'), choices: this.options.choices } : field.shape;
    const id = `f${++ids}`;
    this.editor = editor({
      ...this.options, shape, id, name,
      empty: this.#empty(field),
      optional: field.default === undefined || field.default === null,
      send: (value, mark) => this.#send(value, mark),
    });
    this.reset = h('button', { class: 'plain icon reset', title: 'Back to the default', 'aria-label': `${name}: back to the default`, onclick: () => this.#send(null, true) }, icon('reset'));
    this.error = h('p', { class: 'error', role: 'alert', hidden: true });
    const title = h('label', { for: id, title: field.meaning }, name, h('span', { class: 'unit' }, unit(field)));
    if (this.editor.nudge) this.#drag(title);
    // What is wide has a line of its own.
    const letters = (shape.type === 'choice' && !this.editor.element.matches('select') && this.editor.element.textContent.length) || 0;
    this.classList.toggle('long', shape.type === 'vec3' || shape.kind !== 'value' || letters > 16);
    this.replaceChildren(title, this.reset, this.editor.element,
      this.options.explain ? h('p', { class: 'meaning' }, field.meaning) : '', this.error);
    this.listen(store, 'scene', () => this.#show());
    this.#show();
  }

  /** What stands where there is no value. @param {import('./types.js').Field} field */
  #empty(field) {
    if (field.default !== undefined && field.default !== null) return '';
    return field.shape.type === 'text' ? field.example ?? '' : 'auto';
  }

  #show() {
    const value = store.get(/** @type {string} */ (this.path));
    const usual = store.default(/** @type {string} */ (this.path));
    this.editor?.show(value ?? usual);
    /** @type {any} */ (this.reset).disabled = same(value ?? usual, usual);
  }

  /** @param {any} value @param {boolean} mark */
  async #send(value, mark) {
    const error = /** @type {any} */ (this.error);
    try {
      await store.set({ [/** @type {string} */ (this.path)]: value }, mark);
      error.hidden = true;
    } catch (reason) {
      error.hidden = false;
      error.textContent = /** @type {Error} */ (reason).message;
    }
  }

  /** Dragging the label to the side changes the number. @param {any} title */
  #drag(title) {
    title.classList.add('drag');
    title.addEventListener('pointerdown', (/** @type {PointerEvent} */ down) => {
      if (down.button !== 0) return;
      let [last, moved] = [down.clientX, false];
      follow(down, (e) => {
        const steps = Math.trunc((e.clientX - last) / 4);
        if (!steps) return;
        last += steps * 4;
        moved = true;
        this.editor?.nudge?.(steps, false);
      }, () => moved && this.editor?.nudge?.(0, true));
    });
  }
}

customElements.define('motes-field', FieldPart);

/**
 * The control for a parameter; nothing if the schema does not have it.
 * @param {string} path
 * @param {Options} [options]
 */
export function field(path, options = {}) {
  if (!store.has(path)) return null;
  const part = h('motes-field', { path });
  part.options = options;
  return part;
}

/** The unit of a parameter in a sign; lengths of the world have none. @param {import('./types.js').Field} field */
function unit({ unit: words = '' }) {
  if (/degree/.test(words)) return '°';
  if (/pixel/.test(words)) return 'px';
  return /world|unit|radi/.test(words) ? '' : words;
}

/** A heading with what belongs to it, which folds. @param {string} title @param {boolean} open @param {...any} children */
export function fold(title, open, ...children) {
  return h('details', { class: 'fold', open }, h('summary', {}, icon('more'), title), h('div', { class: 'folded' }, children));
}
