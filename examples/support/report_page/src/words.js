// What the words and letters on the page mean: those that stand on it, at its end. docs/glossary.md has more of them.
import { element } from './dom.js';

const words = [
  ['ATE', /\bATE\b/, 'absolute trajectory error: how far the estimated positions are from the true ones after the alignment that is named'],
  ['Cramer-Rao bound', /Cram[eé]r-Rao/, 'the smallest error that any unbiased estimate can have on average'],
  ['dead reckoning', /dead reckoning/i, 'adding up the motion that was commanded or measured, with nothing of the world seen'],
  ['extended filter', /\bextended\b/i, 'takes motion and sensor as straight lines, or planes, near its estimate'],
  ['inliers', /\binliers?\b/i, 'points that lie where the estimated pose says, within their noise; the rest counts as wrongly matched'],
  ['Jacobian', /\bJacobians?\b/, 'the matrix of derivatives: each number that comes out by each that goes in'],
  ['keyframes', /\bkeyframes?\b/i, 'pictures whose poses are kept and estimated together; the landmarks rest on them'],
  ['landmark', /\blandmarks?\b/i, 'a point (or line, or post) of the world that the map holds'],
  ['N_eff', /\bN_eff\b/, 'effective number of particles, 1 over the sum of their squared weights: how many carry the weight'],
  ['NEES', /\bNEES\b/, 'normalised estimation error squared: the squared error over what the filter expects of it. Its mean is the number of '
    + 'estimated numbers where the filter knows how wrong it is; larger: too sure; smaller: too unsure'],
  ['NIS', /\bNIS\b/, 'normalised innovation squared: the squared surprise of a measurement over what the filter expects of it. Its mean is the '
    + 'number of measured numbers where the filter is right; larger: too sure; smaller: too unsure'],
  ['odometry', /\bodometry\b/i, 'motion from step to step, by wheels or by images, added up'],
  ['particles', /\bparticles?\b/i, 'many guesses of the state or the path, each with a weight; the measurements say which to keep'],
  ['precision', /\bprecision\b/i, 'the share of what was answered that is right'],
  ['recall', /\brecall\b/i, 'the share of what could have been found that was found'],
  ['rms', /\b(rms|RMSE?|rmse)\b/, 'root of the mean of the squares: the usual size of an error'],
  ['RPE', /\bRPE\b/, 'relative pose error: how wrong the motion over a stretch is'],
  ['sigma', /\bsigmas?\b/i, 'standard deviation: two errors of three are smaller, 95 of 100 smaller than twice as much'],
  ['smoother', /\bsmoothers?\b/i, 'estimates every moment from all that was measured, before and after it'],
  ['SURF', /\bSURF\b/, 'a detector of spots in an image that gives each 64 numbers to know it again by'],
  ['unscented filter', /\bunscented\b/i, 'sends a few points through motion or sensor and takes mean and covariance of what comes out'],
];

/** A list of the words that stand in what the page shows; null where there are none. */
export function explained(page) {
  // Text beside text: a label and its number stand in elements of their own, with no space between.
  const walker = document.createTreeWalker(page, NodeFilter.SHOW_TEXT);
  const texts = [];
  while (walker.nextNode()) texts.push(walker.currentNode.data);
  const text = texts.join(' ');
  const found = words.filter(([, pattern]) => pattern.test(text));
  if (found.length === 0) return null;
  return element('section', { className: 'words', ariaLabel: 'Words on this page' },
    element('h2', {}, 'Words on this page'),
    element('dl', {}, ...found.flatMap(([word, , meaning]) => [element('dt', {}, word), element('dd', {}, meaning)])));
}
