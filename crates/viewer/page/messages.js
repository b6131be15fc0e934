/** @file `<motes-messages>`: what the server and the page have to say. Errors stay until they are read; all are kept in the Log. */
import { h, Part } from './dom.js';
import { icon } from './icons.js';
import { store } from './store.js';

/** @type {{time: string, severity: string, text: string}[]} every message, oldest first */
export const messages = [];
/** No more than this many are kept. */
const MOST = 500;
/** Milliseconds that what is no error stays. */
const STAY = 6000;

class Messages extends Part {
  start() {
    this.polite = h('div', { 'aria-live': 'polite', role: 'status' });
    this.urgent = h('div', { 'aria-live': 'assertive', role: 'alert' });
    this.line = h('div', { class: 'line', role: 'status', hidden: true });
    this.replaceChildren(this.line, this.urgent, this.polite);
    this.listen(store, 'notice', (e) => this.#say(e.detail));
    this.listen(store, 'link', (e) => this.#link(e.detail));
  }

  /** @param {{text: string, severity: string}} message */
  #say({ text, severity }) {
    const last = messages.at(-1);
    const now = new Date().toLocaleTimeString('en-GB');
    if (!last || last.text !== text || last.severity !== severity) messages.push({ time: now, severity, text });
    if (messages.length > MOST) messages.shift();
    const bad = severity === 'error';
    const room = bad ? this.urgent : this.polite;
    // The same again is no news.
    for (const child of [...room.children]) if (child.querySelector('span')?.textContent === text) child.remove();
    while (room.children.length > 3) room.firstElementChild?.remove();
    const note = h('div', { class: `note ${severity}` }, h('span', {}, text),
      h('button', { class: 'plain icon', title: 'Put away', 'aria-label': 'Put the message away', onclick: () => note.remove() }, icon('close')));
    room.append(note);
    if (!bad) setTimeout(() => note.remove(), severity === 'warning' ? 2 * STAY : STAY);
  }

  /** @param {{state: string}} link */
  #link({ state }) {
    this.line.hidden = state === 'open';
    if (state === 'open') return this.line.replaceChildren();
    if (state !== 'refused') {
      this.line.replaceChildren(h('p', {}, state === 'ended'
        ? 'Motes has ended. What you saw is in the address of this page; it opens again when motes view runs.'
        : 'The connection to Motes was lost. Trying to take up this view again…'),
      h('button', { class: 'small', onclick: () => store.line.retry() }, 'Now'));
      return;
    }
    const box = h('input', { type: 'text', placeholder: 'http://127.0.0.1:…/?token=…', 'aria-label': 'New address', spellcheck: 'false', autocomplete: 'off' });
    this.line.replaceChildren(h('form', {
      onsubmit: (/** @type {Event} */ e) => {
        e.preventDefault();
        const token = /token=([^&#\s]+)/.exec(box.value)?.[1] ?? box.value.trim();
        // The view comes along.
        location.href = `${location.pathname}?token=${encodeURIComponent(token)}${location.hash}`;
        if (new URLSearchParams(location.search).get('token') === token) location.reload();
      },
    }, h('p', {}, 'This page needs the address that motes view prints: each run has its own. Paste it here, and this view goes on.'),
    h('div', { class: 'row' }, box, h('button', { class: 'prime' }, 'Open'))));
  }
}

customElements.define('motes-messages', Messages);
