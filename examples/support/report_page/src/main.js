// The page: title, key figures, notes and panels, from the JSON in the element "data".
import { cloud } from './cloud.js';
import { element } from './dom.js';
import { heat } from './heat.js';
import { follow } from './live.js';
import { pictureFilm } from './picture_film.js';
import { film, plane } from './plane.js';
import { picture, table } from './plain.js';
import { lines } from './plots.js';
import { saveButton } from './save.js';
import { startTheme, toggleTheme } from './theme.js';
import { explained } from './words.js';

const kinds = {
  lines: { draw: lines, empty: (panel) => panel.curves.length + panel.bands.length === 0 || panel.x_values.length === 0 },
  plane: { draw: plane, empty: (panel) => panel.curves.every((curve) => curve.x.length === 0) },
  film: { draw: film, empty: (panel) => panel.frames.length === 0 },
  heat: { draw: heat, empty: (panel) => panel.values.length === 0 },
  picture: { draw: picture, empty: (panel) => panel.png === '' },
  picture_film: { draw: pictureFilm, empty: (panel) => panel.frames.length === 0 },
  table: { draw: table, empty: (panel) => panel.rows.length === 0 },
  cloud: { draw: cloud, empty: (panel) => panel.points === '' && panel.curves.every((curve) => curve.points === '') },
};

function head(data) {
  const button = element('button', { type: 'button', title: 'Switch between light and dark' }, 'light / dark');
  button.addEventListener('click', toggleTheme);
  return element('header', {}, element('div', {}, element('h1', {}, data.title), element('p', {}, data.subtitle)),
    data.live ? follow(data.live) : null, button);
}

/** Verdicts are said in words as well: colours are not for everybody. */
const verdicts = { none: null, good: 'ok', bad: 'wrong' };

function figures(data) {
  const cells = data.figures.map((figure) => element('div', { className: `figure ${figure.verdict}` },
    element('dt', {}, figure.label),
    element('dd', {}, figure.value, figure.unit ? element('small', {}, figure.unit) : null,
      verdicts[figure.verdict] ? element('b', {}, verdicts[figure.verdict]) : null),
    figure.hint ? element('dd', { className: 'hint' }, figure.hint) : null));
  return element('dl', { className: 'figures' }, ...cells);
}

function notes(data) {
  if (data.notes.length === 0) return null;
  return element('ul', { className: 'notes' }, ...data.notes.map((note) => element('li', {}, note)));
}

/** What is on the page, for one that is longer than a screen. */
function contents(data) {
  if (data.panels.length < 3) return null;
  const links = data.panels.map((panel, i) => element('li', {}, element('a', { href: `#figure-${i + 1}` }, panel.title)));
  return element('nav', { className: 'contents', ariaLabel: 'Contents' }, element('ol', {}, ...links));
}

function show(panel, number, grid) {
  const body = element('div', { className: 'body' });
  const card = element('section', { className: panel.wide ? 'panel wide' : panel.third ? 'panel third' : 'panel', id: `figure-${number}` },
    element('h2', { id: `title-${number}` }, panel.title), panel.caption ? element('p', {}, panel.caption) : null, body);
  card.setAttribute('aria-labelledby', `title-${number}`);
  grid.append(card);
  const kind = kinds[panel.kind];
  if (kind.empty(panel)) {
    if (panel.caption === '') body.append(element('div', { className: 'empty' }, 'nothing to show'));
    return;
  }
  kind.draw(panel, body);
  for (const canvas of body.querySelectorAll('canvas:not([role])')) {
    canvas.setAttribute('role', 'img');
    canvas.setAttribute('aria-label', panel.title);
  }
  const save = saveButton(panel, body);
  if (save) card.prepend(save);
}

startTheme();
const data = JSON.parse(document.getElementById('data').textContent);
const page = document.getElementById('page');
const grid = element('div', { className: 'panels' });
page.append(...[head(data), figures(data), notes(data), contents(data), grid].filter((part) => part !== null));
data.panels.forEach((panel, i) => show(panel, i + 1, grid));
page.append(explained(page) ?? '');
// ?figure=2 shows the second figure and nothing else: for pictures of it (docs/site).
const only = document.getElementById(`figure-${new URLSearchParams(location.search).get('figure')}`);
if (only) {
  document.documentElement.dataset.only = '';
  only.classList.add('only');
}
// A test reads this: every panel was drawn and nothing was thrown on the way.
document.documentElement.dataset.panels = data.panels.length;
