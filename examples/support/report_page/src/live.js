// A page of a run that goes on: loads the next one when the server (live_page.hpp) has it, unless the reader holds this one.
import { element } from './dom.js';

/** The switch in the page's head; `version` is this page's. The browser keeps the place in the page when it loads anew. */
export function follow(version) {
  const state = element('span', { className: 'live', role: 'status' }, 'live');
  const hold = element('button', { type: 'button', ariaPressed: 'false', title: 'Keep this page as it is while the run goes on' }, 'hold');
  let held = false;
  let pressed = false;  // a slider or a view is being moved
  hold.addEventListener('click', () => {
    held = !held;
    hold.setAttribute('aria-pressed', String(held));
    state.textContent = held ? 'held' : 'live';
  });
  addEventListener('pointerdown', () => { pressed = true; });
  for (const end of ['pointerup', 'pointercancel']) addEventListener(end, () => { pressed = false; });
  const ask = async () => {
    try {
      const newest = Number(await (await fetch('version', { cache: 'no-store' })).text());
      if (newest > version && !held && !pressed) location.reload();
      else setTimeout(ask, 1000);
    } catch {
      state.className = 'live ended';
      state.textContent = 'the program has ended; its folder has the finished report';
      hold.remove();
    }
  };
  setTimeout(ask, 1000);
  return element('div', { className: 'follow' }, state, hold);
}
