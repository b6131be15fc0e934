/**
 * @file The address of the view: what differs from the default scene, in the part of the URL after `#`.
 *
 * Opened again, on this server or another that shows the same source, it gives the same view.
 * `#s=` + base64url of the scene's TOML, deflated.
 */
import { quiet } from './dom.js';
import { store } from './store.js';

/** @param {ReadableStream} stream */
const bytes = async (stream) => new Uint8Array(await new Response(stream).arrayBuffer());

/** @param {string} text */
async function pack(text) {
  const packed = await bytes(new Blob([text]).stream().pipeThrough(new CompressionStream('deflate-raw')));
  const letters = btoa(Array.from(packed, (b) => String.fromCharCode(b)).join(''));
  return letters.replaceAll('+', '-').replaceAll('/', '_').replaceAll('=', '');
}

/** @param {string} letters */
async function unpack(letters) {
  const packed = Uint8Array.from(atob(letters.replaceAll('-', '+').replaceAll('_', '/')), (c) => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream('deflate-raw'));
  return new TextDecoder().decode(await bytes(stream));
}

let last = '';

const write = quiet(700, async () => {
  if (!store.line.open) return;
  try {
    const { text } = await store.line.ask('scene');
    last = `#s=${await pack(text)}`;
    history.replaceState(null, '', last);
    remember();
  } catch {
    // The address is then that of a moment ago; the next change writes it again.
  }
});

/** So that a page that is loaded again takes up its view, with what can be undone. */
function remember() {
  sessionStorage.setItem('motes', JSON.stringify({ view: store.line.view, hash: location.hash, token: store.line.token }));
}

/** Asks the server for the scene of the address. */
async function open() {
  if (!location.hash.startsWith('#s=')) return;
  try {
    await store.line.ask('load', { scene: await unpack(location.hash.slice(3)) });
  } catch (error) {
    store.notice(`The view in the address could not be opened: ${/** @type {Error} */ (error).message}`, 'error');
  }
}

/** Connects, with the view that this page showed before or with the one in its address. */
export function begin() {
  const token = new URLSearchParams(location.search).get('token');
  if (!token) {
    store.tell('link', { state: 'refused' });
    return;
  }
  const before = JSON.parse(sessionStorage.getItem('motes') ?? 'null');
  const again = before && before.token === token && before.hash === location.hash;
  let had = again ? before.view : null;
  store.addEventListener('hello', () => {
    // A new view, or one in place of a view that the server no longer knows: what was seen is in the address.
    if (store.line.view !== had) open();
    had = store.line.view;
    remember();
  });
  store.addEventListener('scene', write);
  addEventListener('hashchange', () => {
    if (location.hash !== last) open();
  });
  store.connect(token, again ? before.view : null);
}

/** The address of what is seen now; empty if the server does not say. */
export async function share() {
  const answer = await store.ask('scene');
  return answer && `${location.origin}${location.pathname}${location.search}#s=${await pack(answer.text)}`;
}
