// Panels that need no library: pictures with marks, tables.
import { element, floats, switchable } from './dom.js';

export const svgSpace = 'http://www.w3.org/2000/svg';

export function svgPath(data, width) {
  const path = document.createElementNS(svgSpace, 'path');
  path.setAttribute('d', data);
  path.setAttribute('stroke-width', width);
  return path;
}

export function pathOfPoints(numbers) {
  let data = '';
  for (let i = 0; i < numbers.length; i += 2) data += `M${numbers[i].toFixed(1)} ${numbers[i + 1].toFixed(1)}h0`;
  return data;
}

export function pathOfSegments(numbers) {
  let data = '';
  for (let i = 0; i < numbers.length; i += 4)
    data += `M${numbers[i].toFixed(1)} ${numbers[i + 1].toFixed(1)}L${numbers[i + 2].toFixed(1)} ${numbers[i + 3].toFixed(1)}`;
  return data;
}

export function picture(panel, body) {
  const svg = document.createElementNS(svgSpace, 'svg');
  svg.setAttribute('viewBox', `-0.5 -0.5 ${panel.width} ${panel.height}`); // centres of pixels are integers
  svg.setAttribute('preserveAspectRatio', 'none');
  const keys = panel.marks.map((marks) => {
    const group = document.createElementNS(svgSpace, 'g');
    group.style.setProperty('--ink', `var(--${marks.ink})`);
    group.append(svgPath(pathOfSegments(floats(marks.segments)), 1.2), svgPath(pathOfPoints(floats(marks.points)), 4.5));
    svg.append(group);
    return switchable(`${marks.name} (${marks.count})`, marks.ink, (show) => (group.style.display = show ? '' : 'none'), 'dots');
  });
  const image = element('img', { alt: panel.title, width: panel.width, height: panel.height, src: `data:image/png;base64,${panel.png}` });
  body.append(element('div', { className: 'picture' }, image, svg), element('div', { className: 'bar onpicture' }, ...keys));
}

export function table(panel, body) {
  const numeric = panel.columns.map((_, column) =>
    panel.rows.length > 0 && panel.rows.every((row) => ['', '-'].includes(row[column]) || Number.isFinite(Number(row[column]))));
  const line = (tag, cells) => element('tr', {}, ...cells.map((cell, i) => element(tag, { className: numeric[i] ? 'number' : '' }, cell)));
  // What scrolls sideways on a phone can be reached by the keyboard.
  body.append(element('div', { className: 'scroll', tabIndex: 0, role: 'group', ariaLabel: panel.title },
    element('table', { className: 'cells' },
      element('thead', {}, line('th', panel.columns)),
      element('tbody', {}, ...panel.rows.map((row) => line('td', row))))));
}
