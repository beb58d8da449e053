// Curves in a plane, still or along a slider. uPlot draws the axes; its own paths want a common axis, so the curves are ours.
import uPlot from 'uplot';
import { colour, dashesOf, element, onResize, switchable } from './dom.js';
import { axisOptions, horizontal } from './plots.js';
import { strip } from './strip.js';
import { onTheme } from './theme.js';

/** Smallest box around all curves. */
function boundsOf(curves) {
  const bounds = { x: [Infinity, -Infinity], y: [Infinity, -Infinity] };
  for (const curve of curves)
    for (const side of ['x', 'y'])
      for (const value of curve[side])
        if (value !== null) bounds[side] = [Math.min(bounds[side][0], value), Math.max(bounds[side][1], value)];
  return bounds;
}

/** Dots wander off far; the picture is framed by the lines where there are any. */
function frameOf(curves) {
  const drawn = curves.filter((curve) => !curve.dots && curve.x.length > 0);
  return boundsOf(drawn.length > 0 ? drawn : curves);
}

/** The curve as a path; dots are lines of no length with round ends. */
function trace(plot, curve) {
  let down = false;
  plot.ctx.beginPath();
  curve.x.forEach((value, i) => {
    if (value === null || curve.y[i] === null) {
      down = false;
      return;
    }
    const x = plot.valToPos(value, 'x', true);
    const y = plot.valToPos(curve.y[i], 'y', true);
    if (curve.dots) {
      plot.ctx.moveTo(x, y);
      plot.ctx.lineTo(x + 0.01, y);
    } else if (down) plot.ctx.lineTo(x, y);
    else plot.ctx.moveTo(x, y);
    down = true;
  });
}

function drawCurve(plot, curve, count) {
  const { ctx } = plot;
  const pixel = devicePixelRatio;
  ctx.lineJoin = 'round';
  ctx.lineCap = 'round';
  // The truth lies below the estimate and still shows where the two agree.
  const dot = curve.x.length > 100 ? 5 : 7; // a few are seen on a line as well
  ctx.lineWidth = (curve.dots ? dot : curve.ink === 'truth' ? 4 : 1.8) * pixel;
  ctx.setLineDash(curve.dots || curve.filled ? [] : dashesOf(curve, count).map((length) => length * pixel));
  ctx.strokeStyle = colour(curve.ink);
  ctx.fillStyle = colour(curve.ink);
  trace(plot, curve);
  if (curve.filled) {
    ctx.globalAlpha = 0.15;
    ctx.fill();
  }
  ctx.globalAlpha = curve.dots ? 0.7 : 1;
  ctx.stroke();
}

/** Draws the curves of one name that are there now. */
function drawNamed(plot, curves, count) {
  plot.ctx.save();
  plot.ctx.beginPath();
  plot.ctx.rect(plot.bbox.left, plot.bbox.top, plot.bbox.width, plot.bbox.height);
  plot.ctx.clip();
  for (const curve of curves) {
    plot.ctx.globalAlpha = 1;
    drawCurve(plot, curve, count);
  }
  plot.ctx.restore();
  return null;
}

/** Shows the bounds in the room that the axes have left over, at one scale for both sides where that is asked for. */
function fit(plot, bounds, equal) {
  const room = { x: plot.bbox.width, y: plot.bbox.height };
  const span = (side) => 1.08 * Math.max(bounds[side][1] - bounds[side][0], 1e-3);
  const own = { x: span('x') / room.x, y: span('y') / room.y };
  const common = Math.max(own.x, own.y);
  plot.batch(() => {
    for (const side of ['x', 'y']) {
      const centre = (bounds[side][0] + bounds[side][1]) / 2;
      const half = ((equal ? common : own[side]) * room[side]) / 2;
      plot.setScale(side, { min: centre - half, max: centre + half });
    }
  });
}

/** A plot of all these curves with a legend; show(curves) draws those from then on, in the same frame. */
function view(panel, all, body) {
  const names = [...new Map(all.map((curve) => [curve.name, curve])).values()];
  const lines = names.filter((curve) => !curve.dots && !curve.filled).length;
  const bounds = frameOf(all);
  const most = panel.wide ? 520 : panel.third ? 340 : 420;
  let shown = all;
  const paths = (plot, index) => drawNamed(plot, shown.filter((curve) => curve.name === names[index - 1].name), lines);
  const options = {
    mode: 2,
    width: 600,
    height: most,
    scales: {
      x: { time: false, auto: false, range: bounds.x },
      y: { auto: false, range: bounds.y, dir: panel.downwards ? -1 : 1 },
    },
    axes: [horizontal(panel.x), axisOptions(panel.y)],
    legend: { show: false },
    cursor: { drag: { x: false, y: false }, points: { show: false } },
    series: [null, ...names.map((curve) => ({ label: curve.name, stroke: () => colour(curve.ink), paths }))],
  };
  const place = element('div');
  body.append(place);
  const plot = new uPlot(options, [null, ...names.map((curve) => [curve.x, curve.y])], place);
  onResize(place, (width) => {
    plot.setSize({ width, height: Math.min(most, Math.max(300, Math.round(1.05 * width))) }); // a phone is narrow
    // Twice: numbers of another length leave another room.
    fit(plot, bounds, panel.equal_scale);
    fit(plot, bounds, panel.equal_scale);
  });
  onTheme(() => plot.redraw(false));
  const shape = (curve) => ['dots', 'filled'].find((kind) => curve[kind]) ?? dashesOf(curve, lines);
  body.append(
    element('div', { className: 'bar' }, ...names.map((curve, i) =>
      switchable(curve.name, curve.ink, (show) => plot.setSeries(i + 1, { show }), shape(curve)))),
  );
  return (curves) => {
    shown = curves;
    plot.redraw(false);
  };
}

export function plane(panel, body) {
  view(panel, panel.curves, body);
}

export function film(panel, body) {
  const drawing = element('div');
  const apply = strip(panel, body, (frame) => show([...panel.still, ...frame.curves]));
  body.append(drawing);
  const show = view(panel, [...panel.still, ...panel.frames.flatMap((frame) => frame.curves)], drawing);
  apply();
}
