/** @file The icons: strokes on a field of 20 × 20. */
import { svg } from './dom.js';

/** @type {Record<string, string>} */
const PATHS = {
  close: 'M5 5l10 10M15 5L5 15',
  copy: 'M7 7h9v9H7zM13 7V4H4v9h3',
  target: 'M10 3v4M10 13v4M3 10h4M13 10h4M10 10h.01',
  move: 'M4 12c2 4 10 4 12 0M16 12l.5 3.5M16 12l-3.4.8M10 3a7 7 0 0 1 6.5 5M3.500 8A7 7 0 0 1 7 3.700',
  distance: 'M3 15L15 3M3 15l0-4M3 15l4 0M15 3l2 2-12 12-2-2zM8 10l1.500 1.500M11 7l1.500 1.500',
  angle: 'M16 16H4L13 4M9.500 9.200A8 8 0 0 1 12 16',
  box: 'M3 6V3h3M14 3h3v3M17 14v3h-3M6 17H3v-3M8 3h4M8 17h4M3 8v4M17 8v4',
  cut: 'M3 17L17 3M6 5l1 1M4 8h1.500M8 4v1.500M12 12l4 4M12 15v-3h3',
  fit: 'M7 3H3v4M13 3h4v4M17 13v4h-4M7 17H3v-4M10 8a2 2 0 1 0 0 4 2 2 0 0 0 0-4z',
  axes: 'M10 11V3M10 11l6 4M10 11l-6 4M8.500 4.500L10 3l1.500 1.500M14 15.300l2-.3-.7-1.900M6 15.300l-2-.3.7-1.900',
  perspective: 'M3 6l14-3v14L3 14zM10 4.500v11',
  orthographic: 'M3 5h14v10H3zM10 5v10M3 10h14',
  undo: 'M7 4L3 8l4 4M3 8h9a4.500 4.500 0 0 1 0 9H8',
  redo: 'M13 4l4 4-4 4M17 8H8a4.500 4.500 0 0 0 0 9h4',
  save: 'M10 3v10M6 9.500l4 4 4-4M3 17h14',
  share: 'M8 12l4-4M9 6l2.500-2.500a3.500 3.500 0 0 1 5 5L14 11M11 14l-2.500 2.500a3.500 3.500 0 0 1-5-5L6 9',
  light: 'M10 6.500a3.500 3.500 0 1 0 0 7 3.500 3.500 0 0 0 0-7zM10 2v1.500M10 16.500V18M2 10h1.500M16.500 10H18M4.300 4.300l1.100 1.100M14.600 14.600l1.100 1.100M4.300 15.700l1.100-1.100M14.600 5.400l1.100-1.100',
  dark: 'M16 12A7 7 0 0 1 8 4a7 7 0 1 0 8 8z',
  help: 'M7.500 7.500a2.500 2.500 0 1 1 3.700 2.200c-.8.4-1.200 1-1.200 1.800M10 14.500h.01M10 2.500a7.500 7.500 0 1 0 0 15 7.500 7.500 0 0 0 0-15z',
  look: 'M2.500 10S5.500 5 10 5s7.500 5 7.500 5-3 5-7.500 5-7.500-5-7.500-5zM10 8a2 2 0 1 0 0 4 2 2 0 0 0 0-4z',
  types: 'M6 4a2.500 2.500 0 1 0 0 5 2.500 2.500 0 0 0 0-5zM13.500 7a2 2 0 1 0 0 4 2 2 0 0 0 0-4zM8 12a2 2 0 1 0 0 4 2 2 0 0 0 0-4z',
  filter: 'M3 4h14l-5.500 6.500V16l-3-1.500v-4z',
  picture: 'M3 4h14v12H3zM3 13l4-4 4 4 2-2 4 4M13 7.500h.01',
  ask: 'M3 17L17 3M3 13v4h4M13 3h4v4M6 6h.01M14 14h.01',
  all: 'M4 5h12M4 10h12M4 15h12M8 3.500v3M13 8.500v3M6 13.500v3',
  log: 'M4 3h12v11H9l-3.500 3V14H4zM7 7h6M7 10h4',
  play: 'M6 4l10 6-10 6z',
  pause: 'M7 4v12M13 4v12',
  first: 'M5 4v12M15 4l-7 6 7 6z',
  last: 'M15 4v12M5 4l7 6-7 6z',
  back: 'M13 4l-7 6 7 6',
  on: 'M7 4l7 6-7 6',
  loop: 'M4 9a5 5 0 0 1 5-4h6M12.500 2.500L15 5l-2.500 2.500M16 11a5 5 0 0 1-5 4H5M7.500 17.500L5 15l2.500-2.500',
  restart: 'M4 10a6 6 0 1 0 2-4.500M6 2v4h4',
  reset: 'M4 10a6 6 0 1 0 2-4.500M6 2v4h4',
  add: 'M10 4v12M4 10h12',
  remove: 'M4 6h12M8 6V4h4v2M6 6l.700 11h6.600L14 6',
  flip: 'M10 3v14M7 6l-4 4 4 4M13 6l4 4-4 4',
  eye: 'M2.500 10S5.500 5 10 5s7.500 5 7.500 5-3 5-7.500 5-7.500-5-7.500-5zM10 8a2 2 0 1 0 0 4 2 2 0 0 0 0-4z',
  more: 'M6 8l4 4 4-4',
  check: 'M4 10.500l4 4 8-9',
  step: 'M5 4l8 6-8 6zM15 4v12',
};

/** An icon by its name. @param {string} name */
export const icon = (name) => svg('svg', { class: 'glyph', viewBox: '0 0 20 20', 'aria-hidden': 'true' }, svg('path', { d: PATHS[name] ?? '' }));

/** The same, in another element. @param {Element} element @param {string} name */
export const change = (element, name) => element.querySelector('.glyph path')?.setAttribute('d', PATHS[name] ?? '');
