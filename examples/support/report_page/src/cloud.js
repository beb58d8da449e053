// Points and lines in space with three, z up. Drawn when something changes, not all the time.
import {
  BufferAttribute, BufferGeometry, Color, GridHelper, PerspectiveCamera, Points, PointsMaterial, Scene, TOUCH, Vector3, WebGLRenderer,
} from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';
import { Line2 } from 'three/addons/lines/Line2.js';
import { LineGeometry } from 'three/addons/lines/LineGeometry.js';
import { LineMaterial } from 'three/addons/lines/LineMaterial.js';
import { colour, element, floats, onResize, readable, switchable } from './dom.js';
import { gradient, viridis } from './ramps.js';
import { onTheme } from './theme.js';

const ramp = viridis.map((hex) => new Color(hex));

function rampColour(share, target) {
  const place = Math.min(Math.max(share, 0), 1) * (ramp.length - 1);
  const below = Math.min(Math.floor(place), ramp.length - 2);
  return target.lerpColors(ramp[below], ramp[below + 1], place - below);
}

/** The value that this share of the finite numbers lies below. */
function quantile(numbers, share) {
  const sorted = Float32Array.from(numbers.filter(Number.isFinite)).sort();
  return sorted.length === 0 ? 0 : sorted[Math.round(share * (sorted.length - 1))];
}

/** Colours of the points; grey levels are kept apart from the background of the theme. */
function paint(colours, colouring, values) {
  const mixed = new Color();
  const dark = document.documentElement.dataset.theme === 'dark';
  const [low, high] = colouring.grey ? [0, 255] : [quantile(values, 0.02), quantile(values, 0.98)];
  values.forEach((value, i) => {
    const share = high > low ? (value - low) / (high - low) : 0.5;
    if (colouring.grey) mixed.setScalar(dark ? 0.08 + 0.92 * share * share : 0.6 * share * share);
    else rampColour(share, mixed);
    mixed.toArray(colours.array, 3 * i);
  });
  colours.needsUpdate = true;
  return [low, high];
}

/** The box of what matters, the bulk of the points and every line, its middle and radius. */
function frameOf(positions, curves) {
  const low = new Vector3();
  const high = new Vector3();
  for (const [i, axis] of ['x', 'y', 'z'].entries()) {
    const own = positions.filter((_, k) => k % 3 === i);
    const bounds = own.length > 0 ? [quantile(own, 0.03), quantile(own, 0.97)] : [Infinity, -Infinity];
    for (const curve of curves)
      for (let k = i; k < curve.length; k += 3) {
        bounds[0] = Math.min(bounds[0], curve[k]);
        bounds[1] = Math.max(bounds[1], curve[k]);
      }
    low[axis] = Number.isFinite(bounds[0]) ? bounds[0] : -1;
    high[axis] = Number.isFinite(bounds[1]) ? bounds[1] : 1;
  }
  const middle = low.clone().add(high).multiplyScalar(0.5);
  return { middle, low, high, radius: Math.max(0.5 * low.distanceTo(high), 0.1) };
}

/** 1, 2 or 5 times a power of ten, about a tenth of the span. */
function roundStep(span) {
  const power = 10 ** Math.floor(Math.log10(span / 10));
  return [1, 2, 5, 10].map((factor) => factor * power).find((step) => step >= span / 10);
}

class View {
  constructor(panel, canvas) {
    this.renderer = new WebGLRenderer({ canvas, antialias: true });
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.scene = new Scene();
    this.camera = new PerspectiveCamera(45, 1, 0.01, 1e5);
    this.camera.up.set(0, 0, 1);
    this.positions = floats(panel.points);
    this.curves = panel.curves.map((curve) => ({ ...curve, points: floats(curve.points) }));
    this.frame = frameOf(this.positions, this.curves.map((curve) => curve.points));
    this.addPoints();
    this.addCurves();
    this.addControls(canvas);
    this.look(-0.55, -0.75, 0.7);
  }

  addPoints() {
    const geometry = new BufferGeometry();
    geometry.setAttribute('position', new BufferAttribute(this.positions, 3));
    this.colours = new BufferAttribute(new Float32Array(this.positions.length).fill(0.5), 3);
    geometry.setAttribute('color', this.colours);
    this.points = new Points(geometry, new PointsMaterial({ size: 2.6, sizeAttenuation: false, vertexColors: true }));
    this.points.frustumCulled = false;
    this.scene.add(this.points);
  }

  addCurves() {
    for (const curve of this.curves) {
      if (curve.points.length < 6) continue;
      const geometry = new LineGeometry();
      geometry.setPositions(curve.points);
      curve.line = new Line2(geometry, new LineMaterial({ linewidth: curve.ink === 'truth' ? 4.5 : 2.2 }));
      curve.line.frustumCulled = false;
      // Where the two agree the estimate is drawn over the broader truth.
      curve.line.material.depthWrite = curve.ink !== 'truth';
      curve.line.renderOrder = curve.ink === 'truth' ? 1 : 2;
      this.scene.add(curve.line);
    }
  }

  addControls(canvas) {
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.zoomToCursor = true;
    // The wheel scrolls the page until the reader has taken hold of the view.
    this.controls.enableZoom = false;
    canvas.addEventListener('pointerdown', () => (this.controls.enableZoom = true));
    canvas.addEventListener('pointerleave', () => (this.controls.enableZoom = false));
    this.controls.addEventListener('change', () => this.draw());
    this.controls.addEventListener('start', () => (this.direction = null));
    // One finger scrolls the page, two turn and zoom.
    this.controls.touches = { ONE: null, TWO: TOUCH.DOLLY_ROTATE };
    canvas.style.touchAction = 'pan-y';
    canvas.addEventListener('beforesave', () => this.drawNow());
  }

  /** From the direction (x, y, z), everything in view, until the reader takes hold of it. */
  look(x, y, z) {
    this.direction = new Vector3(x, y, z).normalize();
    this.fit();
  }

  /** As near as the corners of the box allow: what is flat or long would be small in the view of its sphere. */
  fit() {
    const { middle, low, high, radius } = this.frame;
    const right = new Vector3().crossVectors(this.camera.up, this.direction).normalize();
    const upwards = new Vector3().crossVectors(this.direction, right);
    const tangent = Math.tan((this.camera.fov * Math.PI) / 360);
    let distance = radius;
    for (let i = 0; i < 8; ++i) {
      const corner = new Vector3(i & 1 ? high.x : low.x, i & 2 ? high.y : low.y, i & 4 ? high.z : low.z).sub(middle);
      const aside = Math.max(Math.abs(corner.dot(right)) / this.camera.aspect, Math.abs(corner.dot(upwards)));
      distance = Math.max(distance, corner.dot(this.direction) + (1.05 * aside) / tangent);
    }
    this.camera.position.copy(middle).addScaledVector(this.direction, distance);
    this.camera.near = radius / 500;
    this.camera.far = 200 * radius;
    this.camera.updateProjectionMatrix();
    this.controls.target.copy(middle);
    this.controls.update();
    this.draw();
  }

  applyTheme() {
    this.scene.background = new Color(colour('cloud'));
    for (const curve of this.curves) curve.line?.material.color.set(colour(curve.ink));
    if (this.grid) this.scene.remove(this.grid);
    const { middle, low, radius } = this.frame;
    this.step = roundStep(2 * radius);
    const cells = 2 * Math.ceil((1.4 * radius) / this.step);
    this.grid = new GridHelper(cells * this.step, cells, colour('grey'), colour('edge'));
    this.grid.rotation.x = Math.PI / 2;
    this.grid.position.set(this.step * Math.round(middle.x / this.step), this.step * Math.round(middle.y / this.step), low.z);
    this.scene.add(this.grid);
  }

  resize(width, height) {
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    if (this.direction) this.fit();
    this.draw();
  }

  draw() {
    if (this.pending) return;
    this.pending = true;
    requestAnimationFrame(() => {
      this.pending = false;
      this.drawNow();
    });
  }

  drawNow() {
    this.renderer.render(this.scene, this.camera);
  }
}

function newView(panel, canvas) {
  try {
    return new View(panel, canvas);
  } catch (problem) {
    if (!/webgl/i.test(String(problem))) throw problem;
    return null;
  }
}

/** The choice of what the colours mean, with its scale. */
function colourBar(panel, view) {
  const columns = panel.colourings.map((colouring) => floats(colouring.values));
  const scale = element('span', { className: 'scale' });
  const choice = element('select', { ariaLabel: 'Colour of the points' },
    ...panel.colourings.map((colouring, i) => element('option', { value: i }, colouring.name)));
  const apply = () => {
    const colouring = panel.colourings[choice.value];
    if (!colouring) return;
    const [low, high] = paint(view.colours, colouring, columns[choice.value]);
    const colours = gradient(colouring.grey ? ['black', 'white'] : viridis);
    scale.replaceChildren(readable(low), element('i', { style: { background: colours } }),
      `${readable(high)}${colouring.unit ? ` ${colouring.unit}` : ''}`);
    view.draw();
  };
  choice.addEventListener('change', apply);
  return { apply, nodes: panel.colourings.length > 0 ? [choice, scale] : [] };
}

export function cloud(panel, body) {
  const canvas = element('canvas');
  const help = element('span', { className: 'help' });
  const place = element('div', { className: 'cloud' }, canvas, help);
  body.append(place);
  const view = newView(panel, canvas);
  if (view === null) {
    place.replaceWith(element('div', { className: 'empty' }, 'This browser has no WebGL: the view in space cannot be drawn.'));
    return;
  }
  const colours = colourBar(panel, view);
  const restyle = () => {
    view.applyTheme();
    colours.apply();
    view.draw();
    const how = matchMedia('(pointer: coarse)').matches ? 'two fingers turn and zoom' : 'drag to turn, right button to move, wheel to zoom';
    help.textContent = `${how} · grid ${readable(view.step)} ${panel.unit}`;
  };
  restyle();
  onTheme(restyle);
  onResize(place, (width, height) => view.resize(width, height));

  const button = (name, ...direction) => {
    const node = element('button', { type: 'button' }, name);
    node.addEventListener('click', () => view.look(...direction));
    return node;
  };
  const keys = view.curves.map((curve) => switchable(curve.name, curve.ink, (show) => {
    if (curve.line) curve.line.visible = show;
    view.draw();
  }));
  const points = switchable(`points (${view.positions.length / 3})`, 'grey', (show) => {
    view.points.visible = show;
    view.draw();
  }, 'dots');
  body.append(element('div', { className: 'bar' }, points, ...keys, element('span', { className: 'spread' }), ...colours.nodes,
    button('oblique', -0.55, -0.75, 0.7), button('top', 0, -0.001, 1), button('side', 0, -1, 0.05)));
}
