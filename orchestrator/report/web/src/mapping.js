// Geometry and colours of the map in plain numbers. No DOM.

// Edges of the cells along an axis: halfway between neighbouring values; words and lone values stand one apart.
export function edges({ values, labels }) {
  const places =
    labels || values.some(v => typeof v !== 'number') || values.length < 2 ? values.map((_, i) => i) : values;
  const n = places.length;
  const between = places.slice(1).map((v, i) => (v + places[i]) / 2);
  const first = n > 1 ? 2 * places[0] - between[0] : places[0] - 0.5;
  const last = n > 1 ? 2 * places[n - 1] - between[n - 2] : places[0] + 0.5;
  return [first, ...between, last];
}

const isSafe = cell => (cell.verdict ? cell.verdict === 'safe' : cell.margin >= 0);

// Sides, [[i, j], [i, j]] in corners, that part safe cells from the others; a side to nothing, or to a landing
// without a result, is none.
export function outline(cells) {
  const known = cells.filter(cell => !cell.box && Number.isFinite(cell.margin));
  const safety = new Map(known.map(cell => [`${cell.x} ${cell.y ?? 0}`, isSafe(cell)]));
  const lines = [];
  const part = (cell, dx, dy, side) => {
    const beside = safety.get(`${cell.x + dx} ${(cell.y ?? 0) + dy}`);
    if (beside !== undefined && beside !== isSafe(cell)) lines.push(side);
  };
  for (const cell of known) {
    const [x, y] = [cell.x, cell.y ?? 0];
    const corner = [x + 1, y + 1];
    part(cell, 1, 0, [[x + 1, y], corner]);
    part(cell, 0, 1, [[x, y + 1], corner]);
  }
  return lines;
}

// Blue holds, orange does not: told apart with any kind of colour blindness, and by lightness from white outwards.
const GOOD = [
  [222, 235, 247],
  [107, 174, 214],
  [8, 69, 148],
];
const BAD = [
  [254, 230, 206],
  [253, 141, 60],
  [140, 45, 4],
];

function along(stops, u) {
  const x = Math.min(Math.max(u, 0), 1) * (stops.length - 1);
  const i = Math.min(Math.floor(x), stops.length - 2);
  const f = x - i;
  return stops[i].map((c, k) => Math.round(c * (1 - f) + stops[i + 1][k] * f));
}

// {fill, ink}: colour of a cell and of what is written on it. Margins are parts of the limit, 1 is untouched.
export function shade(value, kind = 'margin') {
  if (!Number.isFinite(value)) return { fill: 'var(--nothing)', ink: 'inherit' };
  const good = kind === 'probability' ? (value - 0.5) / 0.5 : value;
  const bad = kind === 'probability' ? (0.5 - value) / 0.5 : -value;
  const rgb = good >= 0 ? along(GOOD, good) : along(BAD, bad);
  const light = (0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2]) / 255;
  return { fill: `rgb(${rgb})`, ink: light > 0.52 ? '#12161c' : '#fff' };
}
