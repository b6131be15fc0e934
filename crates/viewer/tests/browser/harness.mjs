// What the browser tests share: a running `motes view`, a browser, and words for what is to be seen.
//
// They run by `cargo test -p motes --test browser`, or alone by `node --test crates/viewer/tests/browser/*.test.mjs`:
// MOTES names the program, MOTES_BROWSER a folder that has playwright-core in its node_modules, CHROMIUM the
// browser (else it is looked for in PATH).
import { execFileSync, spawn } from 'node:child_process';
import { createRequire } from 'node:module';
import fs from 'node:fs';
import net from 'node:net';
import os from 'node:os';
import path from 'node:path';
import { once } from 'node:events';
import assert from 'node:assert/strict';

const { chromium } = createRequire(path.join(process.env.MOTES_BROWSER ?? process.cwd(), 'x.js'))('playwright-core');
const MOTES = process.env.MOTES ?? 'motes';
const ROOT = path.resolve(import.meta.dirname, '../../../..');

/** Milliseconds that something may take on a slow machine. */
export const PATIENCE = Number(process.env.MOTES_PATIENCE_MS ?? 30_000);

/** A file of the repository's `data/`. */
export const data = (name) => path.join(ROOT, 'data', name);

const executablePath = process.env.CHROMIUM
  ?? ['chromium', 'chromium-browser', 'google-chrome', 'chrome'].map((name) => {
    try {
      return execFileSync('sh', ['-c', `command -v ${name}`]).toString().trim();
    } catch {
      return '';
    }
  }).find(Boolean);

/** Runs `motes` to its end. */
export const motes = (...args) => execFileSync(MOTES, args.map(String), { cwd: ROOT, stdio: ['ignore', 'pipe', 'pipe'] }).toString();

/** Starts `motes view`; gives its address and what stops it. */
export async function serve(sources, ...args) {
  const child = spawn(MOTES, ['view', ...[sources].flat(), '--no-open', ...args.map(String)], { cwd: ROOT });
  let [out, err] = ['', ''];
  child.stderr.on('data', (text) => { err += text; });
  const url = await new Promise((resolve, reject) => {
    child.stdout.on('data', (text) => {
      out += text;
      const found = /http:\/\/\S+/.exec(out);
      if (found) resolve(found[0]);
    });
    child.on('exit', (code) => reject(new Error(`motes view ended with ${code}: ${err}`)));
  });
  const at = new URL(url);
  return {
    url,
    port: Number(at.port),
    token: at.searchParams.get('token'),
    log: () => err,
    async stop(signal = 'SIGINT') {
      if (child.exitCode !== null) return child.exitCode;
      child.kill(signal);
      const [code] = await once(child, 'exit');
      return code;
    },
    running: () => child.exitCode === null,
    /** Bytes of memory that it holds; 0 where the system does not say. */
    memory() {
      try {
        const kilobytes = /VmRSS:\s+(\d+)/.exec(fs.readFileSync(`/proc/${child.pid}/status`, 'utf8'));
        return 1024 * Number(kilobytes?.[1] ?? 0);
      } catch {
        return 0;
      }
    },
  };
}

let browser;

/** The browser, which all tests share. */
async function open() {
  browser ??= await chromium.launch({ executablePath, args: ['--no-sandbox', '--force-color-profile=srgb'] });
  return browser;
}

/** Closes it. */
export async function close() {
  await browser?.close();
  browser = undefined;
}

/** A page at an address, in a browser profile of its own. */
export async function visit(url, { width = 1280, height = 800, dark = false, touch = false } = {}) {
  const context = await (await open()).newContext({
    viewport: { width, height }, colorScheme: dark ? 'dark' : 'light', hasTouch: touch, isMobile: touch,
    permissions: ['clipboard-read', 'clipboard-write'], acceptDownloads: true,
  });
  context.setDefaultTimeout(PATIENCE);
  const page = await context.newPage();
  const errors = [];
  page.on('console', (message) => ['error', 'warning'].includes(message.type()) && errors.push(message.text()));
  page.on('pageerror', (error) => errors.push(String(error.stack)));
  await page.goto(url);
  return { page, errors, context, ...words(page) };
}

/** What tests say of a page. */
function words(page) {
  const canvas = page.locator('motes-stage canvas');
  const store = (expression) => page.evaluate(`import('/page/store.js').then(({store}) => ${expression})`);
  /** Waits for the exact picture of the newest state; gives its hash. */
  async function exact() {
    const rested = async () => {
      // A picture from before the window had its size does not count.
      const sized = await canvas.evaluate((c) => Math.abs(c.width - c.clientWidth * devicePixelRatio) < 1);
      if (!sized) return '';
      // In this order: a hash that is read before its state may be that of the picture before.
      const [state, idle] = [Number(await canvas.getAttribute('data-state')), await store('!store.pending && store.inFlight === 0 && store.state')];
      const [exactly, hash] = [await canvas.getAttribute('data-exact'), await canvas.getAttribute('data-hash')];
      return exactly === 'true' && idle !== false && state === idle ? hash : '';
    };
    return until(rested, 'an exact picture');
  }
  return {
    canvas,
    store,
    exact,
    camera: () => store('store.resolved.camera'),
    /** The middle of the picture and its size, in the window. */
    async middle() {
      const box = await canvas.boundingBox();
      return { ...box, x: box.x + box.width / 2, y: box.y + box.height / 2, left: box.x, top: box.y };
    },
    /** Drags in the picture from its middle. */
    async drag(dx, dy, { button = 'left', from = [0, 0] } = {}) {
      const box = await canvas.boundingBox();
      const [x, y] = [box.x + box.width / 2 + from[0], box.y + box.height / 2 + from[1]];
      await page.mouse.move(x, y);
      await page.mouse.down({ button });
      await page.mouse.move(x + dx / 2, y + dy / 2, { steps: 4 });
      await page.mouse.move(x + dx, y + dy, { steps: 4 });
      await page.mouse.up({ button });
    },
    /** Opens a panel. */
    async panel(name) {
      const tab = page.locator(`#tab-${name}`);
      if (await tab.getAttribute('aria-selected') !== 'true') await tab.click();
    },
    screenshot: (name) => (process.env.MOTES_SCREENSHOTS
      ? page.screenshot({ path: path.join(process.env.MOTES_SCREENSHOTS, `${name}.png`) }) : undefined),
  };
}

/** Waits until `test` gives something. */
export async function until(test, what, patience = PATIENCE) {
  const end = Date.now() + patience;
  for (;;) {
    const found = await test();
    if (found) return found;
    if (Date.now() > end) assert.fail(`waited in vain for ${what}`);
    await new Promise((resolve) => setTimeout(resolve, 40));
  }
}

/** A folder that is gone afterwards. */
export function folder(t) {
  const at = fs.mkdtempSync(path.join(os.tmpdir(), 'motes-browser-'));
  t.after(() => fs.rmSync(at, { recursive: true }));
  return at;
}

/** A line to a server that can be cut: everything passes, until `cut`. */
export async function wire(t, port) {
  const pairs = new Set();
  const server = net.createServer((here) => {
    const there = net.connect(port, '127.0.0.1');
    const pair = [here, there];
    pairs.add(pair);
    const end = () => {
      pair.forEach((socket) => socket.destroy());
      pairs.delete(pair);
    };
    here.pipe(there);
    there.pipe(here);
    pair.forEach((socket) => { socket.on('error', end); socket.on('close', end); });
  });
  server.listen(0, '127.0.0.1');
  await once(server, 'listening');
  const own = server.address().port;
  const cut = async () => {
    const closed = new Promise((resolve) => { server.close(resolve); });
    pairs.forEach((pair) => pair.forEach((socket) => socket.destroy()));
    await closed;
  };
  t.after(() => server.listening && cut());
  return {
    port: own,
    cut,
    async mend() {
      server.listen(own, '127.0.0.1');
      await once(server, 'listening');
    },
  };
}
