/**
 * @file What values are edited with: one editor for each type that the schema knows.
 *
 * An editor has an `element`, shows a value by `show(value)` and sends one by `send(value, mark)`; `nudge`
 * moves a number by steps, for dragging its label.
 */
import { h } from './dom.js';
import { number, parse } from './format.js';

/**
 * @typedef {object} Editor
 * @property {any} element
 * @property {(value: any) => void} show
 * @property {(steps: number, mark: boolean) => void} [nudge]
 *
 * @typedef {object} Task
 * @property {import('./types.js').Shape} shape
 * @property {string} id of the element that the label is for
 * @property {string} name for who hears the page
 * @property {string} [empty] shown where there is no value
 * @property {boolean} optional whether there may be no value
 * @property {[number, number]} [slide] ends of a slider
 * @property {boolean} [log] whether the slider goes by factors
 * @property {Record<string, string>} [words] what choices are called
 * @property {(value: any, mark: boolean) => void} send
 */

/** @param {Task} task @returns {Editor} */
export function editor(task) {
  const { shape } = task;
  if (shape.kind === 'list' || shape.kind === 'map') return items(task);
  switch (shape.type) {
    case 'bool': return toggle(task);
    case 'choice': return choice(task);
    case 'color': return color(task);
    case 'vec3': return several(task, ['x', 'y', 'z']);
    case 'range': return several(task, ['from', 'to']);
    case 'number':
    case 'integer': return task.slide ? slider(task) : numeric(task);
    default: return text(task);
  }
}

/** A step that suits a value: a tenth of its first digit. @param {number} value @param {boolean} whole */
function step(value, whole) {
  if (whole) return Math.max(1, 10 ** Math.floor(Math.log10(Math.abs(value) || 1) - 1));
  return value === 0 ? 0.1 : 10 ** (Math.floor(Math.log10(Math.abs(value))) - 1);
}

/** @param {Task} task @returns {Editor} */
export function numeric({ id, name, empty, optional, shape, send }) {
  const whole = shape.type === 'integer';
  /** @type {number|null} */
  let value = null;
  const input = h('input', {
    id, class: 'number', type: 'text', inputmode: 'decimal', autocomplete: 'off', spellcheck: 'false',
    'aria-label': name, placeholder: empty ?? '',
    onchange: () => {
      const typed = parse(input.value);
      if (typed !== undefined) send(whole ? Math.round(typed) : typed, true);
      else if (input.value.trim() === '' && optional) send(null, true);
      else show(value);
    },
    onkeydown: (/** @type {KeyboardEvent} */ e) => {
      const up = { ArrowUp: 1, ArrowDown: -1, PageUp: 10, PageDown: -10 }[e.key];
      if (up) {
        e.preventDefault();
        nudge(up * (e.shiftKey ? 10 : 1), true);
      } else if (e.key === 'Enter') input.blur();
    },
  });
  /** @type {(steps: number, mark: boolean) => void} */
  const nudge = (steps, mark) => {
    const from = value ?? parse(empty ?? '') ?? 0;
    const by = step(from, whole);
    value = Number((from + steps * by).toFixed(Math.max(0, 2 - Math.floor(Math.log10(by)))));
    if (whole) value = Math.max(0, Math.round(value));
    input.value = number(value, 7);
    send(value, mark);
  };
  /** @param {number|null|undefined} v */
  const show = (v) => {
    value = v ?? null;
    if (document.activeElement !== input) input.value = value === null ? '' : number(value, 7);
  };
  return { element: input, show, nudge };
}

/** @param {Task} task @returns {Editor} */
function slider(task) {
  const [least, most] = /** @type {[number, number]} */ (task.slide);
  const whole = task.shape.type === 'integer';
  const inner = numeric(task);
  const to = (/** @type {number} */ v) => (task.log ? Math.log(v) : v);
  const from = (/** @type {number} */ v) => (task.log ? Number(Math.exp(v).toPrecision(3)) : Number(v.toPrecision(6)));
  const range = h('input', {
    type: 'range', 'aria-label': task.name, min: to(least), max: to(most),
    step: whole ? 1 : (to(most) - to(least)) / 200,
    oninput: () => task.send(from(Number(range.value)), false),
    onchange: () => task.send(from(Number(range.value)), true),
  });
  return {
    element: h('div', { class: 'slider' }, range, inner.element),
    nudge: inner.nudge,
    show: (value) => {
      inner.show(value);
      const at = value ?? parse(task.empty ?? '') ?? least;
      if (document.activeElement !== range || !range.matches(':active')) range.value = to(at);
      range.style.setProperty('--at', `${Math.max(0, Math.min(100, (100 * (to(at) - to(least))) / (to(most) - to(least))))}%`);
    },
  };
}

/** @param {Task} task @param {string[]} names @returns {Editor} */
function several(task, names) {
  /** @type {(number|null)[]} */
  let all = names.map(() => null);
  const parts = names.map((name, i) => numeric({
    ...task,
    id: i ? `${task.id}-${name}` : task.id,
    name: `${task.name}, ${name}`,
    shape: { kind: 'value', type: 'number' },
    empty: task.empty?.replace(/[[\]]/g, '').split(',').at(task.empty.includes(',') ? i : 0)?.trim() ?? '',
    send: (value, mark) => {
      all = all.map((v, k) => (k === i ? value : v));
      if (all.every((v) => v === null)) task.send(null, mark);
      else if (all.every((v) => v !== null)) task.send(all, mark);
    },
  }));
  return {
    element: h('div', { class: `several n${names.length}` }, parts.map((p) => p.element)),
    show: (value) => {
      all = names.map((_, i) => value?.[i] ?? null);
      parts.forEach((p, i) => p.show(all[i]));
    },
  };
}

/** @param {Task} task @returns {Editor} */
function toggle({ id, name, send }) {
  const input = h('input', { id, type: 'checkbox', class: 'switch', role: 'switch', 'aria-label': name, onchange: () => send(input.checked, true) });
  return { element: input, show: (value) => { input.checked = Boolean(value); } };
}

/** @param {Task} task @returns {Editor} */
function choice({ id, name, shape, words = {}, send }) {
  const all = shape.choices ?? [];
  const called = (/** @type {string} */ c) => words[c] ?? c.charAt(0).toUpperCase() + c.slice(1);
  const letters = all.map(called).join('').length;
  if (all.length > 4 || letters > 30) {
    const select = h('select', { id, 'aria-label': name, onchange: () => send(select.value, true) }, all.map((c) => h('option', { value: c }, called(c))));
    return { element: select, show: (value) => { select.value = value; } };
  }
  const inputs = all.map((c, i) => h('input', { type: 'radio', name: `r-${id}`, id: i ? `${id}-${i}` : id, value: c, onchange: () => send(c, true) }));
  return {
    element: h('div', { class: 'segments', role: 'radiogroup', 'aria-label': name }, inputs.map((input, i) => h('label', {}, input, h('span', {}, called(all[i]))))),
    show: (value) => inputs.forEach((input) => { input.checked = input.value === value; }),
  };
}

/** @param {Task} task @returns {Editor} */
function color({ id, name, optional, empty, send }) {
  const well = h('input', {
    type: 'color', 'aria-label': `${name}, by eye`,
    oninput: () => send(well.value, false),
    onchange: () => send(well.value, true),
  });
  const words = h('input', {
    id, type: 'text', 'aria-label': name, placeholder: (empty ?? '').replaceAll('"', ''), spellcheck: 'false', autocomplete: 'off',
    onchange: () => send(words.value.trim() === '' && optional ? null : words.value.trim(), true),
  });
  return {
    element: h('div', { class: 'color' }, well, words),
    show: (value) => {
      const shown = String(value ?? '');
      if (document.activeElement !== words) words.value = shown;
      well.value = /^#[0-9a-f]{6}/i.test(shown) ? shown.slice(0, 7) : '#ffffff';
      well.classList.toggle('none', !value);
    },
  };
}

/** @param {Task} task @returns {Editor} */
function text({ id, name, empty, optional, send }) {
  // A list of names is text with commas.
  let list = false;
  const names = () => input.value.split(',').map((/** @type {string} */ w) => w.trim()).filter(Boolean);
  const input = h('input', {
    id, type: 'text', 'aria-label': name, placeholder: empty ?? '', spellcheck: 'false', autocomplete: 'off',
    onchange: () => send(list ? names() : input.value === '' && optional ? null : input.value, true),
  });
  return {
    element: input,
    show: (value) => {
      list = Array.isArray(value);
      if (document.activeElement !== input) input.value = list ? value.join(', ') : String(value ?? '');
    },
  };
}

/** Lists of plain values, and maps: as JSON reads them, without the outer brackets. @param {Task} task @returns {Editor} */
function items({ id, name, shape, send }) {
  const [open, close] = shape.kind === 'map' ? '{}' : '[]';
  const input = h('input', {
    id, type: 'text', 'aria-label': name, spellcheck: 'false', autocomplete: 'off',
    placeholder: shape.kind === 'map' ? '"name": value, …' : 'value, …',
    onchange: () => {
      input.setCustomValidity('');
      const words = (/** @type {string} */ t) => t.split(',').map((w) => parse(w) ?? w.trim()).filter((w) => w !== '');
      try {
        send(JSON.parse(open + input.value + close), true);
      } catch {
        if (shape.kind === 'list') return send(words(input.value), true);
        input.setCustomValidity('as in "Na": 1.02, "Cl": 1.81');
        input.reportValidity();
      }
    },
  });
  return {
    element: input,
    show: (value) => { if (document.activeElement !== input) input.value = JSON.stringify(value ?? (shape.kind === 'map' ? {} : [])).slice(1, -1).replaceAll(',', ', '); },
  };
}
