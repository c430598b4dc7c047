// Four views of a landing, and how heights and robot are scaled in each. Numbers in m, for a robot of 1.25 m.

const USUAL = 1.25;
const STEPS = [1, 2, 5, 10, 20];
export const FIELD = 38; // degrees, vertical

// Factor for heights in the span view: at most 10, and never so large that the sag looks like a fifth of the span.
export function spanHeights(length, sag) {
  const most = (0.2 * length) / Math.max(sag, 1e-6);
  return Math.max(1, ...STEPS.filter(k => k <= Math.min(most, 10)));
}

// Factor for the robot in the span view: 14 on 200 m.
export const spanSize = (length, reach) =>
  Math.max(1, Math.round((((14 * length) / 200) * USUAL) / Math.max(reach, 0.2)));

// {target, eye, heights, size, follow}: where to look, from where, and the scales. `at` is the point of landing,
// `low` and `high` the heights between which the robot moves, its own size included.
export function camera(name, { at: [x, y, z], low, high, reach, hangs, span, sag, aspect }) {
  const close = { heights: 1, size: 1, follow: false };
  if (name === 'wheel') {
    const back = Math.max(1, 1.15 / aspect); // a narrow window sees less to the sides
    return {
      ...close,
      follow: true,
      target: [x, y, z + 0.03],
      eye: [x + 0.5 * back, y - 0.62 * back, z + 0.2 * back],
    };
  }
  if (name === 'span' && span) return wholeSpan(span, sag, reach, aspect);
  const tangent = Math.tan((FIELD * Math.PI) / 360);
  const middle = (low + high) / 2;
  const distance = Math.max((high - low) / 2 / tangent, (0.62 * reach) / (tangent * aspect)) + 0.35 * reach;
  const ways = name === 'side' ? [1, 0, 0] : [0.8, -0.5, hangs ? 0.33 : 0.3];
  return { ...close, target: [x, y, middle], eye: [x, y, middle].map((v, c) => v + distance * ways[c]) };
}

// The whole line fits, whatever the window: distance from the narrower of the two field angles.
function wholeSpan({ left, right, length }, sag, reach, aspect) {
  const heights = spanHeights(length, sag);
  const size = spanSize(length, reach);
  const tangent = Math.tan((FIELD * Math.PI) / 360);
  const middle = [0, 1, 2].map(c => (left[c] + right[c]) / 2);
  const deep = heights * sag + reach * size;
  const rise = Math.abs(right[2] - left[2]);
  const far = 1.1 * Math.max(length / 2 / (tangent * aspect), (deep + rise) / 1.5 / tangent);
  const target = [middle[0], middle[1], middle[2] - 0.5 * deep];
  return {
    heights,
    size,
    follow: false,
    target,
    eye: [target[0] + far, target[1] - 0.12 * far, target[2] + 0.14 * far],
  };
}
