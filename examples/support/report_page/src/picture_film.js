// Pictures with marks that change along a slider: a map that grows, say.
import { element, floats, switchable } from './dom.js';
import { pathOfPoints, pathOfSegments, svgPath, svgSpace } from './plain.js';
import { strip } from './strip.js';

function group(marks) {
  const node = document.createElementNS(svgSpace, 'g');
  node.style.setProperty('--ink', `var(--${marks.ink})`);
  node.append(svgPath(pathOfSegments(floats(marks.segments)), 1.2), svgPath(pathOfPoints(floats(marks.points)), 4.5));
  return node;
}

export function pictureFilm(panel, body) {
  const image = element('img', { alt: panel.title, width: panel.width, height: panel.height });
  const svg = document.createElementNS(svgSpace, 'svg');
  svg.setAttribute('viewBox', `-0.5 -0.5 ${panel.width} ${panel.height}`); // centres of pixels are integers
  svg.setAttribute('preserveAspectRatio', 'none');

  const hidden = new Set();
  const apply = strip(panel, body, (frame) => {
    image.src = `data:image/png;base64,${frame.png}`;
    svg.replaceChildren(...frame.marks.filter((marks) => !hidden.has(marks.name)).map(group));
  });
  const names = [...new Map(panel.frames.flatMap((frame) => frame.marks).map((marks) => [marks.name, marks])).values()];
  const keys = names.map((marks) => switchable(marks.name, marks.ink, (show) => {
    if (show) hidden.delete(marks.name);
    else hidden.add(marks.name);
    apply();
  }));
  body.append(element('div', { className: 'picture' }, image, svg), element('div', { className: 'bar onpicture' }, ...keys));
  apply();
}
