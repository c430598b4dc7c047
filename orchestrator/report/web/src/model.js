// What the page holds: a JSON head that says where each array lies, and one block of numbers. No DOM but in `read`.

const TYPES = { f4: Float32Array, f8: Float64Array };
export const AXES = ['x', 'y', 'z'];

function fromBase64(text) {
  if (Uint8Array.fromBase64) return Uint8Array.fromBase64(text);
  const raw = atob(text);
  const out = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) out[i] = raw.charCodeAt(i);
  return out;
}

// The bytes of a packed script element: base64, gzip where `how` says so.
export async function unpack(text, how = 'gzip') {
  const packed = fromBase64(text.trim());
  if (!how) return packed.buffer;
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream(how));
  return new Response(stream).arrayBuffer();
}

function view(buffer, { offset, shape, type }) {
  const kind = TYPES[type ?? 'f4'];
  const count = shape.reduce((a, b) => a * b, 1);
  if (offset % kind.BYTES_PER_ELEMENT === 0) return new kind(buffer, offset, count);
  return new kind(buffer.slice(offset, offset + count * kind.BYTES_PER_ELEMENT));
}

export async function read(document) {
  const head = JSON.parse(document.getElementById('head').textContent);
  const element = document.getElementById('blob');
  const text = element?.textContent ?? '';
  const buffer = text.trim() ? await unpack(text, head.packed) : new ArrayBuffer(0);
  if (element) element.textContent = ''; // megabytes that nobody reads twice
  const arrays = {};
  for (const [name, place] of Object.entries(head.arrays ?? {})) arrays[name] = view(buffer, place);
  return new Model(head, arrays);
}

// Index i and part f so that t lies at (1 - f) times[i] + f times[i + 1]; ends are held. Steps need not be equal.
export function locate(times, t) {
  const last = times.length - 1;
  if (last < 1 || !(t > times[0])) return [0, 0];
  if (t >= times[last]) return [last - 1, 1];
  let low = 0;
  let high = last;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (times[middle] <= t) low = middle;
    else high = middle;
  }
  return [low, (t - times[low]) / (times[high] - times[low])];
}

// Linear interpolation; a value that is not finite beside one that is gives way to it.
export function interpolate(values, i, f) {
  const a = values[i];
  const b = values[Math.min(i + 1, values.length - 1)];
  if (f === 0 || !Number.isFinite(b)) return a;
  return f === 1 || !Number.isFinite(a) ? b : a * (1 - f) + b * f;
}

// Point (and tangent) of an ANCF line at arc length s: cubic Hermite between its nodes, which is its exact shape.
export function hermite(line, s, point = [0, 0, 0], tangent = null) {
  const { s: arc, position: p, slope: d } = line;
  const [i] = locate(arc, s);
  const h = arc[i + 1] - arc[i];
  const u = Math.min(Math.max((s - arc[i]) / h, 0), 1);
  const v = 1 - u;
  const a = v * v * (1 + 2 * u);
  const b = u * v * v * h;
  const c = u * u * (3 - 2 * u);
  const e = -u * u * v * h;
  for (let k = 0, l = 3 * i, r = l + 3; k < 3; k++, l++, r++) {
    point[k] = a * p[l] + b * d[l] + c * p[r] + e * d[r];
    if (tangent) tangent[k] = ((6 * u * v) / h) * (p[r] - p[l]) + v * (1 - 3 * u) * d[l] + u * (3 * u - 2) * d[r];
  }
  return point;
}

export const chord = (span, y) => {
  const [, y0, z0] = span.left;
  const [, y1, z1] = span.right;
  return z0 + ((z1 - z0) * (y - y0)) / (y1 - y0 || 1);
};

const sameTimes = (a, b) => a.length === b.length && a.every((t, i) => t === b[i]);

// Signals, line and what is said about them; nothing in it changes.
export class Model {
  constructor(head, arrays, prefix = '') {
    this.head = head;
    this.arrays = arrays;
    this.prefix = prefix;
    this.time = this.get('time') ?? new Float64Array(0);
  }

  get(name) {
    return this.arrays[this.prefix + name];
  }
  has(name) {
    return this.get(name) !== undefined;
  }
  get start() {
    return this.time[0] ?? 0;
  }
  get end() {
    return this.time[this.time.length - 1] ?? 0;
  }

  // Another landing that this page carries; its arrays have a prefix of their own.
  other(prefix, head = {}) {
    return new Model({ ...this.head, ...head }, this.arrays, prefix);
  }

  // Times of a signal: those of the run that its name begins with (`reference/…`), else this run's.
  timeOf(name) {
    return this.get(`${name.slice(0, name.lastIndexOf('/') + 1)}time`) ?? this.time;
  }

  at(name, t) {
    const values = this.get(name);
    return values?.length ? interpolate(values, ...locate(this.timeOf(name), t)) : NaN;
  }

  // A signal at this run's own times, whatever the times it was recorded at.
  atOwnTimes(name) {
    const values = this.get(name);
    const times = this.timeOf(name);
    if (times === this.time || !values || sameTimes(times, this.time)) return values;
    return Float64Array.from(this.time, t =>
      t > times[times.length - 1] ? NaN : interpolate(values, ...locate(times, t)),
    );
  }

  vector(name, t, otherwise = NaN) {
    return AXES.map(axis => {
      const x = this.at(`${name}.${axis}`, t);
      return Number.isFinite(x) ? x : otherwise;
    });
  }

  first(name) {
    const values = this.get(name) ?? [];
    for (const x of values) if (Number.isFinite(x)) return x;
    return NaN;
  }

  #nodes(prefix) {
    if (!this.head.line || !this.has(`${prefix}line.s`)) return null;
    const [s, time, position, slope] = ['s', 'time', 'position', 'slope'].map(n => this.get(`${prefix}line.${n}`));
    return s.length > 1 && time?.length && position && slope ? { s, time, position, slope } : null;
  }

  get linePrefix() {
    return this.head.line?.prefix ?? '';
  }

  // Nodes at time t: {s, position, slope}, null where there is no line. Nodes that are not finite keep the last shape.
  line(t, prefix = this.linePrefix) {
    const all = this.#nodes(prefix);
    if (!all) return null;
    const [i, f] = locate(all.time, t);
    const size = 3 * all.s.length;
    const frames = all.position.length / size;
    const from = Math.min(i, frames - 1) * size;
    const to = Math.min(i + 1, frames - 1) * size;
    const mix = a => Float64Array.from({ length: size }, (_, k) => a[from + k] * (1 - f) + a[to + k] * f);
    const found = { s: all.s, position: mix(all.position), slope: mix(all.slope) };
    return found.position.every(Number.isFinite) && found.slope.every(Number.isFinite)
      ? found
      : this.#lastGood(all, from);
  }

  #lastGood({ s, position, slope }, from) {
    const size = 3 * s.length;
    const finite = a => a.every(Number.isFinite);
    for (let o = from; o >= 0; o -= size) {
      const found = { s, position: position.subarray(o, o + size), slope: slope.subarray(o, o + size) };
      if (finite(found.position) && finite(found.slope)) return found;
    }
    return null;
  }

  // Least and largest height of every node over time, with its y: {y, low, high}; null without a line.
  band(prefix = this.linePrefix) {
    const all = this.#nodes(prefix);
    if (!all) return null;
    const m = all.s.length;
    const low = new Float64Array(m).fill(Infinity);
    const high = new Float64Array(m).fill(-Infinity);
    for (let k = 0, j = 0; k < all.position.length; k += 3, j = (j + 1) % m) {
      const z = all.position[k + 2];
      if (z < low[j]) low[j] = z;
      if (z > high[j]) high[j] = z;
    }
    return { y: Float64Array.from({ length: m }, (_, j) => all.position[3 * j + 1]), low, high };
  }

  get contacts() {
    const found = [];
    for (let k = 1; this.has(`contact${k}.normal_force`) || this.has(`contact${k}.wheel.force.x`); k++) found.push(k);
    return found;
  }

  get hasReference() {
    return this.has('reference/robot.body.position.z') || this.has('reference/time');
  }

  // Position and attitude of the robot; null where they are not known.
  pose(t, prefix = '') {
    const position = this.vector(`${prefix}robot.body.position`, t);
    if (!position.every(Number.isFinite)) return null;
    const angles = ['roll', 'pitch', 'yaw']
      .map(a => this.at(`${prefix}robot.${a}`, t))
      .map(a => (Number.isFinite(a) ? a : 0));
    return { position, angles };
  }
}
