/** @file Colour maps: swatches, and `<motes-colormap>`, which chooses one. */
import { h, Part } from './dom.js';
import { icon } from './icons.js';
import { store } from './store.js';

/** The colours of a map; backwards with `_r`. @param {string} name @returns {number[][]} */
function colors(name) {
  const plain = name.replace(/_r$/, '');
  const found = store.colormaps[plain] ?? [];
  return plain === name ? found : [...found].reverse();
}

/** A map as a CSS gradient. @param {string} name @param {boolean} [reverse] */
export function gradient(name, reverse = false) {
  const all = reverse ? [...colors(name)].reverse() : colors(name);
  const some = all.filter((_, i) => i % 4 === 0 || i === all.length - 1);
  return some.length ? `linear-gradient(to right, ${some.map((c) => `rgb(${c.join(' ')})`).join(', ')})` : 'none';
}

/** The colour at a part of a map. @param {string} name @param {boolean} reverse @returns {(part: number) => string} */
export function sampler(name, reverse) {
  const all = colors(name);
  if (!all.length) return () => 'currentColor';
  return (part) => {
    const at = Math.round((reverse ? 1 - part : part) * (all.length - 1));
    return `rgb(${all[at].join(' ')})`;
  };
}

let ids = 0;

class ColorMap extends Part {
  start() {
    const id = `maps${++ids}`;
    this.bar = h('i', { class: 'bar' });
    this.name = h('span', {});
    const button = h('button', { class: 'choose', popovertarget: id, 'aria-haspopup': 'listbox', 'aria-label': 'Colour map' }, this.bar, this.name, icon('more'));
    const list = h('div', { class: 'menu maps', popover: 'auto', id, role: 'listbox', 'aria-label': 'Colour maps' });
    list.addEventListener('beforetoggle', (/** @type {any} */ e) => {
      if (e.newState !== 'open') return;
      const box = button.getBoundingClientRect();
      list.style.left = `${Math.max(8, box.right - 260)}px`;
      list.style.top = `${Math.min(box.bottom + 4, innerHeight - Math.min(420, innerHeight * 0.7) - 8)}px`;
      this.#fill(list);
    });
    this.replaceChildren(button, list);
    this.listen(store, 'scene', () => this.#show());
    this.#show();
  }

  /** @param {any} list */
  #fill(list) {
    const now = store.get(store.mine('color.map'));
    list.replaceChildren(...Object.keys(store.colormaps).map((name) => h('button', {
      role: 'option', 'aria-selected': String(name === now),
      onclick: () => {
        list.hidePopover();
        store.change({ [store.mine('color.map')]: name });
      },
    }, h('i', { class: 'bar', style: { backgroundImage: gradient(name) } }), h('span', {}, name))));
    list.querySelector('[aria-selected=true]')?.focus();
  }

  #show() {
    const name = store.get(store.mine('color.map')) ?? 'viridis';
    this.bar.style.backgroundImage = gradient(name, Boolean(store.get(store.mine('color.reverse'))));
    this.name.textContent = name;
  }
}

customElements.define('motes-colormap', ColorMap);
