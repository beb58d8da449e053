// Plots with uPlot of curves over a common axis, and what its axes look like.
import uPlot from 'uplot';
import { colour, dashesOf, element, labelled, onResize, readable, sample } from './dom.js';
import { onTheme } from './theme.js';

const pairing = uPlot.sync('common axis');

export function axisOptions(axis) {
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

export function horizontal(axis) {
  return { ...axisOptions(axis), size: 34, space: 60 };
}

/** 1, 2 and 5 times the powers of ten: an axis of steps, trees or numbers of a state has no tick at 2.5. */
const wholeSteps = Array.from({ length: 16 }, (_, power) => [1, 2, 5].map((factor) => factor * 10 ** power)).flat();

function linear(axis, values) {
  return values.every(Number.isInteger) ? { ...horizontal(axis), incrs: wholeSteps } : horizontal(axis);
}

/** 1, 2 and 5 times the powers of ten from low to high. */
function logarithmicTicks(_, __, low, high) {
  const ticks = [];
  for (let power = Math.floor(Math.log10(low)); 10 ** power <= high; ++power)
    ticks.push(...[1, 2, 5].map((factor) => factor * 10 ** power).filter((tick) => tick >= low && tick <= high));
  return ticks;
}

/** Those of the ticks that have room for their numbers, which on a phone are powers of ten, or some of them. */
function roomyTicks(plot, ticks) {
  const decade = Math.abs(plot.valToPos(10, 'x') - plot.valToPos(1, 'x'));
  if (decade >= 150) return ticks;
  const each = Math.ceil(52 / decade);
  return ticks.map((tick) => {
    const power = Math.round(Math.log10(tick));
    return Math.abs(Math.log10(tick) - power) < 1e-9 && power % each === 0 ? tick : null;
  });
}

function logarithmic(axis) {
  return { ...horizontal(axis), splits: logarithmicTicks, filter: roomyTicks };
}

/** Positive values only, for a logarithmic axis. */
function positive(values) {
  return values.map((value) => (value > 0 ? value : null));
}

/** From where on a logarithmic axis shows: a few values of rounding alone do not squeeze all others into its top. */
function floorOf(values) {
  const sorted = values.flat().filter((value) => value !== null && value > 0).sort((a, b) => a - b);
  if (sorted.length === 0) return 0;
  const usual = sorted[Math.floor(0.02 * sorted.length)];
  return sorted[0] < 1e-3 * usual ? usual / 3 : sorted[0];
}

/** Linear axes keep a little air and never collapse where all values are equal. */
function linearRange(_, low, high) {
  if (low === null) return [0, 1];
  if (low === high) return low === 0 ? [0, 1] : [low - 0.5 * Math.abs(low), high + 0.5 * Math.abs(high)];
  const air = 0.06 * (high - low);
  return [low >= 0 && low < 0.4 * high ? 0 : low - air, high + air];
}

/** A colour of the page, let through to so many per cent. */
function tint(ink, percent) {
  return `color-mix(in srgb, ${colour(ink)} ${percent}%, transparent)`;
}

/** The two edges of every band, then the curves, as uPlot's series. */
function seriesOf(panel) {
  const edges = panel.bands.flatMap((band) => [
    { name: `${band.name}, upper`, values: band.high, ink: band.ink, edge: true },
    { name: `${band.name}, lower`, values: band.low, ink: band.ink, edge: true },
  ]);
  return [...edges, ...panel.curves];
}

/** The curves' signs in the legend: pieces of the lines as they are drawn. */
function signs(place, series, count) {
  place.querySelectorAll('.u-series').forEach((row, i) => {
    const curve = series[i - 1];
    if (!curve) return;
    const shape = curve.edge ? 'filled' : curve.dots ? 'dots' : null;
    row.style.setProperty('--ink', `var(--${curve.ink})`);
    row.querySelector('th').prepend(shape ? element('i', { className: shape }) : sample(dashesOf(curve, count)));
  });
}

export function lines(panel, body) {
  const series = seriesOf(panel);
  const count = series.filter((curve) => !curve.edge && !curve.dots).length;
  const values = series.map((curve) => (panel.logarithmic ? positive(curve.values) : curve.values));
  const floor = panel.logarithmic ? floorOf(values) : 0;
  const logarithmicRange = (_, low, high) =>
    (low === null ? [1, 10] : uPlot.rangeLog(Math.min(Math.max(low, floor), high), high, 10, true));
  const options = {
    width: 600,
    height: panel.wide ? 280 : 260,
    scales: {
      x: panel.logarithmic_x ? { time: false, distr: 3, range: (_, low, high) => [low, high] } : { time: false },
      y: panel.logarithmic ? { distr: 3, range: logarithmicRange } : { range: linearRange },
    },
    axes: [panel.logarithmic_x ? logarithmic(panel.x) : linear(panel.x, panel.x_values), axisOptions(panel.y)],
    cursor: { sync: { key: pairing.key, setSeries: false }, focus: { prox: 30 }, points: { size: 6 } },
    legend: { markers: { show: false } },
    bands: panel.bands.map((band, i) => ({ series: [2 * i + 1, 2 * i + 2], fill: () => tint(band.ink, 16) })),
    series: [
      { label: labelled(panel.x), value: (_, value) => readable(value) },
      ...series.map((curve) => ({
        label: curve.name,
        stroke: () => (curve.edge ? tint(curve.ink, 45) : colour(curve.ink)),
        // The truth lies below the estimate and still shows where the two agree.
        width: curve.edge ? 1 : curve.ink === 'truth' && count > 1 ? 3.5 : 1.8,
        dash: curve.edge ? undefined : dashesOf(curve, count),
        paths: curve.dots ? () => null : undefined,
        points: curve.dots
          ? { show: true, size: panel.x_values.length > 150 ? 4 : 7, fill: () => colour(curve.ink), width: 0 }
          : { show: panel.x_values.length === 1 },
        value: (_, value) => readable(value),
      })),
    ],
  };
  const place = element('div');
  body.append(place);
  const plot = new uPlot(options, [panel.x_values, ...values], place);
  signs(place, series, count);
  onResize(place, (width) => plot.setSize({ width, height: options.height }));
  onTheme(() => plot.redraw(false));
}
