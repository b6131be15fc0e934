/** @file The panel Picture: background, annotations, camera, samples. */
import { h } from './dom.js';
import { field, fold } from './field.js';
import { Panel } from './panel.js';
import { project } from './keys.js';
import { reach } from './paths.js';
import { store } from './store.js';

/** Backgrounds: name, top, bottom. @type {[string, string|null, string|null][]} */
const GROUNDS = [
  ['Paper', null, null], ['White', '#ffffff', null], ['Haze', '#eef2f6', '#c9d3dd'],
  ['Slate', '#39424e', '#15191e'], ['Black', '#000000', null],
];

class PicturePanel extends Panel {
  build() {
    const overlay = reach(/** @type {any} */ (store.field('overlay'))?.shape ?? {}, 'overlay');
    const shows = overlay.filter(({ field: f }) => f.shape.type === 'choice');
    const flat = store.get('camera.projection') === 'orthographic';
    const projections = h('div', { class: 'segments', role: 'radiogroup', 'aria-label': 'Projection' },
      ['perspective', 'orthographic'].map((kind) => h('label', {},
        h('input', { type: 'radio', name: 'projection', value: kind, checked: (kind === 'orthographic') === flat, onchange: () => project(kind) }),
        h('span', {}, kind.charAt(0).toUpperCase() + kind.slice(1)))));
    return [
      h('div', { class: 'grounds', role: 'group', 'aria-label': 'Background' }, GROUNDS.map(([name, top, bottom]) => h('button', {
        title: `${name} background`,
        onclick: () => store.change({ 'image.background': top, 'image.background_bottom': bottom }),
      }, h('i', { style: { backgroundImage: `linear-gradient(${top ?? '#fafbfc'}, ${bottom ?? top ?? '#fafbfc'})` } }), name))),
      fold('Background and tone', false, ['background', 'background_bottom', 'transparent', 'exposure', 'tone'].map((n) => field(`image.${n}`, n === 'exposure' ? { slide: [-3, 3] } : {}))),
      fold('In the picture', true, shows.map(({ path }) => field(path)), field('overlay.text_size', { slide: [0.01, 0.06] })),
      fold('Camera', true, projections,
        field('camera.fov', { slide: [5, 110] }), field('camera.up_axis', { label: 'Up', words: { x: 'X', y: 'Y', z: 'Z' } }),
        field('camera.aperture'), field('camera.focus'),
        fold('Position', false, ['position', 'target', 'up', 'height', 'margin'].map((n) => field(`camera.${n}`)))),
      fold('Quality', true, field('image.samples', { slide: [1, 64], log: true, label: 'Rays per pixel' }), field('image.max_samples', { label: 'at the most', slide: [1, 64], log: true }), field('image.noise')),
      fold('Film', false, ['frames', 'fps', 'quality'].map((n) => field(`film.${n}`)), field('camera.turn', { label: 'Turn', slide: [-360, 360] })),
    ];
  }

  plan() {
    return String(store.get('camera.projection'));
  }
}

customElements.define('motes-panel-picture', PicturePanel);
