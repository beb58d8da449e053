// Plots with uPlot: curves over a common axis, and curves in a plane with equal scales.
import uPlot from 'uplot';
import { colour, element, labelled, onResize, readable, switchable } from './dom.js';
import { onTheme } from './theme.js';

const pairing = uPlot.sync('common axis');

function axisOptions(axis) {
  return {
    label: labelled(axis),
    labelSize: 22,
    labelFont: '13px system-ui, sans-serif',
    font: '12px system-ui, sans-serif',
    size: (plot, values) => axisSize(plot, values),
    stroke: () => colour('soft'),
    grid: { stroke: () => colour('grid'), width: 1 },
    ticks: { stroke: () => colour('grid'), width: 1, size: 5 },
    values: (_, ticks) => ticks.map((tick) => (tick === null ? '' : readable(tick))),
  };
}

function axisSize(plot, values) {
  if (!values) return 44;
  const longest = values.reduce((length, value) => Math.max(length, value.length), 0);
  return 16 + 7 * longest;
}

function horizontal(axis) {
  return { ...axisOptions(axis), size: 34, space: 60 };
}

/** 1, 2 and 5 times the powers of ten from low to high. */
function logarithmicTicks(_, __, low, high) {
  const ticks = [];
  for (let power = Math.floor(Math.log10(low)); 10 ** power <= high; ++power)
    ticks.push(...[1, 2, 5].map((factor) => factor * 10 ** power).filter((tick) => tick >= low && tick <= high));
  return ticks;
}

function logarithmic(axis) {
  return { ...horizontal(axis), splits: logarithmicTicks, filter: (_, ticks) => ticks };
}

/** Positive values only, for a logarithmic axis. */
function positive(values) {
  return values.map((value) => (value > 0 ? value : null));
}

/** Linear axes keep a little air and never collapse where all values are equal. */
function linearRange(_, low, high) {
  if (low === null) return [0, 1];
  if (low === high) return low === 0 ? [0, 1] : [low - 0.5 * Math.abs(low), high + 0.5 * Math.abs(high)];
  const air = 0.06 * (high - low);
  return [low >= 0 && low < 0.4 * high ? 0 : low - air, high + air];
}

export function lines(panel, body) {
  const values = panel.curves.map((curve) => (panel.logarithmic ? positive(curve.values) : curve.values));
  const options = {
    width: 600,
    height: panel.wide ? 280 : 260,
    scales: {
      x: panel.logarithmic_x ? { time: false, distr: 3, range: (_, low, high) => [low, high] } : { time: false },
      y: panel.logarithmic ? { distr: 3 } : { range: linearRange },
    },
    axes: [panel.logarithmic_x ? logarithmic(panel.x) : horizontal(panel.x), axisOptions(panel.y)],
    cursor: { sync: { key: pairing.key, setSeries: false }, focus: { prox: 30 }, points: { size: 6 } },
    series: [
      { label: labelled(panel.x), value: (_, value) => readable(value) },
      ...panel.curves.map((curve) => ({
        label: curve.name,
        stroke: () => colour(curve.ink),
        width: 1.6,
        dash: curve.dashed ? [6, 5] : undefined,
        points: { show: panel.x_values.length === 1 },
        value: (_, value) => readable(value),
      })),
    ],
  };
  const place = element('div');
  body.append(place);
  const plot = new uPlot(options, [panel.x_values, ...values], place);
  onResize(place, (width) => plot.setSize({ width, height: options.height }));
  onTheme(() => plot.redraw(false));
}

/** Smallest box around all curves. */
function boundsOf(curves) {
  const bounds = { x: [Infinity, -Infinity], y: [Infinity, -Infinity] };
  for (const curve of curves)
    for (const side of ['x', 'y'])
      for (const value of curve[side])
        if (value !== null) bounds[side] = [Math.min(bounds[side][0], value), Math.max(bounds[side][1], value)];
  return bounds;
}

/** Draws one curve of a plane plot; uPlot's own paths want a common axis. */
function drawCurve(plot, index) {
  const curve = plot.curves[index - 1];
  const { ctx } = plot;
  const pixel = devicePixelRatio;
  ctx.save();
  ctx.beginPath();
  ctx.rect(plot.bbox.left, plot.bbox.top, plot.bbox.width, plot.bbox.height);
  ctx.clip();
  ctx.lineJoin = 'round';
  ctx.lineCap = 'round';
  // The truth lies below the estimate and still shows where the two agree.
  ctx.lineWidth = (curve.dots ? 5 : curve.ink === 'truth' ? 4 : 1.8) * pixel;
  ctx.strokeStyle = colour(curve.ink);
  ctx.globalAlpha = curve.dots ? 0.7 : 1;
  ctx.beginPath();
  let down = false;
  curve.x.forEach((value, i) => {
    if (value === null || curve.y[i] === null) {
      down = false;
      return;
    }
    const x = plot.valToPos(value, 'x', true);
    const y = plot.valToPos(curve.y[i], 'y', true);
    if (curve.dots) {
      ctx.moveTo(x, y);
      ctx.lineTo(x + 0.01, y);
    } else if (down) ctx.lineTo(x, y);
    else ctx.moveTo(x, y);
    down = true;
  });
  ctx.stroke();
  ctx.restore();
  return null;
}

/** Shows the bounds at one scale for both sides, in the room that the axes have left over. */
function fitEqual(plot, bounds) {
  const room = { x: plot.bbox.width, y: plot.bbox.height };
  const span = (side) => 1.08 * Math.max(bounds[side][1] - bounds[side][0], 1e-3);
  const unitsPerPixel = Math.max(span('x') / room.x, span('y') / room.y);
  plot.batch(() => {
    for (const side of ['x', 'y']) {
      const centre = (bounds[side][0] + bounds[side][1]) / 2;
      const half = (unitsPerPixel * room[side]) / 2;
      plot.setScale(side, { min: centre - half, max: centre + half });
    }
  });
}

export function plane(panel, body) {
  // Dots wander off far; the picture is framed by the lines where there are any.
  const drawn = panel.curves.filter((curve) => !curve.dots && curve.x.length > 0);
  const bounds = boundsOf(drawn.length > 0 ? drawn : panel.curves);
  const height = panel.wide ? 520 : 420;
  const options = {
    mode: 2,
    width: 600,
    height,
    scales: { x: { time: false, auto: false, range: bounds.x }, y: { auto: false, range: bounds.y } },
    axes: [horizontal(panel.x), axisOptions(panel.y)],
    legend: { show: false },
    cursor: { drag: { x: false, y: false }, points: { show: false } },
    series: [null, ...panel.curves.map((curve) => ({ label: curve.name, stroke: () => colour(curve.ink), paths: drawCurve }))],
    hooks: { init: [(plot) => (plot.curves = panel.curves)] },
  };
  const place = element('div');
  body.append(place);
  const plot = new uPlot(options, [null, ...panel.curves.map((curve) => [curve.x, curve.y])], place);
  onResize(place, (width) => {
    plot.setSize({ width, height });
    // Twice: numbers of another length leave another room.
    fitEqual(plot, bounds);
    fitEqual(plot, bounds);
  });
  onTheme(() => plot.redraw(false));
  body.append(
    element('div', { className: 'bar' }, ...panel.curves.map((curve, i) =>
      switchable(curve.name, curve.ink, (show) => plot.setSeries(i + 1, { show }), curve.dots ? 'dots' : ''))),
  );
}
