// How fast the viewer is, measured as one uses it: server and browser on this machine.
//
//     node crates/viewer/tests/browser/speed.mjs SOURCE… [-- ARGUMENTS of motes view]
//
// MOTES, MOTES_BROWSER and CHROMIUM as for the tests; MOTES_SPEED_SECS, how long each takes, and MOTES_SPEED_KINDS, such as
// `orbit,plane`. Prints one JSON object for each source:
//
// - `address`, `first`: from the start of the program to its address, and to the first picture in the browser, ms;
// - `exact`: from the start to the exact picture, ms;
// - `orbit`, `range`, `plane`: pictures shown in a second while the pointer turns the camera, while a range of
//   Position.X and a plane are dragged, and the milliseconds from an input to the first picture that shows it;
//   `rest` from the last input to the exact picture; `size` of the pictures, `kB` of one, `ms` to draw one;
// - `play`: pictures of frames shown in a second, if there are several.
import { close, serve, visit } from './harness.mjs';

const SECONDS = Number(process.env.MOTES_SPEED_SECS ?? 5);
/** The size of the picture. */
const [WIDTH, HEIGHT] = [1280, 720];

const split = process.argv.indexOf('--');
const sources = process.argv.slice(2, split < 0 ? undefined : split);
const args = split < 0 ? [] : process.argv.slice(split + 1);

/** Runs in the page: something that moves, until it rests. */
async function measure({ kind, seconds }) {
  const { store } = await import('/page/store.js');
  const canvas = document.querySelector('motes-stage canvas');
  const line = store.line;
  const shown = [];
  const waits = [];
  let asked = [];
  let input = performance.now();
  const ask = line.ask;
  line.ask = async (what, fields) => {
    const at = input;
    const answer = await ask.call(line, what, fields);
    if (what === 'set') asked.push({ at, state: answer.state });
    return answer;
  };
  const onShown = ({ detail }) => {
    const now = performance.now();
    shown.push({ now, ...detail, bytes: detail.blob.size });
    waits.push(...asked.filter((a) => a.state <= detail.state).map((a) => now - a.at));
    asked = asked.filter((a) => a.state > detail.state);
  };
  store.addEventListener('shown', onShown);

  const box = canvas.getBoundingClientRect();
  const pointer = (type, x, y) => canvas.dispatchEvent(new PointerEvent(type, {
    pointerId: 1, pointerType: 'mouse', isPrimary: true, bubbles: true, cancelable: true, button: type === 'pointermove' ? -1 : 0,
    buttons: type === 'pointerup' ? 0 : 1, clientX: box.x + x, clientY: box.y + y,
  }));
  const { min, max } = store.resolved.bounds;
  const middle = min.map((n, i) => 0.5 * (n + max[i]));
  const steps = {
    orbit: (t) => pointer('pointermove', box.width / 2 + 400 * Math.sin(1.2 * t), box.height / 2 + 60 * Math.sin(0.7 * t)),
    range: (t) => store.change({ 'system.0.filter': [{ property: 'Position', component: 'x', min: middle[0] + 0.4 * (max[0] - min[0]) * Math.sin(1.2 * t) }] }, false),
    plane: (t) => store.change({ section: [{ normal: [1, 0, 0], point: [middle[0] + 0.4 * (max[0] - min[0]) * Math.sin(1.2 * t), ...middle.slice(1)] }] }, false),
  };
  canvas.setPointerCapture = () => {};
  if (kind === 'orbit') pointer('pointerdown', box.width / 2, box.height / 2);
  const start = performance.now();
  while (performance.now() < start + 1000 * seconds) {
    await new Promise(requestAnimationFrame);
    input = performance.now();
    steps[kind]((input - start) / 1000);
  }
  const moved = shown.filter((s) => s.now > start + 500);
  const frames = moved.filter((s) => !s.exact);
  const end = performance.now();
  input = end;
  if (kind === 'orbit') pointer('pointerup', box.width / 2, box.height / 2);
  else await store.set({}, true);
  const count = shown.length;
  while (!shown.slice(count).some((s) => s.exact && s.state >= store.state)) await new Promise((next) => setTimeout(next, 5));
  const rest = performance.now() - end;
  line.ask = ask;
  store.removeEventListener('shown', onShown);
  const at = (list, part) => [...list].sort((a, b) => a - b)[Math.min(list.length - 1, Math.floor(part * list.length))];
  const round = (n) => (n === undefined ? undefined : Math.round(10 * n) / 10);
  const sizes = moved.map((s) => s.width);
  return {
    'frames/s': round(moved.length / (seconds - 0.5)), 'median ms': round(at(waits, 0.5)), 'p95 ms': round(at(waits, 0.95)), 'rest ms': round(rest),
    size: `${at(sizes, 0.5)}×${moved.find((s) => s.width === at(sizes, 0.5))?.height}`, kB: round(at(moved.map((s) => s.bytes), 0.5) / 1000),
    'draw ms': round(at(moved.map((s) => s.ms), 0.5)), coarse: round(frames.length / moved.length),
  };
}

/** Runs in the page: frames that play. */
async function play(seconds) {
  const { store } = await import('/page/store.js');
  const frames = [];
  const onShown = ({ detail }) => detail.playing && frames.push(detail.frame);
  store.addEventListener('shown', onShown);
  await store.line.ask('play', { on: true, fps: 60, loop: true });
  await new Promise((next) => setTimeout(next, 1000 * seconds));
  const count = frames.length;
  await store.line.ask('play', { on: false });
  store.removeEventListener('shown', onShown);
  return { 'frames/s': Math.round((10 * count) / seconds) / 10, frames: new Set(frames).size };
}

// The browser starts before anything is measured.
const blank = await visit('about:blank');
for (const source of sources) {
  const start = performance.now();
  const server = await serve(source, ...args);
  const address = performance.now() - start;
  // The page is wider than the picture by its panel.
  const seen = await visit(server.url, { width: WIDTH, height: HEIGHT + 100 });
  await seen.page.waitForSelector('motes-stage canvas[data-serial]');
  const first = performance.now() - start;
  await seen.exact();
  const exact = performance.now() - start;
  const box = await seen.canvas.boundingBox();
  await seen.page.setViewportSize({ width: Math.round(2 * WIDTH - box.width), height: Math.round(2 * HEIGHT + 100 - box.height) });
  await seen.exact();
  const found = { source, address: Math.round(address), first: Math.round(first), exact: Math.round(exact) };
  for (const kind of (process.env.MOTES_SPEED_KINDS ?? 'orbit,range,plane').split(',')) {
    found[kind] = await seen.page.evaluate(measure, { kind, seconds: SECONDS });
    await seen.page.evaluate(async () => {
      const { store } = await import('/page/store.js');
      await store.set({ 'system.0.filter': [], section: [] }, true);
    });
    await seen.exact();
  }
  if (await seen.store('store.resolved.frames') > 1) found.play = await seen.page.evaluate(play, SECONDS);
  console.log(JSON.stringify(found));
  if (seen.errors.length) console.error(seen.errors.join('\n'));
  await seen.context.close();
  await server.stop();
}
await blank.context.close();
await close();
process.exit(0);
