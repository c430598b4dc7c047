// Forces between wheels and line as arrows: total, or normal and along the line.
import { Arrows } from './arrows.js';
import { css } from './dom.js';
import { touch } from './geometry.js';

const MOST_ARROWS = 32;
const LEAST_FORCE = 0.01; // N: less is noise
const FAR = { longest: 0.6, thick: 0.8, aside: 0.12 }; // m, for a robot drawn to its size
const NEAR = { longest: 0.3, thick: 0.3, aside: 0.1 };

export class Forces {
  arrows = new Arrows(MOST_ARROWS);

  // `view` says how it looks: {place, eye, kind, size, near}; `peak` is the force that the longest arrow stands for.
  draw(model, t, peak, view) {
    this.arrows.clear();
    if (view.kind === 'none' || !(peak > LEAST_FORCE)) return;
    const { longest, thick, aside } = view.near ? NEAR : FAR;
    for (const k of model.contacts) {
      const force = model.vector(`contact${k}.wheel.force`, t);
      const { point, tangent } = touch(model, t, '', k);
      if (![...force, ...point, ...tangent].every(Number.isFinite)) continue;
      const from = [...view.place(point)];
      from[0] += Math.sign(view.eye.x - from[0]) * aside * view.size; // beside the wheel, not in it
      for (const [vector, colour] of parts(force, tangent, view.kind)) {
        const length = (Math.hypot(...vector) / peak) * longest * view.size;
        this.arrows.add(from, vector, length, thick * view.size, css(colour));
      }
    }
  }
}

const minus = v => v.map(x => -x);

function parts(force, tangent, kind) {
  if (kind === 'total')
    return [
      [force, '--f-robot'],
      [minus(force), '--f-cable'],
    ];
  const along = force.reduce((sum, x, c) => sum + x * tangent[c], 0) / Math.hypot(...tangent) ** 2;
  const friction = tangent.map(x => along * x);
  const normal = force.map((x, c) => x - friction[c]);
  const onRobot = [
    [normal, '--f-robot'],
    [friction, '--f-friction'],
  ];
  return [...onRobot, [minus(normal), '--f-cable'], [minus(friction), '--f-cable']];
}

// What the key has to explain: [class, words].
export function keyOfForces(kind, peak) {
  if (kind === 'none' || !(peak > LEAST_FORCE)) return [];
  const longest = `${Math.round(peak)} N`;
  if (kind === 'total')
    return [
      ['robot', `force on robot (longest: ${longest})`],
      ['cable', 'force on line'],
    ];
  return [
    ['robot', `normal force on robot (longest: ${longest})`],
    ['friction', 'along the line'],
    ['cable', 'on line'],
  ];
}
