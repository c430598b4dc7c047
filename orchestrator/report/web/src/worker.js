// Solves a landing by the project's own kernels, compiled to WebAssembly, in a thread of its own; the newest wish first.
//   in   {wasm}                                   once
//        {id, start, block, wishes, step, end, frame}
//   out  {id, time, signals, tension, line, ms} | {id, failed} | {id, dropped}
const WORD = 8, ALIGN = 64, WASM_PAGE = 65536;
const PIECE = 25;   // ms of solving, after which a newer wish is heard
const PLACES = { mass: 0, damping: 1, friction: 2, speed: 3 };
const WHY = {
  1: 'no step is short enough; the contact may be too stiff or too hard damped', 2: 'the law of the contact fails',
  3: 'a wheel has run past a support, off the line', 4: 'the axle lies along the line, which the law of the contact does not cover',
  5: 'the free wheels are heavier to turn than the whole robot',
};

let landing = null, wish = null, busy = false;

async function compiled(wasm) {
  const module = await WebAssembly.compile(wasm), env = { hypot: (a, b) => Math.sqrt(a * a + b * b) };
  for (const { name } of WebAssembly.Module.imports(module)) env[name] ??= Math[name];
  const { exports } = await WebAssembly.instantiate(module, { env });
  return exports;
}

// The block in the module's memory, as numbers; the memory grows to what it needs.
function placed(exports, given, words) {
  const base = Math.ceil(exports.__heap_base.value / ALIGN) * ALIGN, missing = base + WORD * words - exports.memory.buffer.byteLength;
  if (missing > 0) exports.memory.grow(Math.ceil(missing / WASM_PAGE));
  const block = new Float64Array(exports.memory.buffer, base, words);
  block.set(given);
  block.fill(0, given.length);
  return { base, block };
}

const pause = () => new Promise(done => setTimeout(done, 0));

async function solved({ id, start, block: given, wishes, step, end, frame }, outdated) {
  const began = performance.now(), exports = await landing, { base, block } = placed(exports, given, start.words);
  for (const [name, value] of Object.entries(wishes)) block[start.places.wishes + PLACES[name]] = value;
  const wrong = exports.begin(base);
  if (wrong) return { id, failed: `${WHY[wrong] ?? `status ${wrong}`}, at the start` };
  const n = Math.ceil(end / step - 1e-9) + 1, record = recorder(start, block, n, Math.max(1, Math.round(frame / step)));
  let heard = performance.now(), last = 0;
  for (let i = 0; i < n; i++) {
    const t = Math.min(i * step, end);
    if (i) {
      const reached = exports.advance(base, last, t);
      if (!(reached >= 0)) return { id, failed: `${WHY[-1 - reached] ?? `status ${-1 - reached}`}, before ${+t.toFixed(3)} s` };
    }
    exports.show(base);
    record(i, t);
    last = t;
    if (performance.now() - heard < PIECE) continue;
    await pause();
    if (outdated()) return { id, dropped: true };
    heard = performance.now();
  }
  return { id, ...record.found(), ms: performance.now() - began };
}

// Takes what the kernels show at an instant into arrays over time.
function recorder({ places, signals }, block, n, stride) {
  const names = Object.keys(signals), words = Object.values(signals), rows = names.map(() => new Float64Array(n));
  const [first, nodes] = places.nodes, [tension, points, width] = places.tension, frames = Math.ceil((n - 1) / stride) + 1;
  const line = { s: block.slice(first, first + nodes), time: new Float64Array(frames), position: new Float32Array(frames * nodes * 3), slope: new Float32Array(frames * nodes * 3) };
  const time = new Float64Array(n), largest = new Float64Array(n);
  const take = (i, t) => {
    time[i] = t;
    for (let k = 0; k < words.length; k++) rows[k][i] = block[words[k]];
    largest[i] = -Infinity;
    for (let k = 0; k < points; k++) largest[i] = Math.max(largest[i], block[tension + k * width]);
    if (i % stride && i < n - 1) return;
    const frame = Math.ceil(i / stride);
    line.time[frame] = t;
    for (let j = 0; j < nodes; j++) {
      const from = places.line + 6 * j, to = 3 * (frame * nodes + j);
      for (let c = 0; c < 3; c++) {
        line.position[to + c] = block[from + c];
        line.slope[to + c] = block[from + 3 + c];
      }
    }
  };
  take.found = () => ({ time, signals: Object.fromEntries(names.map((name, k) => [name, rows[k]])), tension: largest, line });
  return take;
}

async function work() {
  busy = true;
  while (wish) {
    const mine = wish;
    wish = null;
    let answer;
    try {
      answer = await solved(mine, () => wish !== null);
    } catch (error) {
      answer = { id: mine.id, failed: String(error?.message ?? error) };
    }
    postMessage(answer);
  }
  busy = false;
}

onmessage = ({ data }) => {
  if (data.wasm) {
    landing = compiled(data.wasm);
    return;
  }
  if (wish) postMessage({ id: wish.id, dropped: true });
  wish = data;
  if (!busy) work();
};
