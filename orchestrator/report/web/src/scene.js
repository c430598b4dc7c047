// The landing in three dimensions: line, robot, forces, path, reference. Draws on demand; knows no controls.
import {
  BufferAttribute, BufferGeometry, Color, DirectionalLight, Euler, Fog, Group, HemisphereLight, Line, LineBasicMaterial,
  LineDashedMaterial, MeshPhongMaterial, PerspectiveCamera, Scene, Vector3, WebGLRenderer,
} from 'three';
import { OrbitControls } from 'three/examples/jsm/controls/OrbitControls.js';
import { Arrows } from './arrows.js';
import { Cable, strandMaterial } from './cable.js';
import { camera, FIELD } from './cameras.js';
import { css } from './dom.js';
import { contactArc, spin, touch } from './geometry.js';
import { chord, hermite, locate } from './model.js';
import { difference, exaggerated } from './reference.js';
import { buildRobot, materials } from './robot.js';
import { Ground, groundBelow, supportPalette, Supports } from './supports.js';

const MOST_ARROWS = 32, LEAST_FORCE = 0.01,   // N: less is noise
   BLADE_SPEED = 31;   // rad/s: to be seen, not to be true

const line = (material, points) => {
  const geometry = new BufferGeometry().setAttribute('position', new BufferAttribute(new Float32Array(3 * points), 3));
  return Object.assign(new Line(geometry, material), { frustumCulled: false });
};

export class View {
  options = { heights: 1, size: 1, forces: 'total', trace: true, reference: 0 };
  name = 'landing';
  #stale = true;   // what depends on the scales alone has to be drawn anew

  constructor(canvas, invalidate) {
    const context = canvas.getContext('webgl2', { antialias: true, alpha: true });   // three would say so on the console
    if (!context) throw new Error('no WebGL 2');
    this.renderer = new WebGLRenderer({ canvas, context });
    this.renderer.debug.checkShaderErrors = false;   // asking for errors would wait for the compiler, shader by shader
    this.scene = new Scene();
    this.camera = new PerspectiveCamera(FIELD, 1, 0.02, 4000);
    this.camera.up.set(0, 0, 1);
    this.invalidate = invalidate;
    this.palette = { ...materials(), ...supportPalette(), strands: strandMaterial() };
    this.content = new Group();
    this.ground = new Ground();
    this.arrows = new Arrows(MOST_ARROWS);
    this.hemi = new HemisphereLight(0xffffff, 0x8a9299, 2.0);
    this.sun = new DirectionalLight(0xffffff, 2.2);
    this.sun.position.set(40, -30, 60);
    this.scene.add(this.hemi, this.sun, this.ground.mesh, this.content, ...this.arrows.meshes);
    this.#orbit(canvas);
  }

  #orbit(canvas) {
    const controls = this.controls = new OrbitControls(this.camera, canvas);
    Object.assign(controls, { enableDamping: true, maxDistance: 3000, minDistance: 0.1, enableZoom: false });
    canvas.style.touchAction = 'pan-y';   // a page that cannot be scrolled past its picture is a trap on a phone
    controls.addEventListener('change', this.invalidate);
    // the wheel zooms only once the picture was chosen; until then it scrolls the page
    canvas.addEventListener('pointerdown', () => { controls.enableZoom = true; });
    canvas.addEventListener('blur', () => { controls.enableZoom = false; });
    canvas.addEventListener('keydown', event => this.#zoomKey(event));
  }

  #zoomKey(event) {
    const factor = { '+': 0.8, '=': 0.8, '-': 1.25 }[event.key];
    if (!factor) return;
    this.camera.position.sub(this.controls.target).multiplyScalar(factor).add(this.controls.target);
    this.invalidate();
  }

  // ---- what is shown ------------------------------------------------------------------------------------------

  show(model) {
    const { head } = model, first = !this.model, moved = !first && head.landing_position !== this.model.head.landing_position;
    this.model = model;
    this.rest = model.line(model.start);
    this.#supports(head);
    this.#robot(head);
    this.#lines(model);
    this.#measure(model);
    this.#reference(model);
    this.theme();
    if (first || moved) this.view(this.name); else this.#stale = true;
    if (first) this.renderer.compile(this.scene, this.camera);   // shaders are made while the rest of the page is
  }

  #replace(key, made) {
    if (this[key]) this.content.remove(this[key].group ?? this[key].mesh ?? this[key]);
    this[key] = made;
    if (made) this.content.add(made.group ?? made.mesh ?? made);
  }

  // Span, supports and sag; a line without a described span hangs from its own ends.
  #supports(head) {
    const at = o => [...this.rest.position.slice(o, o + 3)], last = this.rest ? this.rest.position.length - 3 : 0;
    this.span = head.span?.left ? head.span : this.rest && { left: at(0), right: at(last) };
    if (this.span) this.span = { ...this.span, length: Math.hypot(...[0, 1, 2].map(c => this.span.right[c] - this.span.left[c])) };
    this.sag = this.span && this.rest ? lowest(this.rest, this.span) : 0;
    const key = JSON.stringify(this.span);
    if (key === this.spanKey) return;
    this.spanKey = key;
    this.#replace('towers', this.span ? new Supports(this.span, this.palette) : null);
  }

  #robot(head) {
    const key = JSON.stringify(head.robot ?? null);
    if (key === this.robotKey) return;
    this.robotKey = key;
    this.#replace('robot', head.robot ? buildRobot(head.robot, this.palette) : null);
  }

  #lines(model) {
    const { head, linePrefix } = model, arc = this.rest?.s, radius = (head.cable_diameter ?? 0.02) / 2;
    const focus = contactArc(model, model.start), key = `${arc?.length} ${arc?.[arc.length - 1]} ${radius} ${focus}`;
    this.linePrefix = linePrefix;
    if (key !== this.lineKey) {
      this.lineKey = key;
      this.cable?.dispose();
      this.#replace('cable', arc ? new Cable(arc, radius, [focus], this.palette.strands) : null);
      this.dashed ??= new LineDashedMaterial();
      this.#replace('atRest', arc ? line(this.dashed, this.cable.s.length) : null);
    }
    this.path ??= new LineBasicMaterial();
    this.#replace('trace', head.robot && model.time.length > 1 ? line(this.path, model.time.length) : null);
  }

  // Largest force of the landing, to which arrows are drawn, and how far the wheels have turned.
  #measure(model) {
    this.peak = 0;
    for (const k of model.contacts) {
      const [x, y, z] = ['x', 'y', 'z'].map(c => model.get(`contact${k}.wheel.force.${c}`) ?? []);
      for (let i = 0; i < x.length; i++) {
        const force = Math.hypot(x[i], y[i], z[i]);
        if (force > this.peak) this.peak = force;
      }
    }
    this.turned = (this.robot?.wheels ?? []).map((_, k) => spin(model, k + 1));
  }

  // The reference: a pale robot and line, its difference from the run exaggerated until it can be seen.
  #reference(model) {
    if (!model.hasReference) { this.#replace('ghostRobot', null); this.#replace('ghostLine', null); this.options.reference = 0; return; }
    this.pale ??= new MeshPhongMaterial({ transparent: true, opacity: 0.35, depthWrite: false });
    const pale = new Proxy({}, { get: () => this.pale });
    if (!this.ghostRobot && model.head.robot) this.#replace('ghostRobot', buildRobot(model.head.robot, pale));
    const nodes = model.line(model.start, `reference/${model.linePrefix}`), radius = (model.head.cable_diameter ?? 0.02) / 2;
    if (nodes && !this.ghostLine) this.#replace('ghostLine', new Cable(nodes.s, 1.15 * radius, [contactArc(model, model.start)], this.pale));
    this.options.reference ||= exaggerated(difference(model));
  }

  theme() {
    const fog = css('--sky-low');
    this.scene.fog = new Fog(new Color(fog), ...this.#mist());
    this.ground.colour(css('--grid'), fog);
    this.dashed?.color.set(css('--rest'));
    this.path?.color.set(css('--trace'));
    this.pale?.color.set(css('--ghost'));
    this.palette.tower.color.set(css('--tower'));
    this.invalidate();
  }

  #mist() {
    const length = this.span?.length ?? 50;
    return this.name === 'span' ? [3 * length, 8 * length] : [Math.max(0.12 * length, 25), Math.max(1.3 * length, 260)];
  }

  // What the key under the picture has to explain: [class, words].
  legend() {
    const { forces, trace, reference } = this.options, found = [], longest = `${Math.round(this.peak)} N`;
    if (this.peak > LEAST_FORCE && forces === 'total') found.push(['robot', `force on robot (longest: ${longest})`], ['cable', 'force on line']);
    if (this.peak > LEAST_FORCE && forces === 'parts') {
      found.push(['robot', `normal force on robot (longest: ${longest})`], ['friction', 'along the line'], ['cable', 'on line']);
    }
    if (trace && this.trace) found.push(['trace', 'path of the robot']);
    if (this.atRest) found.push(['rest', 'line before landing']);
    if (reference) found.push(['ghost', reference === 1 ? 'reference' : `reference, difference ×${reference.toLocaleString('en')}`]);
    return found;
  }

  // ---- cameras ------------------------------------------------------------------------------------------------

  size(width, height) {
    const aspect = width / height, narrow = Math.abs(aspect - this.camera.aspect) > 0.25;
    this.renderer.setPixelRatio(Math.min(devicePixelRatio || 1, 2));
    this.renderer.setSize(width, height, false);
    Object.assign(this.camera, { aspect }).updateProjectionMatrix();
    this.perPixel = 2 * Math.tan(FIELD * Math.PI / 360) / height / 2;
    if (narrow && this.model) this.view(this.name);
  }

  view(name) {
    this.name = name;
    if (!this.model) return;
    const { target, eye, heights, size, follow } = camera(name, this.#surroundings());
    Object.assign(this.options, { heights, size });
    this.follow = follow; this.followed = this.home;
    this.controls.target.set(...target);
    this.camera.position.set(...eye);
    this.camera.near = name === 'span' ? 0.5 : 0.02;
    this.camera.updateProjectionMatrix();
    [this.scene.fog.near, this.scene.fog.far] = this.#mist();
    this.#stale = true;
    this.invalidate();
  }

  #surroundings() {
    const { head } = this.model, at = this.rest ? hermite(this.rest, contactArc(this.model, this.model.start)) : [0, 0, 0];
    const pose = this.model.pose(this.model.start);
    this.home = this.rest ? at : pose?.position ?? at;
    const { low = -0.5, high = 0.5, reach = 1.25 } = this.robot ?? {}, [least, most] = this.#heights();
    return {
      at: this.home, low: least + low, high: Math.max(most + high, this.home[2]), reach, hangs: head.robot?.layout !== 'bottom',
      span: this.span, sag: this.sag, aspect: this.camera.aspect,
    };
  }

  // Least and largest height of the robot over the landing.
  #heights() {
    const found = Array.from(this.model.get('robot.body.position.z') ?? []).filter(Number.isFinite);
    if (!found.length) return [this.home[2], this.home[2]];
    return [found.reduce((a, b) => Math.min(a, b)), found.reduce((a, b) => Math.max(a, b))];
  }

  set(options) {
    const before = this.place(this.home);
    Object.assign(this.options, options);
    this.#shift(this.place(this.home).map((x, c) => x - before[c]));   // the robot stays in the picture
    if (!this.follow) this.followed = this.place(this.home);
    else this.followed = this.followed.map((x, c) => x + this.place(this.home)[c] - before[c]);
    this.#stale = true;
    this.invalidate();
  }

  // ---- one frame ----------------------------------------------------------------------------------------------

  // Heights are exaggerated about the chord between the supports.
  place = p => {
    const k = this.options.heights;
    if (k === 1 || !this.span) return p;
    const level = chord(this.span, p[1]);
    return [p[0], p[1], level + k * (p[2] - level)];
  };

  update(t) {
    if (!this.model) return;
    const { model } = this, nodes = model.line(t), pose = model.pose(t);
    this.#followTo(nodes ? hermite(nodes, contactArc(model, t)) : pose?.position);
    if (this.controls.update()) this.invalidate();
    if (this.#stale) this.#still();
    if (nodes) this.cable.shape(nodes, this.place, this.camera.position, this.perPixel);
    this.#pose(this.robot, pose, nodes, t);
    this.#turn(t);
    this.#forces(t);
    this.#ghost(t, nodes, pose);
    if (this.trace) this.#draw(t);
    this.renderer.render(this.scene, this.camera);
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

  // What does not move with time, at the present scales: line at rest, path, ground.
  #still() {
    this.#stale = false;
    const { heights, size } = this.options;
    if (this.span) this.#layGround(heights);
    if (this.rest) {
      this.cable.shape(this.rest, this.place, this.camera.position, this.perPixel);
      this.atRest.geometry.attributes.position.array.set(this.cable.centre);
      this.atRest.geometry.attributes.position.needsUpdate = true;
      Object.assign(this.dashed, { dashSize: 0.05 * size, gapSize: 0.04 * size });
      this.atRest.computeLineDistances();
    }
    if (this.trace) this.#path();
  }

  #layGround(heights) {
    const { left, right, length } = this.span, ground = Math.min(left[2], right[2]) - groundBelow(length, heights * this.sag);
    this.towers.stand(ground);
    this.ground.lay([(left[0] + right[0]) / 2, (left[1] + right[1]) / 2], ground, length);
  }

  // The robot is drawn about the point where it touches the line, which the exaggeration of heights moves.
  #anchored(position, anchor) {
    const { size } = this.options, q = this.place(anchor);
    return position.map((x, c) => q[c] + size * (x - anchor[c]));
  }

  #path() {
    const { model } = this, names = ['x', 'y', 'z'], position = this.trace.geometry.attributes.position;
    const body = names.map(c => model.get(`robot.body.position.${c}`)), port = names.map(c => model.get(`cable.port[1].position.${c}`));
    let last = null;
    for (let i = 0; i < model.time.length; i++) {
      const b = body.map(v => v?.[i]), anchor = port.every(Boolean) ? port.map(v => v[i]) : b;
      const point = [...b, ...anchor].every(Number.isFinite) ? this.#anchored(b, anchor) : last ?? this.home;
      position.array.set(point, 3 * i);
      last = point;
    }
    position.needsUpdate = true;
  }

  #draw(t) {
    this.trace.visible = this.options.trace && this.model.time.length > 1;
    const [i, f] = locate(this.model.time, t);
    this.trace.geometry.setDrawRange(0, Math.max(2, i + Math.round(f) + 1));
  }

  #pose(robot, pose, nodes, t) {
    if (!robot) return;
    robot.group.visible = Boolean(pose);
    if (!pose) return;
    const anchor = nodes ? hermite(nodes, contactArc(this.model, t)) : pose.position;
    robot.group.position.set(...this.#anchored(pose.position, anchor));
    robot.group.quaternion.setFromEuler(new Euler(...pose.angles, 'ZYX'));
    robot.group.scale.setScalar(this.options.size);
  }

  // Wheels turn with their measured angle; rotors stand still where there is no thrust.
  #turn(t) {
    const { model, robot } = this, [i, f] = locate(model.time, t);
    robot?.wheels.forEach((wheel, k) => {
      const angle = this.turned[k];
      wheel.rotation.y = angle.length > 1 ? angle[i] * (1 - f) + angle[i + 1] * f : 0;
    });
    if (robot?.blades.length && Math.abs(model.at('robot.thrust', t)) > 1e-6) {
      for (const blade of robot.blades) blade.rotation.z = blade.userData.sense * BLADE_SPEED * t;
    }
  }

  #forces(t) {
    this.arrows.clear();
    const { forces, size } = this.options, { model } = this;
    if (forces === 'none' || !(this.peak > LEAST_FORCE)) return;
    const near = this.name === 'wheel', longest = near ? 0.3 : 0.6 * size, thick = near ? 0.3 : 0.8 * size;
    for (const k of model.contacts) {
      const force = model.vector(`contact${k}.wheel.force`, t), { point, tangent } = touch(model, t, '', k);
      if (![...force, ...point, ...tangent].every(Number.isFinite)) continue;
      const from = this.place(point);
      from[0] += Math.sign(this.camera.position.x - from[0]) * (near ? 0.1 : 0.12) * size;   // beside the wheel, not in it
      for (const [vector, colour] of this.#parts(force, tangent)) {
        this.arrows.add(from, vector, Math.hypot(...vector) / this.peak * longest, thick, colour);
      }
    }
  }

  #parts(force, tangent) {
    const [robot, cable, friction] = ['--f-robot', '--f-cable', '--f-friction'].map(css), minus = v => v.map(x => -x);
    if (this.options.forces === 'total') return [[force, robot], [minus(force), cable]];
    const length = Math.hypot(...tangent), along = force.reduce((sum, x, c) => sum + x * tangent[c], 0) / length ** 2;
    const friction3 = tangent.map(x => along * x), normal = force.map((x, c) => x - friction3[c]);
    return [[normal, robot], [friction3, friction], [minus(normal), cable], [minus(friction3), cable]];
  }

  #ghost(t, nodes, pose) {
    const { reference } = this.options, { model } = this, shown = reference > 0 && model.hasReference;
    const other = shown && this.ghostLine ? model.line(t, `reference/${model.linePrefix}`) : null;
    const theirs = shown && this.ghostRobot ? model.pose(t, 'reference/') : null;
    if (this.ghostLine) this.ghostLine.mesh.visible = Boolean(other);
    if (this.ghostRobot) this.ghostRobot.group.visible = Boolean(theirs && pose);
    const moved = (a, b) => a.map((x, c) => x + reference * (b[c] - x));
    const same = other && nodes && other.position.length === nodes.position.length;
    const drawn = same ? { s: other.s, position: moved(nodes.position, other.position), slope: moved(nodes.slope, other.slope) } : other;
    if (drawn) this.ghostLine.shape(drawn, this.place, this.camera.position, this.perPixel);
    if (!theirs || !pose) return;
    this.#pose(this.ghostRobot, { position: moved(pose.position, theirs.position), angles: moved(pose.angles, theirs.angles) }, nodes, t);
  }

  info() { return { ...this.renderer.info.render, programs: this.renderer.info.programs.length }; }

  // Where things are drawn, for tests: the first wheel's centre and point b, in the scene's own coordinates.
  state() {
    const found = { view: this.name, ...this.options, robot: this.robot?.group.position.toArray() ?? null };
    const wheel = this.robot?.wheels[0]?.getWorldPosition(new Vector3()).toArray();
    return { ...found, wheel: wheel ?? null, camera: this.camera.position.toArray() };
  }
}

// How far the line hangs below the chord between its supports.
function lowest(nodes, span) {
  let most = 0;
  for (let j = 0; j < nodes.position.length; j += 3) most = Math.max(most, chord(span, nodes.position[j + 1]) - nodes.position[j + 2]);
  return most;
}
