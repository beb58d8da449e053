// Small helpers: elements, colours of the page, packed numbers.

/** An element with properties and children; text goes in as text, never as HTML. */
export function element(tag, properties = {}, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (name === 'style') for (const [key, setting] of Object.entries(value)) node.style.setProperty(key, setting);
    else if (name in node) node[name] = value;
    else node.setAttribute(name, value);
  }
  node.append(...children.filter((child) => child !== null && child !== undefined));
  return node;
}

/** The colour that the page's theme gives to a name such as "belief". */
export function colour(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
}

/** Float32Array of a base64 text of little-endian bytes. */
export function floats(packed) {
  const bytes = Uint8Array.from(atob(packed), (letter) => letter.charCodeAt(0));
  const view = new DataView(bytes.buffer);
  return Float32Array.from({ length: bytes.length / 4 }, (_, i) => view.getFloat32(4 * i, true));
}

/** "error [m]", or "frames" where there is no unit. */
export function labelled({ label, unit }) {
  return unit ? `${label} [${unit}]` : label;
}

/** At most four significant digits, without trailing zeros. */
export function readable(value) {
  if (value === null || value === undefined || Number.isNaN(value)) return '–';
  const size = Math.abs(value);
  if (size !== 0 && (size < 1e-4 || size >= 1e6)) return value.toExponential(2).replace(/\.?0+e/, 'e').replace('e+', 'e');
  return String(Number(value.toPrecision(4)));
}

/** Calls change(width, height) now, and at the next frame whenever the node's width or height has changed. */
export function onResize(node, change) {
  let last = '';
  const apply = () => {
    const size = `${node.clientWidth} ${node.clientHeight}`;
    if (node.clientWidth === 0 || size === last) return;
    last = size;
    change(node.clientWidth, node.clientHeight);
  };
  apply();
  // Not inside the observer: what it changes would set it off again.
  new ResizeObserver(() => requestAnimationFrame(apply)).observe(node);
}

/** Lines are told apart by their dashes too: not everybody sees the colours. */
const inkDashes = { measurement: [3, 4], wrong: [11, 4, 3, 4], grey: [5, 3], teal: [13, 5], violet: [7, 3, 2, 3, 2, 3] };

/** The dashes of a line of this ink among `count` lines. */
export function dashesOf(curve, count) {
  if (curve.dashed) return [7, 6];
  return count > 1 ? (inkDashes[curve.ink] ?? []) : [];
}

const svgSpace = 'http://www.w3.org/2000/svg';

/** A piece of a line, as legends show it. */
export function sample(dashes) {
  const svg = document.createElementNS(svgSpace, 'svg');
  const line = document.createElementNS(svgSpace, 'line');
  for (const [name, value] of Object.entries({ width: 30, height: 8, 'aria-hidden': 'true' })) svg.setAttribute(name, value);
  for (const [name, value] of Object.entries({ x1: 0, x2: 30, y1: 4, y2: 4, 'stroke-width': 3, 'stroke-dasharray': dashes.join(' ') }))
    line.setAttribute(name, value);
  line.style.stroke = 'var(--ink)';
  svg.append(line);
  return svg;
}

/** A legend entry that switches something on and off. `shape`: a class of page.css, or the dashes of a line. */
export function switchable(name, ink, toggle, shape = []) {
  const box = element('input', { type: 'checkbox', checked: true });
  box.addEventListener('change', () => toggle(box.checked));
  const sign = Array.isArray(shape) ? sample(shape) : element('i', { className: shape });
  return element('label', { className: 'key', style: { '--ink': `var(--${ink})` } }, box, sign, name);
}
