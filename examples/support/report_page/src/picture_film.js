// Pictures with marks that change along a slider: a map that grows, say.
import { element, floats, readable, switchable } from './dom.js';
import { pathOfPoints, pathOfSegments, svgPath, svgSpace } from './plain.js';
import { playButton } from './plane.js';

function group(marks) {
  const node = document.createElementNS(svgSpace, 'g');
  node.style.setProperty('--ink', `var(--${marks.ink})`);
  node.append(svgPath(pathOfSegments(floats(marks.segments)), 1.2), svgPath(pathOfPoints(floats(marks.points)), 4.5));
  return node;
}

export function pictureFilm(panel, body) {
  const slider = element('input', { type: 'range', min: 0, max: panel.frames.length - 1, step: 1, value: panel.start, ariaLabel: panel.slider.label });
  const place = element('output');
  const caption = element('p', { className: 'frame' });
  const image = element('img', { alt: panel.title, width: panel.width, height: panel.height });
  const svg = document.createElementNS(svgSpace, 'svg');
  svg.setAttribute('viewBox', `-0.5 -0.5 ${panel.width} ${panel.height}`); // centres of pixels are integers
  svg.setAttribute('preserveAspectRatio', 'none');

  const hidden = new Set();
  const apply = () => {
    const frame = panel.frames[slider.value];
    const { label, unit } = panel.slider;
    place.textContent = `${label} ${readable(frame.at)}${unit ? ` ${unit}` : ''}`;
    slider.setAttribute('aria-valuetext', place.textContent);
    caption.textContent = frame.caption;
    image.src = `data:image/png;base64,${frame.png}`;
    svg.replaceChildren(...frame.marks.filter((marks) => !hidden.has(marks.name)).map(group));
  };
  const names = [...new Map(panel.frames.flatMap((frame) => frame.marks).map((marks) => [marks.name, marks])).values()];
  const keys = names.map((marks) => switchable(marks.name, marks.ink, (show) => {
    if (show) hidden.delete(marks.name);
    else hidden.add(marks.name);
    apply();
  }));
  slider.addEventListener('input', apply);
  body.append(element('div', { className: 'film' }, playButton(slider), slider, place), caption,
    element('div', { className: 'picture' }, image, svg), element('div', { className: 'bar onpicture' }, ...keys));
  apply();
}
