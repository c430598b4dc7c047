// Numbers behind the plots: what a panel shows in its unit, differences, and the range of its axis. No DOM.

const MINUS_SIGN = '−';
const SUPERSCRIPT = '⁰¹²³⁴⁵⁶⁷⁸⁹';

const firstFinite = values => {
  for (const x of values) if (Number.isFinite(x)) return x;
  return 0;
};

// Values in the shown unit; null where there is none, which uPlot leaves open.
export function shown(values, { factor = 1, from_start: fromStart = false }) {
  const start = fromStart ? firstFinite(values) : 0;
  return Array.from(values, x => (Number.isFinite(x) ? factor * (x - start) : null));
}

const minus = (a, b) => a.map((x, i) => (x === null || b[i] === null || b[i] === undefined ? null : x - b[i]));

// Curves of a panel: [{values, label, colour, dash, kind}] with kind "own", "reference", "other" or "difference".
export function curves(model, panel, mode, original = null) {
  const found = [];
  for (const signal of panel.signals) {
    const own = model.get(signal.name);
    if (!own) continue;
    if (mode === 'difference') found.push(...differences(model, panel, signal));
    else found.push({ ...signal, values: shown(own, panel), kind: 'own' }, ...beside(model, panel, signal, original));
  }
  return found;
}

// The reference, other runs of a comparison, and the landing as it was simulated where a what-if is shown.
function beside(model, panel, signal, original) {
  const found = others(model, signal.name).map(label => {
    const values = shown(model.atOwnTimes(`${label}/${signal.name}`), panel);
    return { ...signal, values, label, kind: label === 'reference' ? 'reference' : 'other' };
  });
  const before = original?.get(signal.name) && shown(resampled(original, signal.name, model.time), panel);
  if (before) found.push({ ...signal, values: before, label: 'as simulated', kind: 'reference' });
  return found;
}

const resampled = (model, name, times) => Array.from(times, t => (t > model.end ? NaN : model.at(name, t)));

// Labels of the runs that carry the signal too, the reference first.
function others(model, name) {
  const end = `/${name}`;
  const found = [];
  for (const key of Object.keys(model.arrays)) {
    if (!key.startsWith(model.prefix) || !key.endsWith(end)) continue;
    const label = key.slice(model.prefix.length, -end.length);
    if (label && !label.startsWith('difference') && !model.head.landings?.[label]) found.push(label);
  }
  return found.sort((a, b) => (b === 'reference') - (a === 'reference'));
}

function differences(model, panel, signal) {
  const plain = { factor: panel.factor };
  const exact = model.get(`difference/${signal.name}`);
  if (exact)
    return [{ ...signal, values: shown(model.atOwnTimes(`difference/${signal.name}`), plain), kind: 'difference' }];
  if (!model.has(`reference/${signal.name}`)) return [];
  const own = model.get(signal.name);
  const theirs = model.atOwnTimes(`reference/${signal.name}`);
  return [{ ...signal, values: minus(shown(own, plain), shown(theirs, plain)), kind: 'difference' }];
}

export function extent(lists) {
  let low = Infinity;
  let high = -Infinity;
  for (const values of lists) {
    for (const x of values) {
      if (x === null || x === undefined) continue;
      if (x < low) low = x;
      if (x > high) high = x;
    }
  }
  return low <= high ? [low, high] : [0, 0];
}

const LEAST_PART = 0.2; // of the axis that the values take where a limit is shown beside them

// Range of the axis: all values, and each limit (to both sides, where it holds to both) that does not flatten them.
export function range(low, high, limits = []) {
  const own = high - low;
  const sizes = [...new Set(limits.map(({ at }) => Math.abs(at)))].sort((a, b) => a - b);
  for (const size of sizes) {
    const both = limits.map(({ at }) => at).filter(at => Math.abs(at) === size);
    const [l, h] = [Math.min(low, ...both), Math.max(high, ...both)];
    if (own >= LEAST_PART * (h - l)) [low, high] = [l, h];
  }
  const pad = 0.07 * (high - low) || 0.07 * Math.abs(high) || 1;
  return [low - pad, high + pad];
}

// Power of a thousand by which small numbers are shown: 0, -3, -6, …
export function power(values) {
  const most = Math.max(...extent(values).map(Math.abs));
  return most > 0 && most < 0.1 ? 3 * Math.floor(Math.log10(most) / 3) : 0;
}

export function powerText(exponent) {
  const digits = [...String(Math.abs(exponent))].map(d => SUPERSCRIPT[d]).join('');
  return exponent === 0 ? '' : `10${exponent < 0 ? '⁻' : ''}${digits} `;
}

export const axisText = (value, step) => {
  if (step < 1e-4) return value === 0 ? '0' : value.toExponential(1).replace('-', MINUS_SIGN);
  const digits = step >= 1 ? 0 : Math.min(6, Math.ceil(-Math.log10(step) - 1e-9));
  return value.toFixed(digits).replace('-', MINUS_SIGN);
};
