/**
 * @file The line to the server: questions and answers, pictures, and its return after it was lost.
 *
 * Events: `message` (detail: what the server said unasked), `frame` (detail: a picture), `link` (detail:
 * `open`, `lost` with `retry` in seconds, `refused` when another token is needed, `ended`).
 */

/** Bytes before the picture, and how they begin. */
const HEAD = 40;
const MAGIC = 0x45544f4d; // "MOTE", little endian
const CODECS = ['', 'image/jpeg', 'image/png'];
/** Waits between attempts, seconds. */
const WAITS = [0.3, 0.6, 1, 2, 4, 8];

export class Connection extends EventTarget {
  /**
   * @param {string} token
   * @param {string|null} view the view to take up again
   * @param {() => {width: number, height: number}} size of the picture, device pixels
   */
  constructor(token, view, size) {
    super();
    this.size = size;
    this.token = token;
    this.view = view;
    this.attempt = 0;
    this.ids = 0;
    /** @type {WebSocket|null} */
    this.socket = null;
    /** @type {Map<number, {resolve: (answer: any) => void, reject: (error: Error) => void}>} */
    this.waiting = new Map();
    this.ended = false;
  }

  get open() {
    return this.socket?.readyState === WebSocket.OPEN;
  }

  connect() {
    const { width, height } = this.size();
    const words = new URLSearchParams({ token: this.token, width: String(width), height: String(height), ...(this.view ? { view: this.view } : {}) });
    const scheme = location.protocol === 'https:' ? 'wss' : 'ws';
    const socket = new WebSocket(`${scheme}://${location.host}/ws?${words}`);
    socket.binaryType = 'arraybuffer';
    socket.onopen = () => this.#tell('link', { state: 'open' });
    socket.onmessage = ({ data }) => (typeof data === 'string' ? this.#heard(data) : this.#saw(data));
    socket.onclose = () => this.#lost(socket);
    this.socket = socket;
  }

  /** Tries again at once. */
  retry() {
    if (this.open) return;
    clearTimeout(this.timer);
    this.connect();
  }

  /**
   * Asks the server to do something.
   * @param {string} what
   * @param {Record<string, unknown>} [fields]
   * @returns {Promise<any>} its answer; an error in its words
   */
  ask(what, fields = {}) {
    const socket = this.socket;
    if (!socket || !this.open) return Promise.reject(new Error('not connected'));
    const id = ++this.ids;
    socket.send(JSON.stringify({ id, do: what, ...fields }));
    return new Promise((resolve, reject) => this.waiting.set(id, { resolve, reject }));
  }

  /**
   * Tells the server something that has no answer.
   * @param {string} what
   * @param {Record<string, unknown>} [fields]
   */
  say(what, fields = {}) {
    if (this.open) this.socket?.send(JSON.stringify({ id: ++this.ids, do: what, ...fields }));
  }

  /** @param {string} text */
  #heard(text) {
    const message = JSON.parse(text);
    if (message.re !== undefined) {
      const asked = this.waiting.get(message.re);
      this.waiting.delete(message.re);
      if (message.error === undefined) asked?.resolve(message);
      else if (asked) asked.reject(new Error(message.error));
      else this.#tell('message', { is: 'notice', severity: 'error', text: message.error });
      return;
    }
    if (message.is === 'hello') {
      this.view = message.view;
      this.attempt = 0;
    }
    if (message.is === 'ended') this.ended = true;
    this.#tell('message', message);
  }

  /** @param {ArrayBuffer} data */
  #saw(data) {
    const head = new DataView(data);
    if (data.byteLength < HEAD || head.getUint32(0, true) !== MAGIC) return;
    const flags = head.getUint32(8, true);
    const hash = head.getBigUint64(32, true);
    /** @type {import('./types.js').Frame} */
    const frame = {
      serial: head.getUint32(4, true),
      exact: (flags & 1) > 0,
      coarse: (flags & 2) > 0,
      playing: (flags & 4) > 0,
      width: head.getUint16(12, true),
      height: head.getUint16(14, true),
      frame: head.getUint32(20, true),
      ms: head.getFloat32(24, true),
      state: head.getUint32(28, true),
      hash: hash ? hash.toString(16).padStart(16, '0') : '',
      blob: new Blob([new Uint8Array(data, HEAD)], { type: CODECS[head.getUint8(16)] ?? '' }),
    };
    this.#tell('frame', frame);
  }

  /** @param {WebSocket} socket */
  async #lost(socket) {
    if (socket !== this.socket) return;
    for (const { reject } of this.waiting.values()) reject(new Error('the connection was lost'));
    this.waiting.clear();
    const wait = WAITS[Math.min(this.attempt, WAITS.length - 1)];
    this.attempt += 1;
    if (await this.#refused()) {
      this.#tell('link', { state: 'refused' });
      return;
    }
    this.#tell('link', { state: this.ended ? 'ended' : 'lost', retry: wait, attempt: this.attempt });
    this.timer = setTimeout(() => this.connect(), wait * 1000);
  }

  /** Whether there is a server, but one that wants another token. */
  async #refused() {
    try {
      const answer = await fetch(`/ws?token=${encodeURIComponent(this.token)}`, { cache: 'no-store' });
      return answer.status === 401 || answer.status === 403;
    } catch {
      return false;
    }
  }

  /** @param {string} name @param {any} detail */
  #tell(name, detail) {
    this.dispatchEvent(new CustomEvent(name, { detail }));
  }
}
