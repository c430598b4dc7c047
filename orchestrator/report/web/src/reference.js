// How far a run is from its reference, and by how much the difference is exaggerated to be seen.

const VISIBLE = { length: 0.08, angle: 0.15 }; // m, rad: what a difference may become in the picture
const STEP = 2 ** -24; // of 32-bit numbers, relative
const GRAIN = 0.01; // m that their steps may become

// Largest difference of position, m, and of attitude, rad, over the run.
export function difference(model) {
  const worst = names =>
    Math.max(
      ...names.map(name => {
        const ours = model.get(name);
        const theirs = model.atOwnTimes(`reference/${name}`);
        if (!ours || !theirs) return 0;
        let found = 0;
        for (let i = 0; i < ours.length; i++) {
          const d = Math.abs(ours[i] - theirs[i]);
          if (d > found && Number.isFinite(d)) found = d;
        }
        return found;
      }),
    );
  return {
    length: worst(['x', 'y', 'z'].map(c => `robot.body.position.${c}`)),
    angle: worst(['roll', 'pitch', 'yaw'].map(a => `robot.${a}`)),
    place: Math.abs(model.first('robot.body.position.y')) || 1,
  };
}

// The largest power of ten that keeps the difference in the picture, and the steps of 32-bit numbers out of it.
export function exaggerated({ length, angle, place }) {
  const most = Math.min(VISIBLE.length / (length || 1e-12), VISIBLE.angle / (angle || 1e-12));
  return 10 ** Math.max(0, Math.floor(Math.log10(Math.min(most, GRAIN / (STEP * (place || 1))))));
}

const mix = (ours, theirs, times) => ours.map((x, i) => x + times * (theirs[i] - x));

// The reference's pose, its difference from ours taken so many times.
export const moved = (ours, theirs, times) => ({
  position: mix(ours.position, theirs.position, times),
  angles: mix(ours.angles, theirs.angles, times),
});

// The same of the line; on another mesh, or without ours, it is drawn where it is.
export function movedLine(ours, theirs, times) {
  if (!ours || ours.position.length !== theirs.position.length) return theirs;
  const [position, slope] = ['position', 'slope'].map(what => mix(ours[what], theirs[what], times));
  return { s: theirs.s, position, slope };
}
