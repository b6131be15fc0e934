/**
 * @file The condition `where` as text, of which the page writes parts: hidden types, and boxes of the screen.
 *
 * What the page writes is a condition of its own, joined by `&&`; so it stands in the box for all to see and
 * to change, and the rest is as it was typed.
 */

const HIDDEN = /^Particle Type != (?:"([^"]*)"|'([^']*)'|(\d+))$/;

/** The parts between `&&` outside parentheses, quotes and backticks. @param {string} where @returns {string[]} */
export function parts(where) {
  const all = [''];
  let [depth, quote] = [0, ''];
  for (let i = 0; i < where.length; i++) {
    const c = where[i];
    if (quote) quote = c === quote ? '' : quote;
    else if ('"\'`'.includes(c)) quote = c;
    else if (c === '(') depth += 1;
    else if (c === ')') depth -= 1;
    else if (depth === 0 && where.startsWith('&&', i)) {
      all.push('');
      i += 1;
      continue;
    }
    all[all.length - 1] += c;
  }
  return all.map((p) => p.trim()).filter(Boolean);
}

/** The names of types that the condition hides. @param {string} where @returns {string[]} */
export const hidden = (where) => parts(where).flatMap((part) => {
  const found = HIDDEN.exec(part);
  return found ? [found[1] ?? found[2] ?? found[3]] : [];
});

/** The condition with these types hidden and no others. @param {string} where @param {string[]} names @param {boolean} text whether types are names */
export function withHidden(where, names, text) {
  const rest = parts(where).filter((part) => !HIDDEN.test(part));
  return and(rest.join(' && '), ...names.map((name) => `Particle Type != ${text ? quoted(name) : name}`));
}

/** @param {string} name */
const quoted = (name) => (name.includes('"') ? `'${name}'` : `"${name}"`);

/** The condition and others. @param {string} where @param {...string} others */
export function and(where, ...others) {
  // An `or` outside binds looser than `&&`.
  const loose = others.length > 0 && parts(where).some((p) => /(^|\s)(\|\||or)(\s|$)/i.test(p.replace(/\([^]*\)/g, '')));
  return [loose ? `(${where})` : where, ...others].filter(Boolean).join(' && ');
}

/**
 * The condition that a particle's centre lies in a box of the picture.
 * @param {number[]} box x0, y0, x1, y1 in 0…1
 * @param {import('./camera.js').Camera} camera of that picture
 */
export function inBox([x0, y0, x1, y1], camera) {
  const corners = [[x0, y0], [x1, y0], [x1, y1], [x0, y1]].map(([x, y]) => camera.ray(x, y));
  /** @type {(a: number[], b: number[]) => number} */
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  /** @type {(a: number[], b: number[]) => number[]} */
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  return corners.map((a, i) => {
    const b = corners[(i + 1) % 4];
    const along = camera.flat ? a.direction : b.direction;
    const side = camera.flat ? b.origin.map((v, k) => v - a.origin[k]) : a.direction;
    // Inwards, from the ray through the middle.
    let n = cross(side, along);
    const middle = camera.ray((x0 + x1) / 2, (y0 + y1) / 2);
    const inside = middle.origin.map((v, k) => v + middle.direction[k] * camera.distance - a.origin[k]);
    if (dot(n, inside) < 0) n = n.map((v) => -v);
    const size = Math.hypot(...n) || 1;
    n = n.map((v) => v / size);
    return half(n, dot(n, a.origin));
  }).join(' && ');
}

/** The condition n·Position >= c. @param {number[]} n @param {number} c */
function half(n, c) {
  const terms = ['X', 'Y', 'Z'].map((axis, i) => [Number(n[i].toPrecision(7)), axis]).filter(([v]) => Math.abs(Number(v)) > 1e-9);
  const sum = terms.map(([v, axis], i) => `${Number(v) < 0 ? (i ? '- ' : '-') : i ? '+ ' : ''}${Math.abs(Number(v))}*Position.${axis}`).join(' ');
  return `${sum} >= ${Number(c.toPrecision(9))}`;
}
