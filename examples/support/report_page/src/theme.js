// Light or dark: as the system has it until the reader chooses.
const root = document.documentElement;
const system = window.matchMedia('(prefers-color-scheme: dark)');
const listeners = [];

function apply(theme) {
  root.dataset.theme = theme;
  for (const listener of listeners) listener();
}

export function startTheme() {
  const asked = new URLSearchParams(location.search).get('theme');
  apply(asked ?? (system.matches ? 'dark' : 'light'));
  system.addEventListener('change', () => apply(system.matches ? 'dark' : 'light'));
}

export function toggleTheme() {
  apply(root.dataset.theme === 'dark' ? 'light' : 'dark');
}

/** Calls listener whenever colours have changed. */
export function onTheme(listener) {
  listeners.push(listener);
}
