// A robot drawn from its catalogue entry: wheels with their grooves and axles, rotors, body, to size. Frame b.
import {
  BoxGeometry,
  CapsuleGeometry,
  CircleGeometry,
  CylinderGeometry,
  DoubleSide,
  Group,
  LatheGeometry,
  Mesh,
  MeshBasicMaterial,
  MeshPhongMaterial,
  Quaternion,
  TorusGeometry,
  Vector2,
  Vector3,
} from 'three';
import { mergeGeometries, toCreasedNormals } from 'three/examples/jsm/utils/BufferGeometryUtils.js';
import { axle, grooveSection, rotors } from './geometry.js';

const UP = new Vector3(0, 1, 0); // three's cylinders stand along y
const FORK = 0.02; // between a wheel's face and its fork, m
const CREASE = 0.6; // rad; edges sharper than this stay edges

export function materials() {
  return {
    shell: new MeshPhongMaterial({ color: 0x2f6fb3, shininess: 50, specular: 0x333333 }),
    frame: new MeshPhongMaterial({ color: 0x333940, shininess: 30, specular: 0x222222 }),
    rim: new MeshPhongMaterial({ color: 0xd98a1f, shininess: 70, specular: 0x444444 }),
    glass: new MeshBasicMaterial({
      color: 0x6aa9e0,
      transparent: true,
      opacity: 0.16,
      side: DoubleSide,
      depthWrite: false,
    }),
  };
}

// Geometries collected by material, so that a robot costs few draw calls.
class Parts {
  constructor() {
    this.byMaterial = {};
  }

  add(material, geometry, x = 0, y = 0, z = 0) {
    const plain = (geometry.index ? geometry.toNonIndexed() : geometry).translate(x, y, z);
    plain.deleteAttribute('uv');
    (this.byMaterial[material] ??= []).push(plain);
  }

  // A round bar from a to b.
  bar(material, a, b, radius, sides = 10) {
    const from = new Vector3(...a);
    const along = new Vector3(...b).sub(from);
    const length = along.length();
    if (length < 1e-6) return;
    const geometry = new CylinderGeometry(radius, radius, length, sides);
    geometry.applyQuaternion(new Quaternion().setFromUnitVectors(UP, along.normalize()));
    this.add(material, geometry, ...from.addScaledVector(along, length / 2).toArray());
  }

  into(group, palette) {
    for (const [name, geometries] of Object.entries(this.byMaterial))
      group.add(new Mesh(mergeGeometries(geometries), palette[name]));
    return group;
  }
}

// {group, wheels: [turning groups], blades: [groups]}; blades are there only where the rotors have thrust to turn for.
export function buildRobot(spec, palette) {
  const parts = new Parts();
  const group = new Group();
  const size = complete(spec);
  const blades = addRotors(parts, size, spec.thrust ? palette : null);
  (size.layout === 'bottom' ? addStandingBody : addHangingBody)(parts, size);
  const wheels = size.wheels.map(wheel => buildWheel(wheel, palette));
  for (const wheel of size.wheels) addFork(parts, wheel, size);
  parts.into(group, palette);
  group.add(...wheels.map(w => w.group), ...blades);
  const reach = Math.max(size.across, size.along);
  const [low, high] = heightsOf(size);
  return { group, wheels: wheels.map(w => w.turning), blades, reach, low, high };
}

// The specification, with usual values for what it does not say: of a robot from elsewhere much is not known.
function complete(spec) {
  const known = values =>
    Object.fromEntries(Object.entries(values ?? {}).filter(([, value]) => value !== null && value !== undefined));
  const wheels = (spec.wheels ?? []).map(w => ({
    radius: 0.075,
    width: 0.08,
    groove_angle: 1.745,
    mount: [0, 0, 0],
    ...known(w),
  }));
  const size = { across: 0.8, along: 0.8, height: 0.6, rotor_plane: 0, layout: 'top', ...known(spec) };
  const z = wheels.map(w => w.mount[2]);
  const radius = Math.max(0.02, ...wheels.map(w => w.radius));
  const top = wheels.length ? Math.max(...z) + radius : 0.2;
  const line = wheels.length ? Math.min(...z) - 0.7 * radius : -0.2;
  return { below_line: 0.25, ...size, wheels, radius, top, line };
}

// Lowest and highest point of what is drawn, from b.
function heightsOf({ layout, height, below_line: below, line, top, rotor_plane: z }) {
  if (layout === 'bottom') return [line - below, z + 0.03];
  return [Math.min(top - height, z - 0.3), Math.max(top, z + 0.03)];
}

function addRotors(parts, size, palette) {
  const { radius, centres } = rotors(size);
  const thick = Math.max(0.004, 0.012 * radius * 5);
  const blades = [];
  for (const [x, y, z] of centres) {
    parts.bar('frame', [0, 0, z - 0.03], [x, y, z - 0.03], 0.014);
    parts.add('frame', new CylinderGeometry(0.026, 0.03, 0.05, 14).rotateX(Math.PI / 2), x, y, z - 0.018);
    parts.add('shell', new TorusGeometry(radius, Math.min(thick, 0.008), 6, 40), x, y, z);
    parts.add('glass', new CircleGeometry(radius, 32), x, y, z);
    const blade = new BoxGeometry(1.9 * radius, 0.028, 0.004).rotateZ(0.6 * Math.sign(x) + Math.sign(y));
    if (palette) blades.push(turningBlade(blade, palette, x, y, z));
    else parts.add('frame', blade, x, y, z + 0.006);
  }
  return blades;
}

function turningBlade(geometry, palette, x, y, z) {
  const mesh = new Mesh(geometry, palette.frame);
  mesh.position.set(x, y, z + 0.006);
  mesh.userData.sense = Math.sign(x * y) || 1; // neighbours turn against each other
  return mesh;
}

// Hangs from the line: body and battery below the rotors, skids down to the robot's height.
function addHangingBody(parts, { across, along, height, top, rotor_plane: z }) {
  const w = (0.085 * Math.min(across, 1.25)) / 1.25 + 0.02;
  const low = Math.min(top - height, z - 0.3);
  parts.add('shell', new CapsuleGeometry(w, 0.26 * along, 6, 20).scale(1.25, 1, 0.8), 0, 0, z - 0.07);
  parts.add('frame', new BoxGeometry(1.7 * w, 0.26 * along, 0.09), 0, 0, z - 0.19);
  for (const side of [-1, 1]) {
    const x = side * 0.2 * across;
    for (const y of [-0.12 * along, 0.12 * along])
      parts.bar('frame', [side * 0.8 * w, y, z - 0.12], [x, y, low + 0.012], 0.011);
    parts.bar('frame', [x, -0.28 * along, low + 0.012], [x, 0.28 * along, low + 0.012], 0.013);
  }
}

// Stands on the line: body under the rotors, battery packs on both sides below the line.
function addStandingBody(parts, { across, along, height, below_line: below, line, rotor_plane: z, wheels, radius }) {
  const low = line - below;
  const body = 0.6 * (z - line - radius);
  const y = reachOf(wheels, along);
  parts.add('shell', new CapsuleGeometry(0.06, y, 6, 20).scale(1.5, 1, 0.75), 0, 0, z - 0.06);
  parts.add('frame', new BoxGeometry(0.09, y + 0.1, 0.035), 0, 0, z - 0.115);
  const tall = Math.min(0.45 * height, 0.8 * (line - low));
  const x = Math.max(0.24 * across, 0.14);
  for (const side of [-1, 1]) {
    parts.add('frame', new BoxGeometry(0.09, 0.5 * along, tall), side * x, 0, low + tall / 2);
    parts.add('shell', new BoxGeometry(0.094, 0.42 * along, 0.24 * tall), side * x, 0, low + 0.62 * tall);
    for (const end of [-0.2 * along, 0.2 * along]) {
      parts.bar('frame', [side * 0.04, end, z - 0.1], [side * x, end, z - Math.min(0.16, body)], 0.012);
      parts.bar('frame', [side * x, end, z - Math.min(0.16, body)], [side * x, end, low + tall], 0.012);
    }
  }
}

const reachOf = (wheels, along) => Math.max(0.3 * along, ...wheels.map(w => 2 * Math.abs(w.mount[1])));

// Both sides of a wheel are held: the line passes between the arms.
function addFork(parts, wheel, { layout, rotor_plane: z }) {
  const out = wheel.width / 2 + 0.08 * wheel.radius + FORK;
  const [x, y, z0] = wheel.mount;
  const a = axle(wheel);
  const end = layout === 'bottom' ? z - 0.1 : z - 0.05;
  const arm = layout === 'bottom' ? 0.008 : 0.011;
  for (const side of [-1, 1]) {
    const hub = [x + side * out * a[0], y + side * out * a[1], z0 + side * out * a[2]];
    const beyond = z0 + Math.sign(z0 - end) * 0.03;
    const bar = new BoxGeometry(2 * arm, 0.045, Math.abs(beyond - end));
    parts.add('frame', bar, hub[0], hub[1], (beyond + end) / 2);
  }
}

// A V-groove wheel: rim as a lathe along the axle; bolts and spokes show how it turns.
export function buildWheel(wheel, palette) {
  const { radius, width } = wheel;
  const face = width / 2 + 0.08 * radius;
  const parts = new Parts();
  const section = grooveSection(wheel).map(([r, along]) => new Vector2(r, along));
  parts.add('rim', toCreasedNormals(new LatheGeometry(section, 40), CREASE));
  parts.bar('frame', [0, -face - FORK - 0.012, 0], [0, face + FORK + 0.012, 0], 0.16 * radius + 0.002, 16);
  for (const side of [-1, 1]) {
    for (let k = 0; k < 3; k++) {
      parts.add(
        'frame',
        new BoxGeometry(1.6 * radius, 0.004, 0.14 * radius).rotateY((k * Math.PI) / 3),
        0,
        side * (face + 0.002),
        0,
      );
    }
    for (let k = 0; k < 6; k++) {
      const f = ((k + 0.5) * Math.PI) / 3;
      const r = 0.72 * radius;
      parts.add(
        'frame',
        new CylinderGeometry(0.05 * radius, 0.05 * radius, 0.006, 8),
        r * Math.cos(f),
        side * (face + 0.001),
        r * Math.sin(f),
      );
    }
  }
  const group = new Group();
  const turning = parts.into(new Group(), palette);
  group.position.set(...wheel.mount);
  group.quaternion.setFromUnitVectors(UP, new Vector3(...axle(wheel)));
  group.add(turning);
  return { group, turning };
}
