// Geometry of robot and line in plain numbers: rotations, grooves, the gap between rotors and line. No DOM, no WebGL.
import { hermite } from './model.js';

// Rows of R = Rz(yaw) Ry(pitch) Rx(roll), which takes components in B to components in I.
export function rotation([roll, pitch, yaw]) {
  const [cr, sr, cp, sp] = [Math.cos(roll), Math.sin(roll), Math.cos(pitch), Math.sin(pitch)];
  const [cy, sy] = [Math.cos(yaw), Math.sin(yaw)];
  return [
    [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
    [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
    [-sp, cp * sr, cp * cr],
  ];
}

// Components in B of the point p of I, for a robot at `pose`.
export function toBody(pose, p, matrix = rotation(pose.angles)) {
  const d = p.map((x, k) => x - pose.position[k]);
  return [0, 1, 2].map(c => matrix[0][c] * d[0] + matrix[1][c] * d[1] + matrix[2][c] * d[2]);
}

// Unit vector of an axle in B: along x (or `axle`), tilted about y, then turned about z.
export function axle(wheel) {
  const [x, y, z] = wheel.axle ?? [1, 0, 0];
  const tilt = wheel.axle_tilt ?? 0;
  const yaw = wheel.axle_yaw ?? 0;
  const [a, c] = [x * Math.cos(tilt) + z * Math.sin(tilt), z * Math.cos(tilt) - x * Math.sin(tilt)];
  const out = [a * Math.cos(yaw) - y * Math.sin(yaw), a * Math.sin(yaw) + y * Math.cos(yaw), c];
  const length = Math.hypot(...out) || 1;
  return out.map(v => v / length);
}

// Half section of a V-groove wheel, [radius, axial] from one face to the other. The groove's apex lies on the axis
// of symmetry, (width / 2) / tan(angle / 2) below the rim, never inside the hub.
export function grooveSection({ radius, groove_angle: angle, width }, flange = 0.08 * radius, hub = 0.16 * radius) {
  const half = width / 2;
  const apex = Math.max(radius - half / Math.tan(angle / 2), hub + 0.05 * radius);
  return [
    [hub, -half - flange],
    [0.94 * radius, -half - flange],
    [radius, -half - 0.6 * flange],
    [radius, -half],
    [apex, 0],
    [radius, half],
    [radius, half + 0.6 * flange],
    [0.94 * radius, half + flange],
    [hub, half + flange],
  ];
}

// Where rotors stand: four in the corners of the robot's outline. Radius, centres in B.
export function rotors({ across, along, rotor_plane: z = 0 }) {
  const radius = 0.19 * Math.min(across, along);
  const x = across / 2 - radius;
  const y = along / 2 - radius;
  return {
    radius,
    centres: [
      [-x, -y, z],
      [x, -y, z],
      [-x, y, z],
      [x, y, z],
    ],
  };
}

const SAMPLES = 48;

// Least distance between the rotors' plane and the line as it is bent, along z_B over the robot's length: {least,
// before, after} in m, towards the left and the right support. Negative: the line cuts the plane. Null: not known.
// The same as orchestrator/report/page/gap.py.
export function clearance(model, t, prefix = '') {
  const { robot, line } = model.head;
  const pose = model.pose(t, prefix);
  const nodes = line && model.line(t, prefix + model.linePrefix);
  if (!robot?.along || !pose || !nodes) return null;
  const sign = robot.layout === 'bottom' ? -1 : 1;
  const half = robot.along / 2;
  const matrix = rotation(pose.angles);
  const middle = contactArc(model, t, prefix);
  const found = { before: Infinity, after: Infinity };
  const p = [0, 0, 0];
  const take = (y, z) => {
    const gap = sign * (z - (robot.rotor_plane ?? 0));
    const side = y < 0 ? 'before' : 'after';
    if (gap < found[side]) found[side] = gap;
  };
  let last = null;
  for (let i = 0; i <= SAMPLES; i++) {
    const s = middle + 1.3 * half * ((2 * i) / SAMPLES - 1);
    if (s < nodes.s[0] || s > nodes.s[nodes.s.length - 1]) continue;
    const [, y, z] = toBody(pose, hermite(nodes, s, p), matrix);
    for (const rim of [-half, half])
      if (last && (last.y - rim) * (y - rim) < 0) take(rim, last.z + ((z - last.z) * (rim - last.y)) / (y - last.y));
    if (Math.abs(y) <= half) take(y, z);
    last = { y, z };
  }
  const least = Math.min(found.before, found.after);
  return Number.isFinite(least) ? { least, ...found } : null;
}

// Point and tangent of the line at a wheel: as the cable says, else from the shape.
export function touch(model, t, prefix, k) {
  const [point, tangent] = ['position', 'tangent'].map(what => model.vector(`${prefix}cable.port[${k}].${what}`, t));
  if ([...point, ...tangent].every(Number.isFinite)) return { point, tangent };
  const nodes = model.line(t, prefix + model.linePrefix);
  const s = model.at(`${prefix}contact${k}.cable.s`, t);
  if (nodes) hermite(nodes, Number.isFinite(s) ? s : contactArc(model, t, prefix), point, tangent);
  return { point, tangent };
}

// Arc length of the line under the robot: the mean of the contacts', else where it landed.
export function contactArc(model, t, prefix = '') {
  const found = model.contacts.map(k => model.at(`${prefix}contact${k}.cable.s`, t)).filter(Number.isFinite);
  if (found.length) return found.reduce((a, b) => a + b, 0) / found.length;
  return model.head.landing_position ?? model.head.span?.length / 2 ?? 0;
}

// Angle that a wheel has turned about its axle relative to the body, at every communication point.
export function spin(model, k) {
  const time = model.time;
  const n = time.length;
  const out = new Float64Array(n);
  const names = ['x', 'y', 'z'].map(c => [
    `robot.wheel[${k}].angular_velocity.${c}`,
    `robot.body.angular_velocity.${c}`,
  ]);
  const parts = names.map(([a, b], c) => [
    model.get(a),
    model.get(b),
    model.get(`robot.wheel[${k}].axle.${'xyz'[c]}`),
  ]);
  if (parts.some(p => p.some(v => !v))) return out;
  const rate = i => parts.reduce((sum, [w, b, a]) => sum + (w[i] - b[i]) * a[i], 0);
  for (let i = 1, last = rate(0); i < n; i++) {
    const now = rate(i);
    const turned = ((last + now) / 2) * (time[i] - time[i - 1]);
    out[i] = out[i - 1] + (Number.isFinite(turned) ? turned : 0);
    last = now;
  }
  return out;
}
