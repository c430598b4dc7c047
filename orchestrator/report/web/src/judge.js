// Whether a landing was safe: its signals held against its limits, as orchestrator/landing/safety.py does it. No DOM.
import { AXES } from './model.js';

export const UNITS = { roll: 'rad', yaw: 'rad', pitch: 'rad', z: 'm', slip: 'm', airborne: 's', tension: '1', wheel_force: 'N' };
const CLOSED = [1, 2], SLIPPING = 2, LEFT_THE_GROOVE = 3;
const TENSIONS = ['cable.tension_left', 'cable.tension_mid', 'cable.tension_right'];
export const TENSION_ALONG = 'whatif.tension';   // the largest tension anywhere along the line, where it is known

class NotRecorded extends Error {}

// What `summary.json` says of the safety of a landing: {safe, safety, limits, not_judged}, and `touched`, `airborne`.
//   limits: {known: {name: {limit, unit, source, formula, reference}}, missing: {name: why}}
export function judge(limits, model) {
  const found = {}, missing = { ...limits.missing };
  for (const name of Object.keys(UNITS)) {
    const limit = limits.known[name];
    if (!limit) {
      missing[name] ??= 'no limit given';
      continue;
    }
    try {
      found[name] = judged(name, limit, series(name, model, limit.reference), model.time);
    } catch (error) {
      if (!(error instanceof NotRecorded)) throw error;
      missing[name] = `${error.message} is not among the signals`;
    }
  }
  const open = Object.values(openWheels(model)), faults = fallen(model);
  const touched = !open.length || open.some(wheel => !wheel.every(Boolean));
  const airborne = open.length > 0 && open.every(wheel => wheel[wheel.length - 1]);
  const safe = verdict(found, faults, touched);
  return { safe, safety: words(safe, found, faults, touched, airborne, model.end), limits: found, not_judged: missing };
}

const named = (found, verdict) => Object.keys(found).filter(name => found[name].verdict === verdict);

function verdict(found, faults, touched) {
  if (faults.length || named(found, 'exceeded').length || named(found, 'unclear').length) return false;
  return Object.keys(found).length && touched ? true : null;
}

function words(safe, found, faults, touched, airborne, end) {
  const until = `until ${end} s`;
  if (safe) return `SAFE ${until}: ${Object.keys(found).join(', ')} kept${airborne ? '; in the air at the end' : ''}`;
  if (safe === null) return `NOT JUDGED ${until}: ${touched ? 'no limit is known' : 'no wheel has touched the line'}`;
  const exceeded = named(found, 'exceeded'), unclear = named(found, 'unclear');
  const why = exceeded.length ? [`${exceeded.join(', ')} exceeded`] : [];
  if (unclear.length) why.push(`margin of ${unclear.join(', ')} smaller than the estimated error`);
  return `NOT ${exceeded.length || faults.length ? '' : 'CLEARLY '}SAFE ${until}: ${[...why, ...faults].join('; ')}`;
}

// The worst of all wheels; what is not finite is beyond any limit.
function judged(name, limit, found, time) {
  let worst = null;
  for (const [wheel, values] of found) {
    for (let i = 0; i < values.length; i++) {
      const size = Number.isFinite(values[i]) ? Math.abs(values[i]) : Infinity;
      if (worst === null || size > worst.size) worst = { wheel, i, size, value: values[i], values };
    }
  }
  const margin = limit.limit - worst.size, error = name === 'airborne' ? longestStep(time, worst.values) : null;
  const unclear = error !== null && margin < error;
  return {
    limit: limit.limit, worst: worst.value, margin, time: time[worst.i], unit: limit.unit, wheel: worst.wheel,
    share: limit.limit > 0 ? worst.size / limit.limit : Infinity, estimated_error: error,
    verdict: margin < 0 ? 'exceeded' : unclear ? 'unclear' : 'kept',
    source: limit.source, formula: limit.formula, reference: limit.reference ?? null,
  };
}

// A time in the air is known to a step.
function longestStep(time, values) {
  let longest = 0;
  if (values.some(Boolean)) for (let i = 1; i < time.length; i++) longest = Math.max(longest, time[i] - time[i - 1]);
  return longest;
}

// -- what is judged: [[wheel, or null of the whole, values]] ------------------------------------------------------

export function series(name, model, reference) {
  if (name === 'tension') return [[null, tension(model, reference ?? 1)]];
  if (name === 'z') return [[null, signal(model, 'robot.body.position.z').map(z => (reference ?? 0) - z)]];
  if (name === 'pitch') return [[null, signal(model, 'robot.pitch')]];
  const found = wheels(model);
  if (!found.length) throw new NotRecorded('contact1.status');
  return found.map(k => [k, OF_WHEELS[name](model, k)]);
}

function signal(model, name) {
  const values = model.get(name);
  if (!values) throw new NotRecorded(name);
  return Float64Array.from(values);
}

function wheels(model) {
  const found = [];
  for (let k = 1; model.has(`contact${k}.status`); k++) found.push(k);
  return found;
}

const tangent = (model, k) => AXES.map(axis => signal(model, `cable.port[${k}].tangent.${axis}`));

function slip(model, k) {
  const status = signal(model, `contact${k}.status`), speed = signal(model, `contact${k}.slip_velocity`), time = model.time;
  const sliding = speed.map((v, i) => (status[i] === SLIPPING ? Math.abs(v) : 0)), out = new Float64Array(time.length);
  for (let i = 1; i < out.length; i++) out[i] = out[i - 1] + 0.5 * (time[i] - time[i - 1]) * (sliding[i] + sliding[i - 1]);
  return out;
}

// From line to axle, the largest within each step where that is known: the same share of the walls' forces at all times.
function wheelForce(model, k) {
  const normal = signal(model, `contact${k}.normal_force`), peak = model.get(`contact${k}.normal_force_max`) ?? normal;
  const radial = model.get(`contact${k}.radial_force`), largest = normal.map((x, i) => Math.max(x, peak[i]));
  if (!radial || !normal.some(x => x > 0)) return largest;
  let share = -Infinity;
  normal.forEach((x, i) => { if (x > 0) share = Math.max(share, radial[i] / x); });
  return largest.map((x, i) => Math.max(x * share, radial[i]));
}

const OF_WHEELS = {
  roll: (model, k) => { const roll = signal(model, 'robot.roll'), [, y, z] = tangent(model, k); return roll.map((a, i) => a - Math.atan2(z[i], y[i])); },
  yaw: (model, k) => { const yaw = signal(model, 'robot.yaw'), [x, y] = tangent(model, k); return yaw.map((a, i) => a - Math.atan2(-x[i], y[i])); },
  slip, airborne: (model, k) => timeOff(model.time, openWheels(model)[k]), wheel_force: wheelForce,
};

function tension(model, strength) {
  const known = [...TENSIONS, TENSION_ALONG].map(name => model.get(name)).filter(Boolean);
  if (!TENSIONS.some(name => model.has(name))) throw new NotRecorded(TENSIONS[0]);
  return Float64Array.from(model.time, (_, i) => Math.max(...known.map(values => values[i])) / strength);
}

// -- in the air ---------------------------------------------------------------------------------------------------

function openWheels(model) {
  return Object.fromEntries(wheels(model).map(k => [k, Array.from(model.get(`contact${k}.status`), s => !CLOSED.includes(s))]));
}

function fallen(model) {
  const left = wheels(model).filter(k => model.get(`contact${k}.status`).includes(LEFT_THE_GROOVE));
  return left.map(k => `the cable left the groove of contact${k}`);
}

// For how long a wheel has been off the line again; where it touches anew, for how long it was. Spans begin and end in
// the middle of a step.
function timeOff(time, open) {
  const n = time.length, found = new Float64Array(n), middle = i => 0.5 * (time[i] + time[i - 1]);
  const touch = open.indexOf(false);
  for (let i = touch < 0 ? n : touch; i < n; i++) {
    if (!open[i]) continue;
    const start = i ? middle(i) : time[0];
    for (; i < n && open[i]; i++) if (time[i] > start) found[i] = time[i] - start;
    const end = i < n ? middle(i) : time[n - 1];
    found[Math.min(i, n - 1)] = end - start;
  }
  return found;
}

// -- limits that go with the mass ---------------------------------------------------------------------------------

// The limits of a start where its mass is another: pitch follows from what the largest thrust can carry.
export function limitsFor({ limits, pitch }, mass) {
  if (!pitch) return limits;
  const weight = mass * pitch.gravity, known = { ...limits.known }, missing = { ...limits.missing };
  delete known.pitch;
  delete missing.pitch;
  if (!(pitch.thrust > weight)) {
    missing.pitch = `the largest thrust, ${digits4(pitch.thrust)} N, does not carry its weight of ${digits4(weight)} N`;
    return { known, missing };
  }
  const text = `arccos(${digits4(mass)} kg · ${digits4(pitch.gravity)} m/s2 / ${digits4(pitch.thrust)} N)`;
  const before = limits.known.pitch, source = before?.source ?? 'eq. 4 of Jia et al. 2025; F_z,max of the robot\'s rotors';
  const limit = Math.acos(weight / pitch.thrust), formula = `arccos(m g / F_z,max) = ${text}`;
  known.pitch = { limit, unit: 'rad', source, formula, reference: before?.reference ?? null };
  return { known, missing };
}

const digits4 = x => String(Number(x.toPrecision(4)));
