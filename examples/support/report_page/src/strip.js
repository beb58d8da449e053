// What films have in common: a slider with a button that moves it, where it stands, and what is said of that place.
import { element, readable } from './dom.js';

/** Moves the slider on by itself, a whole film in about eight seconds, while the button is pressed. */
function playButton(slider) {
  const button = element('button', { type: 'button' }, '▶ play');
  let timer = 0;
  const stop = () => {
    clearInterval(timer);
    timer = 0;
    button.textContent = '▶ play';
  };
  const go = (to) => {
    slider.value = to;
    slider.dispatchEvent(new Event('input'));
  };
  button.addEventListener('click', () => {
    if (timer !== 0) return stop();
    const last = Number(slider.max);
    if (Number(slider.value) === last) go(0);
    button.textContent = '❚❚ pause';
    timer = setInterval(() => {
      if (Number(slider.value) < last) go(Number(slider.value) + 1);
      else stop();
    }, Math.min(Math.max(8000 / (last + 1), 40), 600));
  });
  slider.addEventListener('pointerdown', stop);
  return button;
}

/** Puts the slider over the panel's frames and their captions into body. show(frame) is called when it moves, and by what is returned. */
export function strip(panel, body, show) {
  const slider = element('input', { type: 'range', min: 0, max: panel.frames.length - 1, step: 1, value: panel.start, ariaLabel: panel.slider.label });
  const place = element('output');
  const caption = element('p', { className: 'frame' });
  body.append(element('div', { className: 'film' }, playButton(slider), slider, place), caption);
  const apply = () => {
    const frame = panel.frames[slider.value];
    const { label, unit } = panel.slider;
    place.textContent = `${label} ${readable(frame.at)}${unit ? ` ${unit}` : ''}`;
    slider.setAttribute('aria-valuetext', place.textContent);
    caption.textContent = frame.caption;
    show(frame);
  };
  slider.addEventListener('input', apply);
  return apply;
}
