// Geometry and colours of the map in plain numbers. No DOM.

// Edges of the cells along an axis: halfway between neighbouring values; words and lone values stand one apart.
export function edges({ values, labels }) {
  const places =
    labels || values.some(v => typeof v !== 'number') || values.length < 2 ? values.map((_, i) => i) : values;
  const n = places.length,
    between = places.slice(1).map((v, i) => (v + places[i]) / 2);
  const first = n > 1 ? 2 * places[0] - between[0] : places[0] - 0.5;
  const last = n > 1 ? 2 * places[n - 1] - between[n - 2] : places[0] + 0.5;
  return [first, ...between, last];
}

// Sides, [[i, j], [i, j]] in corners, that part safe cells from the others; a side to nothing is none.
export function outline(cells, isSafe) {
  const at = new Map(cells.map(c => [`${c.x} ${c.y ?? 0}`, isSafe(c)])),
    lines = [];
  for (const c of cells) {
    const { x, y = 0 } = c,
      safe = isSafe(c);
    const right = at.get(`${x + 1} ${y}`),
      above = at.get(`${x} ${y + 1}`);
    if (right !== undefined && right !== safe)
      lines.push([
        [x + 1, y],
        [x + 1, y + 1],
      ]);
    if (above !== undefined && above !== safe)
      lines.push([
        [x, y + 1],
        [x + 1, y + 1],
      ]);
  }
  return lines;
}

// Blue holds, orange does not: told apart with any kind of colour blindness, and by lightness from white outwards.
const GOOD = [
    [222, 235, 247],
    [107, 174, 214],
    [8, 69, 148],
  ],
  BAD = [
    [254, 230, 206],
    [253, 141, 60],
    [140, 45, 4],
  ];

function along(stops, u) {
  const x = Math.min(Math.max(u, 0), 1) * (stops.length - 1),
    i = Math.min(Math.floor(x), stops.length - 2),
    f = x - i;
  return stops[i].map((c, k) => Math.round(c * (1 - f) + stops[i + 1][k] * f));
}

// {fill, ink}: colour of a cell and of what is written on it. Margins are parts of the limit, 1 is untouched.
export function shade(value, kind = 'margin') {
  if (!Number.isFinite(value)) return { fill: 'var(--nothing)', ink: 'inherit' };
  const good = kind === 'probability' ? (value - 0.5) / 0.5 : value,
    bad = kind === 'probability' ? (0.5 - value) / 0.5 : -value;
  const rgb = good >= 0 ? along(GOOD, good) : along(BAD, bad);
  const light = (0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2]) / 255;
  return { fill: `rgb(${rgb})`, ink: light > 0.52 ? '#12161c' : '#fff' };
}
