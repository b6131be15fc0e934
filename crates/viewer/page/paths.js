/** @file Paths into the scene and its schema: `camera.fov`, `system.0.color.by`. */

/** @typedef {import('./types.js').Shape} Shape */
/** @typedef {import('./types.js').Field} Field */

/** The value at a path, or undefined. @param {any} tree @param {string} path */
export function at(tree, path) {
  return path.split('.').reduce((node, name) => node?.[name], tree);
}

/**
 * A copy of `tree` with `value` at `path`; what is not on the path is shared.
 * @param {any} tree
 * @param {string} path
 * @param {unknown} value
 * @returns {any}
 */
export function put(tree, path, value) {
  const [name, ...rest] = path.split('.');
  const copy = Array.isArray(tree) ? [...tree] : { ...tree };
  copy[name] = rest.length ? put(copy[name] ?? {}, rest.join('.'), value) : value;
  return copy;
}

/**
 * The field of the schema at a path; an entry of a map has the map's.
 * @param {Shape} schema
 * @param {string} path
 * @returns {Field|undefined}
 */
export function find(schema, path) {
  /** @type {Field|undefined} */
  let field;
  /** @type {Shape|undefined} */
  let shape = schema;
  for (const name of path.split('.')) {
    if (shape?.kind === 'list') {
      shape = shape.of;
      if (/^\d+$/.test(name)) continue;
    } else if (shape?.kind === 'map') {
      shape = shape.of;
      continue;
    }
    field = shape?.fields?.find((f) => f.name === name);
    if (!field) return undefined;
    shape = field.shape;
  }
  return field;
}

/**
 * Every field below a shape with its path, tables and lists included.
 * @param {Shape} shape
 * @param {string} [prefix]
 * @returns {{path: string, field: Field}[]}
 */
export function reach(shape, prefix = '') {
  const fields = shape.kind === 'table' ? shape.fields ?? [] : [];
  return fields.flatMap((field) => {
    const path = prefix ? `${prefix}.${field.name}` : field.name;
    return [{ path, field }, ...reach(field.shape, path)];
  });
}

/** Whether two values of a scene are the same. @param {unknown} a @param {unknown} b */
export function same(a, b) {
  return a === b || JSON.stringify(a ?? null) === JSON.stringify(b ?? null);
}
