/** @file Numbers and names as people read them. */

const THOUSANDS = new Intl.NumberFormat('en');

/**
 * A number with about `digits` significant digits: `0.0123`, `1.23e9`, `12,345`.
 * @param {unknown} value
 * @param {number} [digits]
 * @returns {string}
 */
export function number(value, digits = 5) {
  if (typeof value === 'string') return value;
  if (typeof value === 'boolean') return value ? 'yes' : 'no';
  if (typeof value !== 'number' || Number.isNaN(value)) return '–';
  if (!Number.isFinite(value)) return value > 0 ? '∞' : '−∞';
  if (value === 0) return '0';
  const size = Math.abs(value);
  const text = size >= 1e7 || size < 1e-4
    ? value.toExponential(Math.max(0, digits - 2)).replace(/\.?0+e/, 'e').replace('e+', 'e')
    : String(Number(value.toPrecision(digits)));
  return text.replace('-', '−');
}

/**
 * A count with its thousands apart.
 * @param {number} value
 * @returns {string}
 */
export const count = (value) => THOUSANDS.format(Math.round(value));

/**
 * A value of a property: a number, or several.
 * @param {unknown} value
 * @returns {string}
 */
export function values(value) {
  return Array.isArray(value) ? value.map((v) => number(v)).join('  ') : number(value, 7);
}

/**
 * A number as typed, with a point or a comma; `undefined` if it is none.
 * @param {string} text
 * @returns {number|undefined}
 */
export function parse(text) {
  const value = Number(text.trim().replace('−', '-').replace(',', '.'));
  return text.trim() !== '' && Number.isFinite(value) ? value : undefined;
}

/**
 * A name of the scene as a label: `radius_scale` is `Radius scale`.
 * @param {string} name
 * @returns {string}
 */
export function label(name) {
  const words = name.replaceAll('_', ' ').replace('color', 'colour');
  const known = /** @type {Record<string, string>} */ ({ fov: 'Field of view', ior: 'Index of refraction', by: 'Colour by', map: 'Colour map', sph: 'SPH simulation', iors: 'Indices of refraction' });
  return known[name] ?? words.charAt(0).toUpperCase() + words.slice(1);
}

/**
 * `n` rounded so that its steps are about a millionth of `size`: short text, unseen difference.
 * @param {number} n
 * @param {number} size
 * @returns {number}
 */
export function tidy(n, size) {
  const digits = Math.min(15, Math.max(0, 6 - Math.floor(Math.log10(size || 1))));
  return Number(n.toFixed(digits));
}
