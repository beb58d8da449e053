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
  if (size !== 0 && (size < 1e-3 || size >= 1e6)) return value.toExponential(2);
  return String(Number(value.toPrecision(4)));
}

/** Calls change(width, height) at the next frame and whenever the node's width or height has changed. */
export function onResize(node, change) {
  let last = '';
  // Not inside the observer: what it changes would set it off again.
  new ResizeObserver(() => requestAnimationFrame(() => {
    const size = `${node.clientWidth} ${node.clientHeight}`;
    if (node.clientWidth === 0 || size === last) return;
    last = size;
    change(node.clientWidth, node.clientHeight);
  })).observe(node);
}

/** A legend entry that switches something on and off. */
export function switchable(name, ink, toggle, shape = '') {
  const box = element('input', { type: 'checkbox', checked: true });
  box.addEventListener('change', () => toggle(box.checked));
  return element('label', { className: 'key', style: { '--ink': `var(--${ink})` } }, box, element('i', { className: shape }), name);
}
