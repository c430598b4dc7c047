// How far a run is from its reference, and by how much the difference is exaggerated to be seen.

const VISIBLE = { length: 0.08, angle: 0.15 };   // m, rad: what a difference may become in the picture

// Largest difference of position, m, and of attitude, rad, over the run.
export function difference(model) {
  const worst = names => Math.max(...names.map(name => {
    const ours = model.get(name), theirs = model.atOwnTimes(`reference/${name}`);
    if (!ours || !theirs) return 0;
    let found = 0;
    for (let i = 0; i < ours.length; i++) {
      const d = Math.abs(ours[i] - theirs[i]);
      if (d > found && Number.isFinite(d)) found = d;
    }
    return found;
  }));
  return {
    length: worst(['x', 'y', 'z'].map(c => `robot.body.position.${c}`)),
    angle: worst(['roll', 'pitch', 'yaw'].map(a => `robot.${a}`)),
  };
}

// The largest power of ten that keeps the difference in the picture; 1 to a million.
export function exaggerated({ length, angle }) {
  const most = Math.min(VISIBLE.length / (length || 1e-12), VISIBLE.angle / (angle || 1e-12), 1e6);
  return 10 ** Math.max(0, Math.floor(Math.log10(most)));
}
