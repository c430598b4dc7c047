// The landing in three dimensions: cameras and one frame after the other. Draws on demand; knows no controls.
import {
  Color,
  DirectionalLight,
  Euler,
  Fog,
  HemisphereLight,
  PerspectiveCamera,
  Scene,
  Vector3,
  WebGLRenderer,
} from 'three';
import { OrbitControls } from 'three/examples/jsm/controls/OrbitControls.js';
import { camera, FIELD } from './cameras.js';
import { Content } from './content.js';
import { css } from './dom.js';
import { Forces, keyOfForces } from './forces.js';
import { contactArc } from './geometry.js';
import { chord, hermite, locate } from './model.js';
import { difference, exaggerated, moved, movedLine } from './reference.js';
import { Ground, groundBelow } from './supports.js';

const pixelsOf = canvas => {
  const ratio = Math.min(devicePixelRatio || 1, 2);
  return [canvas.clientWidth, canvas.clientHeight].map(length => Math.max(1, Math.round(length * ratio)));
};

export class View {
  options = { heights: 1, size: 1, forces: 'total', trace: true, reference: null };
  name = 'landing';
  #stale = true; // what depends on the scales alone has to be drawn anew

  constructor(canvas, invalidate) {
    // before there is a context: a buffer that changes its size is made twice
    [canvas.width, canvas.height] = pixelsOf(canvas);
    // asked here and not by three, which would complain on the console where there is none
    const context = canvas.getContext('webgl2', { antialias: true, alpha: true });
    if (!context) throw new Error('no WebGL 2');
    this.canvas = canvas;
    this.renderer = new WebGLRenderer({ canvas, context });
    this.renderer.debug.checkShaderErrors = false; // asking for errors would wait for the compiler, shader by shader
    this.camera = new PerspectiveCamera(FIELD, 1, 0.02, 4000);
    this.camera.up.set(0, 0, 1);
    this.invalidate = invalidate;
    this.content = new Content();
    this.ground = new Ground();
    this.forces = new Forces();
    this.#light();
    this.#orbit(canvas);
  }

  #light() {
    const sun = new DirectionalLight(0xffffff, 2.2);
    sun.position.set(40, -30, 60);
    this.scene = new Scene();
    this.scene.add(new HemisphereLight(0xffffff, 0x8a9299, 2.0), sun);
    this.scene.add(this.ground.mesh, this.content.group, ...this.forces.arrows.meshes);
  }

  #orbit(canvas) {
    this.controls = new OrbitControls(this.camera, canvas);
    const limits = { maxDistance: 3000, minDistance: 0.1 };
    Object.assign(this.controls, { ...limits, enableDamping: true, enableZoom: false });
    canvas.style.touchAction = 'pan-y'; // a page that cannot be scrolled past its picture is a trap on a phone
    this.controls.addEventListener('change', this.invalidate);
    // the wheel zooms only once the picture was chosen; until then it scrolls the page
    canvas.addEventListener('pointerdown', () => (this.controls.enableZoom = true));
    canvas.addEventListener('blur', () => (this.controls.enableZoom = false));
    canvas.addEventListener('keydown', event => this.#zoomKey(event));
  }

  #zoomKey(event) {
    const factor = { '+': 0.8, '=': 0.8, '-': 1.25 }[event.key];
    if (!factor) return;
    this.camera.position.sub(this.controls.target).multiplyScalar(factor).add(this.controls.target);
    this.invalidate();
  }

  show(model) {
    const first = !this.model;
    const moves = first || model.head.landing_position !== this.model.head.landing_position;
    this.model = model;
    this.content.show(model);
    if (model.hasReference) this.options.reference ??= exaggerated(difference(model));
    this.theme();
    if (moves) this.view(this.name);
    this.#stale = true;
    if (first) this.renderer.compile(this.scene, this.camera); // shaders are made while the rest of the page is
  }

  theme() {
    const fog = css('--sky-low');
    this.scene.fog = new Fog(new Color(fog), ...this.#mist());
    this.ground.colour(css('--grid'), fog);
    this.content.theme();
    this.invalidate();
  }

  #mist() {
    const length = this.content.span?.length ?? 50;
    if (this.name === 'span') return [3 * length, 8 * length];
    return [Math.max(0.12 * length, 25), Math.max(1.3 * length, 260)];
  }

  // What the key under the picture has to explain: [class, words].
  legend() {
    const { forces, trace, reference } = this.options;
    const found = keyOfForces(forces, this.content.peak);
    if (trace && this.content.trace) found.push(['trace', 'path of the robot']);
    if (this.content.atRest) found.push(['rest', 'line before landing']);
    const times = reference > 1 ? `, difference ×${reference.toLocaleString('en')}` : '';
    if (reference && this.model.hasReference) found.push(['ghost', `reference${times}`]);
    return found;
  }

  // ---- cameras ------------------------------------------------------------------------------------------------

  // Fit the canvas to its place, in pixels of the screen.
  size() {
    const { canvas } = this;
    const [width, height] = pixelsOf(canvas);
    if (canvas.width !== width || canvas.height !== height) this.renderer.setSize(width, height, false);
    const aspect = width / height;
    const reshaped = Math.abs(aspect - this.camera.aspect) > 0.25;
    Object.assign(this.camera, { aspect }).updateProjectionMatrix();
    this.perPixel = Math.tan((FIELD * Math.PI) / 360) / canvas.clientHeight;
    if (reshaped && this.model) this.view(this.name);
  }

  view(name) {
    this.name = name;
    if (!this.model) return;
    const around = { ...this.content.surroundings, aspect: this.camera.aspect };
    const { target, eye, heights, size, follow } = camera(name, around);
    Object.assign(this.options, { heights, size });
    this.follow = follow;
    this.followed = this.content.home;
    this.controls.target.set(...target);
    this.camera.position.set(...eye);
    this.camera.near = name === 'span' ? 0.5 : 0.02;
    this.camera.updateProjectionMatrix();
    [this.scene.fog.near, this.scene.fog.far] = this.#mist();
    this.#stale = true;
    this.invalidate();
  }

  // Other scales, with the robot kept in the picture.
  set(options) {
    const before = this.place(this.content.home);
    Object.assign(this.options, options);
    const step = this.place(this.content.home).map((x, c) => x - before[c]);
    this.#shift(step);
    this.followed = this.followed.map((x, c) => x + step[c]);
    this.#stale = true;
    this.invalidate();
  }

  #followTo(point) {
    if (!this.follow || !point) return;
    const now = this.place(point);
    this.#shift(now.map((x, c) => x - this.followed[c]));
    this.followed = now;
  }

  #shift(step) {
    this.controls.target.add(new Vector3(...step));
    this.camera.position.add(new Vector3(...step));
  }

  // ---- one frame ----------------------------------------------------------------------------------------------

  // Heights are exaggerated about the chord between the supports.
  place = p => {
    const { span } = this.content;
    const { heights } = this.options;
    if (heights === 1 || !span) return p;
    const level = chord(span, p[1]);
    return [p[0], p[1], level + heights * (p[2] - level)];
  };

  update(t) {
    if (!this.model) return;
    const { model, content } = this;
    const nodes = model.line(t);
    const pose = model.pose(t);
    const anchor = nodes ? hermite(nodes, contactArc(model, t)) : pose?.position;
    this.#followTo(anchor);
    if (this.controls.update()) this.invalidate();
    if (this.#stale) this.#still();
    if (nodes) content.cable?.shape(nodes, this.place, this.camera.position, this.perPixel);
    this.#pose(content.robot, pose, anchor);
    this.#ghost(t, nodes, pose, anchor);
    const [i, f] = locate(model.time, t);
    content.turn(t, i, f);
    this.#trace(i + Math.round(f));
    const { forces, size } = this.options;
    const look = { place: this.place, eye: this.camera.position, kind: forces, size, near: this.name === 'wheel' };
    this.forces.draw(model, t, content.peak, look);
    this.renderer.render(this.scene, this.camera);
  }

  // What does not move with time, at the present scales: line at rest, path, ground.
  #still() {
    this.#stale = false;
    const { span, rest, sag, cable, atRest, dashed } = this.content;
    const { heights, size } = this.options;
    if (span) this.#layGround(span, heights * sag);
    if (rest) {
      cable.shape(rest, this.place, this.camera.position, this.perPixel);
      atRest.geometry.attributes.position.copyArray(cable.centre).needsUpdate = true;
      Object.assign(dashed, { dashSize: 0.05 * size, gapSize: 0.04 * size });
      atRest.computeLineDistances();
    }
    if (this.content.trace) this.#path(this.content.trace.geometry.attributes.position);
  }

  #layGround({ left, right, length }, sag) {
    const ground = Math.min(left[2], right[2]) - groundBelow(length, sag);
    this.content.towers.stand(ground);
    this.ground.lay([(left[0] + right[0]) / 2, (left[1] + right[1]) / 2], ground, length);
  }

  // The robot is drawn about the point where it touches the line, which the exaggeration of heights moves.
  #anchored(position, anchor) {
    const q = this.place(anchor);
    return position.map((x, c) => q[c] + this.options.size * (x - anchor[c]));
  }

  #path(points) {
    const of = name => ['x', 'y', 'z'].map(c => this.model.get(`${name}.${c}`));
    const body = of('robot.body.position');
    const port = of('cable.port[1].position');
    let last = this.content.home;
    for (let i = 0; i < this.model.time.length; i++) {
      const b = body.map(values => values?.[i]);
      const anchor = port.every(Boolean) ? port.map(values => values[i]) : b;
      if ([...b, ...anchor].every(Number.isFinite)) last = this.#anchored(b, anchor);
      points.array.set(last, 3 * i);
    }
    points.needsUpdate = true;
  }

  #trace(points) {
    const { trace } = this.content;
    if (!trace) return;
    trace.visible = this.options.trace;
    trace.geometry.setDrawRange(0, Math.max(2, points + 1));
  }

  #pose(robot, pose, anchor) {
    if (!robot) return;
    robot.group.visible = Boolean(pose);
    if (!pose) return;
    robot.group.position.set(...this.#anchored(pose.position, anchor));
    robot.group.quaternion.setFromEuler(new Euler(...pose.angles, 'ZYX'));
    robot.group.scale.setScalar(this.options.size);
  }

  // The reference, with its difference from the run as many times as was chosen.
  #ghost(t, nodes, pose, anchor) {
    const { ghostLine, ghostRobot } = this.content;
    const times = this.model.hasReference ? this.options.reference : 0;
    const line = times && ghostLine ? this.model.line(t, `reference/${this.model.linePrefix}`) : null;
    const theirs = times && ghostRobot && pose ? this.model.pose(t, 'reference/') : null;
    if (ghostLine) ghostLine.mesh.visible = Boolean(line);
    if (line) ghostLine.shape(movedLine(nodes, line, times), this.place, this.camera.position, this.perPixel);
    this.#pose(ghostRobot, theirs && moved(pose, theirs, times), anchor);
  }

  info() {
    return { ...this.renderer.info.render, programs: this.renderer.info.programs.length };
  }

  // Where things are drawn, for tests: the first wheel's centre and point b, in the scene's own coordinates.
  state() {
    const { robot } = this.content;
    const wheel = robot?.wheels[0]?.getWorldPosition(new Vector3()).toArray() ?? null;
    const places = { robot: robot?.group.position.toArray() ?? null, camera: this.camera.position.toArray() };
    return { view: this.name, ...this.options, ...places, wheel };
  }
}
