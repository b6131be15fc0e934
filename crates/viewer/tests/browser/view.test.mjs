// The viewer as one uses it: a real server, a real browser.
import test, { after } from 'node:test';
import assert from 'node:assert/strict';
import fs from 'node:fs';
import path from 'node:path';
import { close, data, folder, motes, serve, until, visit } from './harness.mjs';
import { array } from './npz.mjs';

/** Runs a test on a page of its own, whose console has to stay free of errors. */
function page(name, source, options, run) {
  test(name, async (t) => {
    const server = await serve(source, ...(options.args ?? []));
    t.after(() => server.stop());
    const seen = await visit(server.url, options);
    t.after(() => seen.context.close());
    await seen.exact();
    await run(seen, server, t);
    assert.deepEqual(seen.errors, []);
    assert.equal(await server.stop(), 0, 'Ctrl-C ends it cleanly');
  });
}

after(close);

const PEPTIDE = data('1l2y.pdb');

page('the first picture is the one that `motes render` makes', PEPTIDE, {}, async (seen, server, t) => {
  assert.match(await seen.page.title(), /1l2y\.pdb/);
  const hash = await seen.exact();
  const { text } = await seen.store("store.line.ask('command')");
  const at = folder(t);
  run(text, at);
  assert.equal(JSON.parse(fs.readFileSync(path.join(at, 's.json'))).hash, hash);
  await seen.screenshot('load');
});

/** Runs a command line that the page gave, with a picture, layers and stats beside. */
function run(text, at) {
  const words = [...text.matchAll(/'((?:[^']|'\\'')*)'|(\S+)/g)].map(([, quoted, plain]) => (quoted ?? plain).replaceAll("'\\''", "'"));
  assert.deepEqual(words.slice(0, 2), ['motes', 'render']);
  const bare = words.slice(2).filter((w, i, all) => w !== '-o' && all[i - 1] !== '-o');
  motes('render', ...bare, '-o', path.join(at, 'p.png'), '--stats', path.join(at, 's.json'), '--layers', path.join(at, 'l.npz'), '-q');
}

page('dragging turns, the wheel zooms, and all of a drag is one step to undo', 'demo:dam:20000', {}, async (seen) => {
  const [first, camera] = [await seen.exact(), await seen.camera()];
  await seen.drag(120, 60);
  const turned = await seen.exact();
  assert.notEqual(turned, first);
  const there = await seen.camera();
  const far = (c) => Math.hypot(...c.position.map((v, i) => v - c.target[i]));
  assert.ok(Math.abs(far(there) / far(camera) - 1) < 1e-4, 'it turns about the target');
  assert.equal(await seen.store('store.undo'), 1);
  await seen.page.mouse.wheel(0, -400);
  await until(async () => far(await seen.camera()) < 0.8 * far(camera), 'the zoom');
  await seen.exact();
  await seen.drag(40, 0, { button: 'middle' });
  await seen.exact();
  assert.notDeepEqual((await seen.camera()).target, camera.target, 'the middle button moves aside');
  for (let i = 0; i < 3; i++) await seen.page.keyboard.press('Control+z');
  await until(async () => await seen.store('store.undo') === 0, 'undo');
  assert.equal(await seen.exact(), first);
  await seen.page.keyboard.press('Control+Shift+z');
  await until(async () => await seen.store('store.undo') === 1, 'redo');
  assert.equal(await seen.exact(), turned);
});

page('keys turn, fit, look along axes and change the projection', PEPTIDE, {}, async (seen) => {
  await seen.canvas.focus();
  await seen.page.keyboard.press('3');
  await until(async () => {
    const { position, target } = await seen.camera();
    const along = target.map((v, i) => v - position[i]);
    return along[2] / Math.hypot(...along) < -0.9999;
  }, 'the view from the top');
  await seen.page.keyboard.press('o');
  await until(async () => (await seen.camera()).projection === 'orthographic', 'orthographic');
  await seen.page.keyboard.press('ArrowLeft');
  await seen.page.keyboard.press('+');
  await seen.exact();
  await seen.page.keyboard.press('f');
  await seen.page.keyboard.press('p');
  await until(async () => (await seen.camera()).projection === 'perspective', 'perspective');
  await seen.exact();
  await seen.page.keyboard.press('?');
  await seen.page.locator('dialog[open] h2').waitFor();
  await seen.page.keyboard.press('Escape');
  await until(async () => await seen.page.locator('dialog[open]').count() === 0, 'the help to close');
});

page('a condition shows some, and what is wrong with it stands under it', PEPTIDE, {}, async (seen) => {
  await seen.panel('filter');
  const box = seen.page.locator('#where');
  const says = seen.page.locator('#where-says');
  await box.fill('Position.Z > 0 &&');
  await until(async () => /column|expected/.test(await says.textContent()), 'what is wrong');
  assert.equal(await seen.store("store.get('system.0.where')"), '');
  await box.fill('Position.Z > 0');
  await box.press('Enter');
  await until(async () => await seen.store("store.get('system.0.where')") === 'Position.Z > 0', 'the condition');
  await seen.exact();
  const some = Number(/(\d+) of 304/.exec(await says.textContent())[1]);
  assert.ok(some > 20 && some < 284);
  await until(async () => (await seen.page.locator('.readout').textContent()).includes(`${some} of 304`), 'the count');
  await seen.panel('types');
  await seen.page.getByRole('switch', { name: 'Show H', exact: true }).click();
  await until(async () => /Particle Type != "H"/.test(await seen.store("store.get('system.0.where')")), 'the switch');
  const fewer = await until(async () => {
    const found = /(\d+) of 304/.exec(await seen.page.locator('.readout').textContent());
    return found && Number(found[1]) < some && Number(found[1]);
  }, 'fewer particles');
  assert.ok(fewer > 0);
  await seen.screenshot('filter');
});

page('the handles of the histogram hold the range of the colours and of what is shown', 'demo:dam:20000', {}, async (seen) => {
  await seen.panel('look');
  await seen.page.selectOption('#color-by', 'Position');
  await seen.exact();
  const handle = seen.page.getByRole('slider', { name: 'Least value' });
  await until(async () => Number(await handle.getAttribute('aria-valuemax')) > 0, 'the histogram');
  await seen.page.getByRole('switch', { name: 'Hide what is outside' }).click();
  const before = await seen.exact();
  const box = await handle.boundingBox();
  await seen.page.mouse.move(box.x + box.width / 2, box.y + 20);
  await seen.page.mouse.down();
  await seen.page.mouse.move(box.x + 90, box.y + 20, { steps: 8 });
  await seen.page.mouse.up();
  const [low] = await until(() => seen.store("store.get('system.0.color.range')"), 'a range');
  await until(async () => Math.abs((await seen.store("store.get('system.0.filter.0.min')")) - low) < 1e-9, 'the filter');
  assert.notEqual(await seen.exact(), before);
  assert.match(await seen.page.locator('.readout').textContent(), /of 20,000/);
  await seen.screenshot('range');
});

page('the camera stands while filters and planes come and go', 'demo:dam:20000', {}, async (seen) => {
  const { position } = await seen.camera();
  await seen.store("store.set({ 'system.0.filter': [{ property: 'Position', component: 'x', min: 0.5 }] })");
  await seen.exact();
  await seen.store("store.set({ section: [{ normal: [0, 0, 1], point: [0.5, 0.5, 0.2] }] })");
  await seen.exact();
  assert.deepEqual((await seen.camera()).position, position);
  await seen.canvas.focus();
  await seen.page.keyboard.press('f');
  await seen.exact();
  assert.notDeepEqual((await seen.camera()).position, position, 'F frames what is left');
});

page('frames play, stop, and are stepped', PEPTIDE, {}, async (seen) => {
  assert.equal(await seen.store('store.resolved.frames'), 5);
  await seen.canvas.focus();
  await seen.page.keyboard.press('.');
  await until(async () => await seen.store('store.get("image.frame")') === 1, 'the next frame');
  await seen.exact();
  await seen.page.keyboard.press(' ');
  const slider = seen.page.getByRole('slider', { name: 'Frame' });
  await until(async () => Number(await slider.inputValue()) > 2, 'frames to pass');
  await seen.page.keyboard.press(' ');
  await until(async () => !(await seen.store('store.playing ?? store.resolved.playing')), 'an end');
  await seen.exact();
  const frame = await seen.store('store.get("image.frame")');
  assert.equal(Number(await slider.inputValue()), frame, 'it stops at the frame that is shown');
  await seen.page.getByRole('button', { name: 'First frame' }).click();
  await until(async () => await seen.store('store.get("image.frame")') === 0, 'the first frame');
  await seen.exact();
});

page('a click asks for the particle that the layers have there', PEPTIDE, {}, async (seen, server, t) => {
  await seen.exact();
  const { text } = await seen.store("store.line.ask('command')");
  const at = folder(t);
  run(text, at);
  const ids = array(path.join(at, 'l.npz'), 'id');
  const [height, width] = ids.shape;
  const box = await seen.middle();
  assert.deepEqual([width, height], [Math.round(box.width), Math.round(box.height)]);
  let hits = 0;
  for (const [i, j] of [[0.5, 0.5], [0.45, 0.42], [0.55, 0.6], [0.4, 0.6], [0.02, 0.03]]) {
    const [x, y] = [Math.floor(i * width), Math.floor(j * height)];
    const id = Number(ids.values[y * width + x]);
    await seen.page.mouse.click(box.left + x + 0.5, box.top + y + 0.5);
    if (id < 0) {
      await until(async () => await seen.store('store.picked') === null, 'nothing');
      continue;
    }
    hits += 1;
    await until(async () => (await seen.store('store.picked'))?.index === id, `particle ${id}`);
    assert.match(await seen.page.locator('motes-card dl').textContent(), new RegExp(`Index${id}`));
    if (hits === 1) await seen.screenshot('pick');
  }
  assert.ok(hits > 0);
});

page('a distance and an angle are measured, a box is selected and kept', PEPTIDE, {}, async (seen) => {
  const box = await seen.middle();
  const clicks = async (places) => {
    for (const [dx, dy] of places) {
      const before = JSON.stringify(await seen.store('store.measures.map((m) => m.points.length)'));
      await seen.page.mouse.click(box.x + dx, box.y + dy);
      await until(async () => JSON.stringify(await seen.store('store.measures.map((m) => m.points.length)')) !== before, 'a point');
    }
  };
  // Places where there are atoms.
  const found = await seen.store(`Promise.all([...Array(100).keys()].map(async (k) => {
    const [x, y] = [0.35 + 0.03 * (k % 10), 0.35 + 0.03 * Math.floor(k / 10)];
    const around = await Promise.all([[0, 0], [-0.004, 0], [0.004, 0], [0, -0.004], [0, 0.004]].map(([dx, dy]) => store.line.ask('pick', { x: x + dx, y: y + dy })));
    const { picked } = around[0];
    return picked && around.every((a) => a.picked?.index === picked.index) && { x, y, index: picked.index, position: picked.position };
  })).then((all) => all.filter(Boolean).filter((p, i, l) => l.findIndex((q) => q.index === p.index) === i).slice(0, 3))`);
  assert.equal(found.length, 3);
  const places = found.map(({ x, y }) => [(x - 0.5) * box.width, (y - 0.5) * box.height]);
  await seen.page.keyboard.press('m');
  await clicks(places.slice(0, 2));
  const [a, b] = found.map((p) => p.position);
  const far = Math.hypot(...a.map((v, i) => v - b[i]));
  const shown = Number((await seen.page.locator('.measures b').first().textContent()).replace('−', '-'));
  assert.ok(Math.abs(shown / far - 1) < 1e-5, `${shown} is not ${far}`);
  await seen.page.keyboard.press('n');
  await clicks(places);
  assert.match(await seen.page.locator('.measures b').nth(1).textContent(), /^\d+(\.\d+)?°$/);
  await seen.screenshot('measure');
  await seen.page.keyboard.press('b');
  await seen.drag(120, 120, { from: [-60, -60] });
  const selected = await until(() => seen.store('store.selection?.count'), 'a selection');
  await seen.page.getByRole('button', { name: 'Keep only these' }).click();
  await until(async () => (await seen.page.locator('.readout').textContent()).startsWith(`${selected} of 304`), `${selected} particles`);
});

page('a drag cuts, the plane moves, flips and goes', PEPTIDE, {}, async (seen, server, t) => {
  if (!(await seen.store("store.has('section')"))) return t.skip('no sections yet');
  const whole = await seen.exact();
  await seen.page.keyboard.press('x');
  await seen.drag(0, -90);
  await until(async () => (await seen.store("store.get('section')")).length === 1, 'a plane');
  const cut = await seen.exact();
  assert.notEqual(cut, whole);
  await seen.screenshot('cut');
  const normal = await seen.store("store.get('section.0.normal')");
  await seen.page.getByRole('button', { name: /Keep the other side/ }).click();
  const along = (other) => other.reduce((sum, v, i) => sum + v * normal[i], 0);
  await until(async () => along(await seen.store("store.get('section.0.normal')")) < 0, 'the other side');
  assert.notEqual(await seen.exact(), cut);
  const foot = await seen.page.locator('motes-overlay .foot').boundingBox();
  const before = await seen.store("store.get('section.0.point')");
  await seen.page.mouse.move(foot.x + foot.width / 2, foot.y + foot.height / 2);
  await seen.page.mouse.down();
  await seen.page.mouse.move(foot.x + foot.width / 2, foot.y + foot.height / 2 - 40, { steps: 5 });
  await seen.page.mouse.up();
  await until(async () => JSON.stringify(await seen.store("store.get('section.0.point')")) !== JSON.stringify(before), 'the plane to move');
  await seen.exact();
  for (let i = 0; i < 3; i++) await seen.page.keyboard.press('Control+z');
  await until(async () => (await seen.store("store.get('section')")).length === 0, 'undo');
  assert.equal(await seen.exact(), whole);
});

page('pictures, the scene and the address are saved and give the same again', PEPTIDE, {}, async (seen, server, t) => {
  const at = folder(t);
  await seen.drag(80, -30);
  await seen.panel('look');
  await seen.page.selectOption('#color-by', 'Position');
  const hash = await seen.exact();
  await seen.page.keyboard.press('Control+s');
  const save = async (name, file) => {
    const [download] = await Promise.all([seen.page.waitForEvent('download'), seen.page.getByRole('button', { name, exact: true }).click()]);
    assert.equal(download.suggestedFilename(), file);
    await download.saveAs(path.join(at, file));
    return fs.readFileSync(path.join(at, file));
  };
  await seen.page.getByLabel('Width, pixels').fill('320');
  await seen.page.getByLabel('Height, pixels').fill('200');
  const png = await save('PNG', 'picture.png');
  assert.deepEqual([png.readUInt32BE(16), png.readUInt32BE(20)], [320, 200]);
  assert.match((await save('Scene', 'scene.toml')).toString(), /Position/);
  await seen.screenshot('save');
  await seen.page.keyboard.press('Escape');
  await until(async () => (await seen.page.evaluate('location.hash')).startsWith('#s='), 'an address');
  const address = await seen.store("import('/page/address.js').then((a) => a.share())");
  const again = await visit(address);
  t.after(() => again.context.close());
  await until(async () => await again.exact() === hash, 'the same picture');
  assert.deepEqual(again.errors, []);
});

page('what is there has names and can be reached by keys', PEPTIDE, { dark: true }, async (seen) => {
  for (const name of ['look', 'types', 'filter', 'light', 'picture', 'ask', 'all', 'log']) {
    await seen.panel(name);
    const nameless = await seen.page.evaluate(() => [...document.querySelectorAll('button, input, select, textarea, [role=slider], [role=switch]')]
      .filter((e) => e.checkVisibility())
      .filter((e) => !(e.getAttribute('aria-label') || e.textContent.trim() || e.labels?.length))
      .map((e) => e.outerHTML.slice(0, 120)));
    assert.deepEqual(nameless, [], name);
    await seen.screenshot(`panel-${name}`);
  }
  await seen.page.evaluate('document.activeElement.blur()');
  const reached = new Set();
  for (let i = 0; i < 40; i++) {
    await seen.page.keyboard.press('Tab');
    reached.add(await seen.page.evaluate("document.activeElement.closest('motes-toolbar, motes-stage, motes-dock, motes-timeline')?.localName"));
  }
  for (const part of ['motes-toolbar', 'motes-stage', 'motes-dock', 'motes-timeline']) assert.ok(reached.has(part), part);
});

page('text has contrast, dark and light', PEPTIDE, {}, async (seen) => {
  for (const dark of [false, true]) {
    await seen.page.evaluate(`document.documentElement.style.colorScheme = '${dark ? 'dark' : 'light'}'`);
    // Colours change over a moment.
    await new Promise((resolve) => { setTimeout(resolve, 400); });
    const poor = await seen.page.evaluate(() => {
      const canvas = document.createElement('canvas').getContext('2d', { willReadFrequently: true });
      const rgb = (color) => {
        canvas.clearRect(0, 0, 1, 1);
        canvas.fillStyle = color;
        canvas.fillRect(0, 0, 1, 1);
        return [...canvas.getImageData(0, 0, 1, 1).data];
      };
      const light = ([r, g, b]) => [r, g, b].map((v) => (v / 255 <= 0.04045 ? v / 255 / 12.92 : ((v / 255 + 0.055) / 1.055) ** 2.4))
        .reduce((sum, v, i) => sum + v * [0.2126, 0.7152, 0.0722][i], 0);
      const ground = (e) => {
        for (; e; e = e.parentElement) {
          const found = rgb(getComputedStyle(e).backgroundColor);
          if (found[3] > 200) return found;
        }
        return [255, 255, 255];
      };
      return [...document.querySelectorAll('button, label, span, h2, h3, summary, p, dt, dd, option')]
        .filter((e) => e.checkVisibility() && !e.closest(':disabled') && [...e.childNodes].some((n) => n.nodeType === 3 && n.textContent.trim()))
        .map((e) => {
          const [a, b] = [light(rgb(getComputedStyle(e).color)), light(ground(e))];
          return [(Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05), e.outerHTML.slice(0, 80)];
        })
        .filter(([ratio]) => ratio < 4.5);
    });
    assert.deepEqual(poor, [], dark ? 'dark' : 'light');
  }
});
