/** @file Dark and light: as the system has it, until it is switched. */

const saved = localStorage.getItem('motes-theme');
if (saved) document.documentElement.style.colorScheme = saved;

/** Whether the page is dark. */
export const dark = () => {
  const forced = document.documentElement.style.colorScheme;
  return forced ? forced === 'dark' : matchMedia('(prefers-color-scheme: dark)').matches;
};

/** The other one. */
export function turn() {
  const to = dark() ? 'light' : 'dark';
  document.documentElement.style.colorScheme = to;
  localStorage.setItem('motes-theme', to);
  document.dispatchEvent(new CustomEvent('theme'));
}
