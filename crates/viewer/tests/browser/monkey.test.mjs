// Random use: nothing breaks, nothing is left over.
import test, { after } from 'node:test';
import assert from 'node:assert/strict';
import { close, data, serve, visit } from './harness.mjs';

/** How long, seconds. */
const LONG = Number(process.env.MOTES_MONKEY_SECS ?? 8);
/** Bytes by which the second half may need more than the first: allocators and caches fill up slowly. */
const SPARE = 64 << 20;

after(close);

/** The same random numbers in each run (Park & Miller). */
function dice(seed) {
  let state = seed;
  return (n) => {
    state = (state * 48271) % 2147483647;
    return state % n;
  };
}

test('random use', { timeout: 180_000 + 1000 * LONG }, async (t) => {
  const server = await serve(data('1l2y.pdb'));
  t.after(() => server.stop());
  const seen = await visit(server.url, { width: 900, height: 600 });
  t.after(() => seen.context.close());
  await seen.exact();
  const roll = dice(20261122);
  const keys = ['ArrowLeft', 'ArrowUp', '+', '-', '[', ']', 'f', 'o', 'p', '1', '5', '.', ',', 'Control+z', 'Control+Shift+z', 'Escape', 'm', 'b', 'w', 's', ' '];
  const panels = ['look', 'types', 'filter', 'cut', 'light', 'picture', 'ask', 'all', 'log'];
  const actions = [
    () => seen.drag(roll(300) - 150, roll(300) - 150, { button: ['left', 'middle', 'right'][roll(3)] }),
    () => seen.page.mouse.wheel(0, roll(800) - 400),
    async () => { await seen.canvas.focus(); await seen.page.keyboard.press(keys[roll(keys.length)]); },
    () => seen.panel(panels[roll(panels.length)]),
    async () => {
      // Any switch, choice or slider of the panel that is open; fields of text have a test of their own.
      const all = await seen.page.locator('#panel :is(.switch, select, input[type=range], input[type=radio], summary):visible').all();
      const one = all[roll(all.length || 1)];
      if (!one) return;
      const kind = await one.evaluate((e) => e.type || e.localName, undefined, { timeout: 1000 });
      if (kind === 'select-one') {
        const count = await one.locator('option').count();
        if (count) await one.selectOption({ index: roll(count) }, { timeout: 1000 });
      } else if (kind === 'range') {
        await one.focus({ timeout: 1000 });
        await seen.page.keyboard.press(['ArrowLeft', 'ArrowRight', 'Home'][roll(3)]);
      } else await one.click({ force: true, timeout: 1000 });
    },
    () => seen.page.setViewportSize({ width: 500 + roll(800), height: 400 + roll(400) }),
  ];
  const start = Date.now();
  let steps = 0;
  // The most memory that the server and the page have held in each half.
  const most = [[0, 0], [0, 0]];
  const session = await seen.context.newCDPSession(seen.page);
  await session.send('Performance.enable');
  const weigh = async () => {
    const { metrics } = await session.send('Performance.getMetrics');
    const heap = metrics.find((m) => m.name === 'JSHeapUsedSize')?.value ?? 0;
    const half = Date.now() - start < 500 * LONG ? 0 : 1;
    most[half] = [Math.max(most[half][0], server.memory()), Math.max(most[half][1], heap)];
  };
  while (Date.now() - start < 1000 * LONG) {
    // What was there may be gone by the time it is touched.
    await actions[roll(actions.length)]().catch((error) => { if (!/imeout|detached|not attached|not visible/.test(error.message)) throw error; });
    steps += 1;
    if (steps % 5 === 0) await weigh();
  }
  await weigh();
  await seen.page.setViewportSize({ width: 900, height: 600 });
  await seen.store("store.line.ask('play', { on: false })");
  await seen.store("store.change({ renderer: 'spheres', 'image.samples': 1, 'image.max_samples': 1, 'light.preset': 'flat' })");
  await seen.exact();
  const megabytes = most.map((half) => half.map((bytes) => Math.round(bytes / 1e6)));
  t.diagnostic(`${steps} steps; MB of server and page: at first ${megabytes[0]}, then ${megabytes[1]}`);
  for (const part of [0, 1]) assert.ok(most[1][part] < 1.25 * most[0][part] + SPARE, `memory grows: ${megabytes.join(' → ')}`);
  assert.ok(steps > LONG);
  assert.deepEqual(seen.errors, []);
  const wrong = await seen.store("import('/page/messages.js').then((m) => m.messages.filter((x) => x.severity === 'error').map((x) => x.text))");
  assert.deepEqual(wrong.filter((text) => !/nothing to (un|re)do/.test(text)), []);
});
