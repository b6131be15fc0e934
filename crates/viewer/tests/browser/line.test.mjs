// The line between page and server: several clients, lost connections, and messages that mean no good.
import test, { after } from 'node:test';
import assert from 'node:assert/strict';
import http from 'node:http';
import net from 'node:net';
import { close, data, serve, until, visit, wire } from './harness.mjs';

after(close);

const SOURCE = data('1l2y.pdb');

test('two clients see views of their own', async (t) => {
  const server = await serve(SOURCE);
  t.after(() => server.stop());
  const [one, two] = await Promise.all([visit(server.url), visit(server.url)]);
  const [first, other] = [await one.exact(), await two.exact()];
  assert.equal(first, other);
  await one.drag(150, 0);
  assert.notEqual(await one.exact(), first);
  assert.equal(await two.exact(), first);
  assert.equal(await two.store('store.undo'), 0);
  await two.context.close();
  await one.drag(-20, 10);
  await one.exact();
  assert.deepEqual([one.errors, two.errors], [[], []]);
  await one.context.close();
});

test('a view is taken up again after its line was cut', async (t) => {
  const server = await serve(SOURCE);
  t.after(() => server.stop());
  const line = await wire(t, server.port);
  const seen = await visit(`http://127.0.0.1:${line.port}/?token=${server.token}`);
  t.after(() => seen.context.close());
  await seen.exact();
  await seen.drag(100, 50);
  const hash = await seen.exact();
  const key = await seen.store('store.line.view');
  await line.cut();
  await seen.page.getByText('The connection to Motes was lost').waitFor();
  await seen.screenshot('lost');
  await line.mend();
  await until(async () => await seen.store('store.line.open'), 'the line');
  await until(async () => await seen.exact() === hash, 'the same picture');
  assert.equal(await seen.store('store.line.view'), key);
  assert.equal(await seen.store('store.undo'), 1);
  assert.equal(await seen.page.getByText('The connection to Motes was lost').count(), 0);
});

test('after the server stopped and started, the new address goes on with the view', async (t) => {
  const server = await serve(SOURCE);
  t.after(() => server.stop());
  const seen = await visit(server.url);
  t.after(() => seen.context.close());
  await seen.exact();
  await seen.drag(100, 50);
  const hash = await seen.exact();
  // The address follows when all has been at rest for a while.
  await new Promise((resolve) => { setTimeout(resolve, 2000); });
  await until(async () => (await seen.page.evaluate('location.hash')).startsWith('#s='), 'an address');
  assert.equal(await server.stop(), 0);
  await seen.page.getByText('Motes has ended').waitFor();
  const next = await serve(SOURCE, '--port', server.port);
  t.after(() => next.stop());
  await seen.page.getByLabel('New address').waitFor();
  await seen.screenshot('refused');
  await seen.page.getByLabel('New address').fill(next.url);
  await seen.page.getByRole('button', { name: 'Open' }).click();
  await until(async () => {
    try {
      return await seen.exact() === hash;
    } catch (error) {
      if (/navigat|destroyed/.test(error.message)) return false;
      throw error;
    }
  }, 'the same picture');
});

/** Asks as no browser would; gives the status. */
function ask(port, at, headers = {}) {
  return new Promise((resolve, reject) => {
    const request = http.get({ port, host: '127.0.0.1', path: at, headers }, (answer) => {
      answer.resume();
      resolve(answer.statusCode);
    });
    request.on('upgrade', (_, socket) => { socket.destroy(); resolve(101); });
    request.on('error', reject);
  });
}

const UPGRADE = { Connection: 'Upgrade', Upgrade: 'websocket', 'Sec-WebSocket-Version': '13', 'Sec-WebSocket-Key': 'dGhlIHNhbXBsZSBub25jZQ==' };

test('strangers are refused', async (t) => {
  const server = await serve(SOURCE);
  t.after(() => server.stop());
  const { port, token } = server;
  const own = { Host: `127.0.0.1:${port}`, Origin: `http://127.0.0.1:${port}` };
  const status = (at, headers) => ask(port, at, { ...own, ...headers });
  assert.equal(await status('/', {}), 200);
  assert.equal(await status(`/ws?token=${token}`, UPGRADE), 101);
  assert.equal(await status('/ws?token=wrong', UPGRADE), 401);
  assert.equal(await status('/ws', UPGRADE), 401);
  assert.equal(await status(`/ws?token=${token}`, { ...UPGRADE, Origin: 'http://example.com' }), 403);
  assert.equal(await status(`/ws?token=${token}`, { ...UPGRADE, Host: 'example.com' }), 403);
  assert.equal(await status('/', { Host: 'example.com' }), 403);
  assert.equal(await status('/save/picture.png', {}), 401);
  for (const at of ['/page/../Cargo.toml', '/page/%2e%2e/Cargo.toml', '/etc/passwd', '/page//etc/passwd']) {
    assert.notEqual(await status(at, {}), 200, at);
  }
  assert.ok(server.running());
});

test('nonsense, floods and giants change nothing for others', async (t) => {
  const server = await serve(SOURCE);
  t.after(() => server.stop());
  const seen = await visit(server.url);
  t.after(() => seen.context.close());
  const hash = await seen.exact();
  const answers = await seen.page.evaluate(async (url) => {
    const line = () => new Promise((resolve) => {
      const socket = new WebSocket(url);
      socket.heard = [];
      socket.onmessage = ({ data: text }) => typeof text === 'string' && socket.heard.push(JSON.parse(text));
      socket.onopen = () => resolve(socket);
    });
    const rest = (ms) => new Promise((resolve) => { setTimeout(resolve, ms); });
    const bad = await line();
    for (const text of ['', '{', 'null', '[]', '{"id":1}', '{"id":2,"do":"fly"}', '{"id":3,"do":"set"}', '{"id":4,"do":"set","changes":{"camera.fov":"wide"}}',
      '{"id":5,"do":"set","changes":{"camera.fov":1e999}}', '{"id":6,"do":"resize","width":0,"height":-1}', '{"id":7,"do":"resize","width":999999999,"height":999999999}',
      '{"id":8,"do":"pick","x":"a"}', '{"id":9,"do":"histogram","system":99,"property":"x"}', '{"id":10,"do":"load","scene":"system = 3"}',
      '{"id":11,"do":"load","scene":"[[system]]\\nsource = \\"/etc/passwd\\""}', '{"id":12,"do":"select","box":[]}', '{"id":13,"do":"shown","serial":-5}',
      `{"id":14,"do":"set","changes":{"system.0.where":"${'('.repeat(5000)}"}}`, '['.repeat(20000)]) bad.send(text);
    bad.send(new Uint8Array(1000));
    await rest(600);
    const refused = bad.heard.filter((m) => m.error).map((m) => m.re);
    const flood = await line();
    for (let i = 0; i < 5000; i++) flood.send(`{"id":${i},"do":"scene"}`);
    const giant = await line();
    const closed = new Promise((resolve) => { giant.onclose = () => resolve(true); });
    giant.send(`{"id":1,"do":"set","changes":{"x":"${'x'.repeat(1 << 24)}"}}`);
    const gone = await Promise.race([closed, rest(5000)]);
    flood.close();
    bad.close();
    return { refused, gone };
  }, `ws://127.0.0.1:${server.port}/ws?token=${server.token}`);
  for (const id of [2, 3, 4, 6, 7, 8, 9, 10, 11, 12]) assert.ok(answers.refused.includes(id), `request ${id} is refused`);
  assert.equal(answers.gone, true, 'who sends giants is shown out');
  // Half a request, and nothing more.
  net.connect(server.port, '127.0.0.1').on('error', () => {}).write('GET /ws?token=');
  assert.equal(await seen.exact(), hash);
  await seen.drag(30, 30);
  await seen.exact();
  assert.ok(server.running());
});
