// What stands in the scene for a model: supports, line, robot, path, reference. Made anew only where it changed.
import {
  BufferAttribute,
  BufferGeometry,
  Group,
  Line,
  LineBasicMaterial,
  LineDashedMaterial,
  MeshBasicMaterial,
  MeshPhongMaterial,
} from 'three';
import { Cable, strandMaterial } from './cable.js';
import { css } from './dom.js';
import { contactArc, spin } from './geometry.js';
import { chord, hermite } from './model.js';
import { buildRobot, materials } from './robot.js';
import { supportPalette, Supports } from './supports.js';

const GHOST = 1.15; // the reference's line is a little thicker, so that it is seen about the other
const BLADE_SPEED = 31; // rad/s: to be seen, not to be true

const drawnLine = (material, points) => {
  const positions = new BufferAttribute(new Float32Array(3 * points), 3);
  const geometry = new BufferGeometry().setAttribute('position', positions);
  return Object.assign(new Line(geometry, material), { frustumCulled: false });
};

export class Content {
  #keys = {};

  constructor() {
    this.group = new Group();
    this.palette = { ...materials(), ...supportPalette(), strands: strandMaterial() };
    this.dashed = new LineDashedMaterial();
    this.path = new LineBasicMaterial();
    this.nothing = new MeshBasicMaterial({ visible: false });
    // where both are in the same place the run is seen, not a mixture
    const behind = { polygonOffset: true, polygonOffsetFactor: 2, polygonOffsetUnits: 8 };
    this.pale = new MeshPhongMaterial({ transparent: true, opacity: 0.4, depthWrite: false, ...behind });
  }

  show(model) {
    this.model = model;
    this.rest = model.line(model.start);
    this.span = spanOf(model.head.span, this.rest);
    this.sag = this.span && this.rest ? lowest(this.rest, this.span) : 0;
    this.radius = (model.head.cable_diameter ?? 0.02) / 2;
    this.landing = contactArc(model, model.start);
    this.#made('towers', this.span, () => new Supports(this.span, this.palette));
    this.#made('robot', model.head.robot, () => buildRobot(model.head.robot, this.palette));
    this.#lines(model);
    this.#reference(model);
    this.peak = largestForce(model);
    this.turned = (this.robot?.wheels ?? []).map((_, k) => spin(model, k + 1));
    this.home = this.rest ? hermite(this.rest, this.landing) : (model.pose(model.start)?.position ?? [0, 0, 0]);
  }

  // The thing under `key`, made anew where what decides about it has changed; none where that is null.
  #made(key, decides, make) {
    const now = JSON.stringify(decides ?? null);
    if (now === this.#keys[key]) return;
    this.#keys[key] = now;
    const object = thing => thing.group ?? thing.mesh ?? thing;
    if (this[key]) {
      this.group.remove(object(this[key]));
      object(this[key]).traverse(node => node.geometry?.dispose());
    }
    this[key] = decides ? make() : null;
    if (this[key]) this.group.add(object(this[key]));
  }

  #lines(model) {
    const arc = this.rest?.s;
    const shape = arc && [arc.length, arc[arc.length - 1], this.radius, this.landing];
    this.#made('cable', shape, () => new Cable(arc, this.radius, [this.landing], this.palette.strands));
    this.#made('atRest', shape, () => drawnLine(this.dashed, this.cable.s.length));
    const points = model.head.robot && model.time.length > 1 ? model.time.length : null;
    this.#made('trace', points, () => drawnLine(this.path, points));
  }

  // The reference: a pale robot and line.
  #reference(model) {
    const nodes = model.hasReference ? model.line(model.start, `reference/${model.linePrefix}`) : null;
    // whatever a part is made of, but for the discs: they would tint those of the run
    const pale = new Proxy({}, { get: (_, name) => (name === 'glass' ? this.nothing : this.pale) });
    const robot = model.hasReference ? model.head.robot : null;
    this.#made('ghostRobot', robot, () => buildRobot(robot, pale));
    const shape = nodes && [nodes.s.length, this.radius, this.landing];
    this.#made('ghostLine', shape, () => new Cable(nodes.s, GHOST * this.radius, [this.landing], this.pale));
  }

  theme() {
    this.dashed.color.set(css('--rest'));
    this.path.color.set(css('--trace'));
    this.pale.color.set(css('--ghost'));
    this.palette.tower.color.set(css('--tower'));
    this.palette.frame.color.set(css('--frame'));
  }

  // Where the robot is seen: the heights between which it moves, its own size included, and its reach.
  get surroundings() {
    const { low = -0.5, high = 0.5, reach = 1.25 } = this.robot ?? {};
    const heights = Array.from(this.model.get('robot.body.position.z') ?? []).filter(Number.isFinite);
    const [least, most] = heights.length ? extremes(heights) : [this.home[2], this.home[2]];
    return {
      at: this.home,
      low: least + low,
      high: Math.max(most + high, this.home[2]),
      reach,
      hangs: this.model.head.robot?.layout !== 'bottom',
      span: this.span,
      sag: this.sag,
    };
  }

  // Wheels turn with their measured angle; rotors stand still where there is no thrust.
  turn(t, i, f) {
    this.robot?.wheels.forEach((wheel, k) => {
      const angle = this.turned[k];
      wheel.rotation.y = angle.length > 1 ? angle[i] * (1 - f) + angle[i + 1] * f : 0;
    });
    if (!this.robot?.blades.length || !(Math.abs(this.model.at('robot.thrust', t)) > 1e-6)) return;
    for (const blade of this.robot.blades) blade.rotation.z = blade.userData.sense * BLADE_SPEED * t;
  }
}

const extremes = values => values.reduce(([a, b], x) => [Math.min(a, x), Math.max(b, x)], [Infinity, -Infinity]);

// A line without a described span hangs from its own ends.
function spanOf(span, rest) {
  if (!span?.left && !rest) return null;
  const left = span?.left ?? [...rest.position.slice(0, 3)];
  const right = span?.right ?? [...rest.position.slice(-3)];
  return { left, right, length: Math.hypot(...left.map((x, c) => right[c] - x)) };
}

// How far the line hangs below the chord between its supports.
function lowest(nodes, span) {
  let most = 0;
  for (let j = 0; j < nodes.position.length; j += 3) {
    most = Math.max(most, chord(span, nodes.position[j + 1]) - nodes.position[j + 2]);
  }
  return most;
}

// Largest force of the landing, to which arrows are drawn.
function largestForce(model) {
  let peak = 0;
  for (const k of model.contacts) {
    const [x, y, z] = ['x', 'y', 'z'].map(c => model.get(`contact${k}.wheel.force.${c}`) ?? []);
    for (let i = 0; i < x.length; i++) {
      const force = Math.hypot(x[i], y[i], z[i]);
      if (force > peak) peak = force;
    }
  }
  return peak;
}
