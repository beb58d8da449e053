// A table of numbers as colours.
import { element, labelled, readable } from './dom.js';
import { diverging, gradient, mixed, viridis } from './ramps.js';

/** Smallest and largest value; the same on both sides of zero where the colours diverge. */
function rangeOf(panel) {
  const finite = panel.values.filter((value) => value !== null);
  if (finite.length === 0) return [0, 1];
  const low = finite.reduce((a, b) => Math.min(a, b));
  const high = finite.reduce((a, b) => Math.max(a, b));
  if (!panel.diverging) return [low, high];
  const reach = Math.max(Math.abs(low), Math.abs(high));
  return [-reach, reach];
}

function paint(canvas, panel, ramp, [low, high]) {
  const image = new ImageData(panel.columns, panel.rows);
  panel.values.forEach((value, i) => {
    const colour = value === null ? [128, 128, 128] : mixed(ramp, high > low ? (value - low) / (high - low) : 0.5);
    image.data.set([...colour, 255], 4 * i);
  });
  canvas.getContext('2d').putImageData(image, 0, 0);
}

export function heat(panel, body) {
  const ramp = panel.diverging ? diverging : viridis;
  const range = rangeOf(panel);
  const canvas = element('canvas', { width: panel.columns, height: panel.rows, ariaLabel: panel.title });
  canvas.setAttribute('role', 'img');
  paint(canvas, panel, ramp, range);

  const pointed = element('span', { className: 'pointed' }, 'point at a cell to read it');
  const value = (cell) => (panel.value.unit ? `${readable(cell)} ${panel.value.unit}` : readable(cell));
  canvas.addEventListener('pointermove', (event) => {
    const column = Math.min(Math.floor((event.offsetX / canvas.clientWidth) * panel.columns), panel.columns - 1);
    const row = Math.min(Math.floor((event.offsetY / canvas.clientHeight) * panel.rows), panel.rows - 1);
    if (column < 0 || row < 0) return;
    pointed.textContent = `row ${row}, column ${column}: ${value(panel.values[row * panel.columns + column])}`;
  });
  const scale = element('span', { className: 'scale' }, `${labelled(panel.value)} ${readable(range[0])}`,
    element('i', { style: { background: gradient(ramp) } }), readable(range[1]));
  body.append(
    element('div', { className: 'heat' }, element('span', { className: 'up' }, labelled(panel.y)), canvas,
      element('span', {}), element('span', { className: 'along' }, labelled(panel.x))),
    element('div', { className: 'bar' }, pointed, element('span', { className: 'spread' }), scale),
  );
}
