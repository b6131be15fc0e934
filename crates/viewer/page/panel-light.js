/** @file The panel Light: the key light dragged on a sphere, and the fill. */
import { follow, h } from './dom.js';
import { field, fold } from './field.js';
import { Panel } from './panel.js';
import { store } from './store.js';
import { add, dot, scale, unit } from './vector.js';

/** @typedef {import('./types.js').Vec3} Vec3 */

const SIZE = 132;

class LightPanel extends Panel {
  /** What the ball was drawn for. */
  drawn = '';

  build() {
    this.drawn = '';
    this.ball = h('canvas', {
      class: 'ball', width: SIZE * 2, height: SIZE * 2, tabindex: 0, role: 'slider', 'aria-label': 'Where the light comes from: arrow keys move it',
      'aria-valuenow': 0,
      onpointerdown: (/** @type {PointerEvent} */ e) => this.#drag(e),
      onkeydown: (/** @type {KeyboardEvent} */ e) => this.#key(e),
    });
    this.words = h('p', { class: 'muted center' });
    return [
      field('light.preset', { label: 'Light' }),
      this.ball, this.words,
      field('light.relative_to', { label: 'Fixed to', words: { camera: 'The eye', world: 'The world' } }),
      fold('Key light', true,
        field('light.intensity', { slide: [0, 2] }),
        field('light.softness', { slide: [0, 90] }),
        field('light.shadow_rays', { label: 'Shadow rays', slide: [0, 16] }),
        field('light.color'), field('light.position'), field('light.size')),
      fold('Fill', true,
        field('light.fill', { slide: [0, 2] }),
        field('light.occlusion_rays', { label: 'Occlusion rays', slide: [0, 32] }),
        field('light.occlusion_radius', { label: 'Occlusion reach' }),
        field('light.bounce_rays', { label: 'Bounce rays', slide: [0, 16] }),
        field('light.ambient', { slide: [0, 1] }),
        field('light.sky'), field('light.ground')),
    ];
  }

  /** The way to the light: x right, y up, z to the viewer. @returns {Vec3} */
  get direction() {
    const d = unit(store.get('light.direction') ?? [-0.5, 0.8, 0.6]);
    const camera = store.camera;
    if (store.get('light.relative_to') !== 'world' || !camera) return d;
    return [dot(d, camera.right), dot(d, camera.up), -dot(d, camera.forward)];
  }

  /** @param {Vec3} seen as `direction` @param {boolean} mark */
  #set(seen, mark) {
    const camera = store.camera;
    const [x, y, z] = unit(seen);
    const world = store.get('light.relative_to') === 'world' && camera
      ? add(add(scale(camera.right, x), scale(camera.up, y)), scale(camera.forward, -z)) : [x, y, z];
    store.change({ 'light.direction': world.map((v) => Number(v.toFixed(3))) }, mark);
  }

  /** @param {PointerEvent} down */
  #drag(down) {
    const box = this.ball.getBoundingClientRect();
    const at = (/** @type {PointerEvent} */ e) => {
      const x = ((e.clientX - box.left) / box.width) * 2.2 - 1.1;
      const y = 1.1 - ((e.clientY - box.top) / box.height) * 2.2;
      const far = Math.hypot(x, y);
      // Beyond the rim lies the back.
      return /** @type {Vec3} */ (far <= 1 ? [x, y, Math.sqrt(1 - far * far)] : [x / far, y / far, -Math.min(0.9, (far - 1) * 4)]);
    };
    this.#set(at(down), false);
    follow(down, (e) => this.#set(at(e), false), (e) => this.#set(at(e), true));
  }

  /** @param {KeyboardEvent} e */
  #key(e) {
    const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[e.key];
    if (!step) return;
    e.preventDefault();
    const [x, y, z] = this.direction;
    this.#set([x + step[0] * 0.1, y + step[1] * 0.1, z], true);
  }

  update() {
    if (!this.ball) return;
    const d = this.direction;
    const drawn = JSON.stringify([d, store.get('light.intensity'), store.get('light.fill')]);
    if (drawn === this.drawn) return;
    this.drawn = drawn;
    this.#draw(d);
    const height = Math.round((Math.asin(Math.max(-1, Math.min(1, d[1]))) * 180) / Math.PI);
    const side = Math.round((Math.atan2(d[0], d[2]) * 180) / Math.PI);
    const words = `${Math.abs(side)}° ${side < 0 ? 'left' : 'right'}, ${Math.abs(height)}° ${height < 0 ? 'below' : 'above'}`;
    this.words.textContent = words;
    this.ball.setAttribute('aria-valuetext', words);
  }

  /** A ball in this light. @param {Vec3} d */
  #draw(d) {
    const context = this.ball.getContext('2d');
    const n = SIZE * 2;
    const image = context.createImageData(n, n);
    const [key, fill] = [store.get('light.intensity') ?? 0.7, store.get('light.fill') ?? 0.45];
    for (let j = 0; j < n; j++) {
      for (let i = 0; i < n; i++) {
        const x = ((i + 0.5) / n) * 2.2 - 1.1;
        const y = 1.1 - ((j + 0.5) / n) * 2.2;
        const rr = x * x + y * y;
        if (rr > 1.02) continue;
        const z = Math.sqrt(Math.max(0, 1 - rr));
        const light = 0.75 * (key * Math.max(0, x * d[0] + y * d[1] + z * d[2]) + fill * (0.85 + 0.15 * y));
        const v = 255 * Math.min(1, light) ** (1 / 2.2);
        image.data.set([v, v, v, 255 * Math.max(0, Math.min(1, (1.01 - Math.sqrt(rr)) * n / 2.2))], 4 * (j * n + i));
      }
    }
    context.putImageData(image, 0, 0);
    const [cx, cy] = [(d[0] + 1.1) / 2.2 * n, (1.1 - d[1]) / 2.2 * n];
    context.beginPath();
    context.arc(cx, cy, 9, 0, 7);
    context.lineWidth = 4;
    context.strokeStyle = '#fff';
    context.stroke();
    context.lineWidth = 2;
    context.strokeStyle = '#c06a00';
    context.fillStyle = d[2] >= 0 ? '#ffc24d' : 'transparent';
    context.fill();
    context.stroke();
  }
}

customElements.define('motes-panel-light', LightPanel);
