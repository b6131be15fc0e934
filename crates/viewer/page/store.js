/**
 * @file What the page knows: the scene, what it means, the particles, the picture; and how it is changed.
 *
 * The server's scene is the truth. Changes show at once here and are confirmed or taken back by its answer.
 * Events: `hello`, `scene`, `systems`, `frame`, `stats`, `progress`, `camera` (the camera moves), `link`,
 * `notice`, `tool` (another tool), `picked`, `section` (another plane is held), `measures`, `selection`,
 * `hint`, `ahead`.
 */
import { Camera } from './camera.js';
import { Connection } from './connection.js';
import { at, put, find } from './paths.js';

/** @typedef {import('./types.js').Changes} Changes */

/** Milliseconds between what panels are told while the camera moves. */
const READING = 400;

class Store extends EventTarget {
  constructor() {
    super();
    /** @type {Connection} */
    this.line = /** @type {any} */ (null);
    /** @type {import('./types.js').Shape} */
    this.schema = { kind: 'table', fields: [] };
    /** The scene as shown. @type {any} */
    this.scene = {};
    /** The scene as the server has it. @type {any} */
    this.truth = {};
    /** @type {import('./types.js').Resolved} */
    this.resolved = /** @type {any} */ (null);
    /** @type {import('./types.js').System[]} */
    this.systems = [];
    /** @type {Record<string, number[][]>} */
    this.colormaps = {};
    /** @type {any} */
    this.limits = {};
    this.version = '';
    /** Number of the last change that the server told of. */
    this.state = 0;
    this.undo = 0;
    this.redo = 0;
    this.link = 'opening';
    /** Index of the system that panels are about. */
    this.system = 0;
    /** The tool of the canvas: `move`, `distance`, `angle`, `box` or `cut`. */
    this.tool = 'move';
    /** Index of the plane whose handles are shown, or −1. */
    this.section = -1;
    /** @type {import('./types.js').Picked|null} */
    this.picked = null;
    /** @type {{kind: string, points: import('./types.js').Picked[]}[]} */
    this.measures = [];
    /** @type {any} */
    this.selection = null;
    /** @type {Camera|null} where the camera is while it is moved */
    this.moving = null;
    /** Whether it is being moved. */
    this.gliding = false;
    this.telling = false;
    this.told = 0;
    this.aspect = 16 / 9;
    /** The size of the picture, device pixels: the stage knows it. @type {() => {width: number, height: number}} */
    this.measure = () => ({ width: 1280, height: 720 });
    /** @type {Changes|null} changes that wait for the next picture */
    this.pending = null;
    this.inFlight = 0;
    /** Changes sent and not yet answered, oldest first. @type {Changes[]} */
    this.sent = [];
  }

  /** @param {string} token @param {string|null} view */
  connect(token, view) {
    this.line = new Connection(token, view, () => this.measure());
    this.line.addEventListener('message', (e) => this.#heard(/** @type {CustomEvent} */ (e).detail));
    this.line.addEventListener('frame', (e) => this.tell('frame', /** @type {CustomEvent} */ (e).detail));
    this.line.addEventListener('link', (e) => {
      const { detail } = /** @type {CustomEvent} */ (e);
      this.link = detail.state;
      if (detail.state !== 'open') this.#drop();
      this.tell('link', detail);
    });
    this.line.connect();
  }

  /** @param {any} message */
  #heard(message) {
    const { is } = message;
    if (is === 'hello') {
      this.schema = message.schema;
      this.colormaps = message.colormaps ?? message.schema.colormaps ?? {};
      this.limits = message.limits ?? {};
      this.version = message.version;
    }
    if (is === 'hello' || is === 'systems') {
      this.systems = message.systems;
      this.system = Math.min(this.system, Math.max(0, this.systems.length - 1));
      this.tell('systems');
    }
    if (is === 'hello' || is === 'scene') {
      this.truth = message.scene;
      this.#overlay();
      if (this.inFlight === 0 && !this.pending) this.moving = null;
      this.resolved = message.resolved;
      this.state = message.state;
      this.undo = Number(message.undo ?? 0);
      this.redo = Number(message.redo ?? 0);
      if (is === 'hello') {
        this.tell('hello');
        this.tell('scene');
      } else if (!this.#resting()) this.#sceneLater();
      this.tell('camera');
    } else if (is === 'notice') this.notice(message.text, message.severity);
    else if (is !== 'systems') this.tell(is, message);
  }

  /** Tells of the scene once before the next picture of the browser, however often it changes until then. */
  #sceneLater() {
    if (this.telling) return;
    this.telling = true;
    requestAnimationFrame(() => {
      this.telling = false;
      this.told = performance.now();
      this.tell('scene');
    });
  }

  /** Whether panels rest: while the camera moves they need not be told more often than one reads. */
  #resting() {
    return this.gliding && performance.now() - this.told < READING;
  }

  /** The server's scene with what it has not answered yet. */
  #overlay() {
    const changes = this.pending ? [...this.sent, this.pending] : this.sent;
    this.scene = changes.reduce((scene, some) => this.#with(scene, some), this.truth);
  }

  /** After the line was lost: what was not answered is not known. */
  #drop() {
    this.sent = [];
    this.pending = null;
    this.inFlight = 0;
    this.moving = null;
    this.gliding = false;
  }

  /** @param {any} scene @param {Changes} changes */
  #with(scene, changes) {
    return Object.entries(changes).reduce(
      (s, [path, value]) => put(s, path, value === null ? this.default(path) : value), scene);
  }

  /** The value at a path of the scene. @param {string} path @returns {any} */
  get(path) {
    return at(this.scene, path);
  }

  /** The default at a path. @param {string} path @returns {any} */
  default(path) {
    return find(this.schema, path)?.default ?? null;
  }

  /** What the schema says of a path. @param {string} path */
  field(path) {
    return find(this.schema, path);
  }

  /** Whether the schema has a path. @param {string} path */
  has(path) {
    return find(this.schema, path) !== undefined;
  }

  /** A path of the system that panels are about. @param {string} path */
  mine(path) {
    return `system.${this.system}.${path}`;
  }

  /**
   * Changes the scene. While a gesture lasts (`mark` false) only the newest state is sent, when the one before was answered.
   * @param {Changes} changes
   * @param {boolean} [mark] whether this ends the gesture: a step of undo
   * @returns {Promise<void>} an error in the server's words if it refuses
   */
  async set(changes, mark = true) {
    this.scene = this.#with(this.scene, changes);
    this.pending = { ...this.pending, ...changes };
    if (!this.#resting()) this.#sceneLater();
    if (mark) return this.#flush(true);
    // What comes until the answer goes with the next.
    if (this.inFlight === 0) this.#flush(false).catch((e) => this.notice(e.message, 'error'));
  }

  /** As `set`, with errors as messages. @param {Changes} changes @param {boolean} [mark] */
  change(changes, mark = true) {
    this.set(changes, mark).catch((error) => this.notice(error.message, 'error'));
  }

  /** @param {boolean} mark */
  async #flush(mark) {
    const changes = this.pending ?? {};
    this.pending = null;
    this.sent.push(changes);
    this.inFlight += 1;
    const answered = () => {
      this.inFlight = Math.max(0, this.inFlight - 1);
      const index = this.sent.indexOf(changes);
      if (index >= 0) this.sent.splice(index, 1);
      if (this.pending && this.inFlight === 0) this.#flush(false).catch((e) => this.notice(e.message, 'error'));
    };
    try {
      await this.line.ask('set', { changes, mark });
      this.truth = this.#with(this.truth, changes);
      answered();
    } catch (error) {
      answered();
      this.moving = null;
      this.#overlay();
      this.tell('scene');
      this.tell('camera');
      throw error;
    }
  }

  /** Asks the server, with errors as messages. @param {string} what @param {Record<string, unknown>} [fields] */
  async ask(what, fields) {
    try {
      return await this.line.ask(what, fields);
    } catch (error) {
      this.notice(/** @type {Error} */ (error).message, 'error');
      return undefined;
    }
  }

  /** The camera as it is, or as it is being moved. @returns {Camera|null} */
  get camera() {
    if (this.moving) return this.moving;
    if (!this.resolved) return null;
    const axis = { x: [1, 0, 0], y: [0, 1, 0], z: [0, 0, 1] }[/** @type {"x"|"y"|"z"} */ (this.get('camera.up_axis') ?? 'z')];
    return new Camera(this.resolved.camera, this.aspect, /** @type {any} */ (axis));
  }

  /** Moves the camera. @param {Camera} camera @param {boolean} mark whether the movement ends here */
  look(camera, mark) {
    this.moving = camera;
    this.gliding = !mark;
    this.change({ ...camera.changes(), 'camera.direction': null }, mark);
    this.tell('camera');
  }

  /** Frames what is visible. @param {import('./types.js').Vec3} [direction] to look along; else as now */
  fit(direction) {
    const camera = this.camera;
    if (!camera) return;
    this.moving = null;
    const along = direction ?? camera.forward.map((n) => Number(n.toFixed(6)));
    const pole = direction && Math.abs(direction.reduce((s, n, i) => s + n * camera.upright[i], 0)) > 0.99;
    const up = pole ? (camera.upright[1] ? [0, 0, -1] : [0, 1, 0]) : null;
    this.change({
      'camera.position': null, 'camera.target': null, 'camera.height': null, 'camera.direction': along,
      ...(direction ? { 'camera.up': up } : {}),
    });
  }

  /** @param {string} text @param {string} [severity] `info`, `warning` or `error` */
  notice(text, severity = 'info') {
    this.tell('notice', { text, severity });
  }

  /** @param {string} tool */
  use(tool) {
    this.tool = tool;
    this.tell('tool');
  }

  /** @param {string} name @param {any} [detail] */
  tell(name, detail) {
    this.dispatchEvent(new CustomEvent(name, { detail }));
  }

  /** Where something is saved from. @param {string} file @param {Record<string, unknown>} [query] */
  address(file, query = {}) {
    const words = new URLSearchParams({ token: this.line.token, view: this.line.view ?? '' });
    for (const [name, value] of Object.entries(query)) if (value !== undefined) words.set(name, String(value));
    return `/save/${file}?${words}`;
  }
}

export const store = new Store();
