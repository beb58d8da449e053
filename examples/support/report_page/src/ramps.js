// Colours that stand for numbers; both ramps keep their order for the colour-blind.

/** From little to much. */
export const viridis = ['#440154', '#3b528b', '#21918c', '#5ec962', '#fde725'];

/** Around nothing: blue below, orange above. */
export const diverging = ['#08519c', '#6baed6', '#f7f7f7', '#f0a04b', '#a63603'];

function channels(hex) {
  return [1, 3, 5].map((place) => parseInt(hex.slice(place, place + 2), 16));
}

/** Red, green and blue (0 to 255) at a share of 0 to 1 of the way along the ramp. */
export function mixed(ramp, share) {
  const place = Math.min(Math.max(share, 0), 1) * (ramp.length - 1);
  const below = Math.min(Math.floor(place), ramp.length - 2);
  const [low, high] = [channels(ramp[below]), channels(ramp[below + 1])];
  return low.map((value, i) => Math.round(value + (place - below) * (high[i] - value)));
}

/** The ramp as a CSS picture from left to right. */
export function gradient(ramp) {
  return `linear-gradient(90deg, ${ramp.join(', ')})`;
}
