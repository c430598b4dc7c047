// "What if": the landing with another mass, speed, friction or damping, elsewhere on the span or with another robot, solved
// in the page by the kernels of the monolithic solver. What is shown then follows it, and says so.
import { element, fixed } from './dom.js';
import { judge, limitsFor, TENSION_ALONG } from './judge.js';
import { Model, unpack } from './model.js';

const FRAME = 0.02;   // s between shapes of the line
const BLOCKS = 'whatif.starts';
const INPUTS = /^robot\.(thrust|torque\.|wheel\[\d+\]\.drive_torque)/;
const VERDICTS = { true: ['Safe to land', 'safe'], false: ['Not safe to land', 'unsafe'], null: ['Safety not judged', 'none'] };
const NOT_CLEAR = ['Not clearly safe', 'unclear'];

// Fill the place of the what-if; nothing where the page has none, a word where there is a reason.
export function whatif(app) {
  const place = document.getElementById('whatif'), about = app.original.head.whatif;
  if (!place || !about) return null;
  place.hidden = false;
  if (about.reason || !about.starts?.length) {
    place.replaceChildren(element('b', { textContent: 'What if' }), element('span', { className: 'muted', textContent: `not here: ${about.reason}` }));
    return null;
  }
  return new WhatIf(app, place, about);
}

class WhatIf {
  #worker = null; #waiting = new Map(); #id = 0;

  constructor(app, place, about) {
    this.app = app; this.place = place; this.about = about;
    this.#build();
    if (about.cells) this.#say('Open a landing on the map: it can then be changed here.');
    else this.#begin(about.starts, app.original);
    app.solver = cell => this.landing(cell);
    app.page.whatif = { set: (name, value) => this.set(name, value), choose: i => this.choose(i), back: () => this.back(), state: () => this.state() };
  }

  // What is changed from now on: the first of `starts`, shown as the model `home`.
  #begin(starts, home) {
    this.starts = starts; this.home = home;
    this.start = starts[0];
    this.wishes = this.#own();
    this.#fill();
    this.#say('');
  }

  #own() { return Object.fromEntries(this.start.sliders.map(slider => [slider.name, slider.value])); }

  get changed() {
    if (!this.start) return false;
    const own = this.#own();
    return this.start !== this.starts?.[0] || Object.keys(own).some(name => own[name] !== this.wishes[name]);
  }

  // -- what stands in the page --------------------------------------------------------------------------------------

  #build() {
    this.said = element('p', { className: 'said', role: 'status' });
    this.again = element('button', { type: 'button', textContent: 'Back to the landing as it was', hidden: true, onclick: () => this.back() });
    this.controls = element('div', { className: 'wishes' });
    const title = element('b', { textContent: 'What if' });
    this.place.replaceChildren(title, this.controls, this.again, this.said);
    this.place.setAttribute('aria-label', 'What if');
  }

  #fill() {
    const choices = this.starts.length > 1 ? [this.#choice()] : [];
    this.inputs = {};
    this.controls.replaceChildren(...choices, ...this.start.sliders.map(slider => this.#slider(slider)));
  }

  #choice() {
    const first = this.starts[0], select = element('select', { oninput: () => this.choose(Number(select.value)) });
    const option = (start, i) => element('option', { value: String(i), textContent: i ? named(start, first) : `${first.robot} at ${+first.position.toFixed(3)} m`, selected: start === this.start });
    select.append(...this.starts.map(option));
    return element('label', {}, 'landing ', select);
  }

  #slider(slider) {
    const { name, label, unit, least, most, step } = slider, digits = Math.max(0, Math.ceil(-Math.log10(step) - 1e-9));
    const output = element('output', {}), show = value => { output.textContent = `${fixed(value, digits)}${unit === '1' ? '' : ` ${unit}`}`; };
    const input = element('input', { type: 'range', min: String(least), max: String(most), step: 'any' });
    input.value = String(this.wishes[name]);
    input.setAttribute('aria-label', `${label}${unit === '1' ? '' : `, ${unit}`}`);
    input.dataset.ownKeys = '';
    input.addEventListener('input', () => this.set(name, onStep(slider, Number(input.value))));
    input.addEventListener('keydown', event => {
      const by = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1, PageUp: 10, PageDown: -10 }[event.key];
      if (!by) return;
      event.preventDefault();
      this.set(name, onStep(slider, this.wishes[name] + by * step));
    });
    this.inputs[name] = { input, show };
    show(this.wishes[name]);
    return element('label', {}, `${label.toLowerCase()} `, input, ' ', output);
  }

  #say(text, wrong = false) {
    this.said.textContent = text;
    this.said.classList.toggle('wrong', wrong);
    this.again.hidden = !this.changed;
  }

  // -- what is wished -----------------------------------------------------------------------------------------------

  set(name, value) {
    this.wishes[name] = value;
    this.inputs[name].input.value = String(value);
    this.inputs[name].show(value);
    return this.solve();
  }

  choose(i) {
    this.start = this.starts[i];
    this.wishes = this.#own();
    this.#fill();
    return this.solve();
  }

  back() {
    this.#id++;   // what is on its way comes too late
    this.#begin(this.starts, this.home);
    this.app.show(this.home, this.home === this.app.original ? '' : this.home.head.opened);
  }

  state() { return { wishes: { ...this.wishes }, start: this.starts?.indexOf(this.start) ?? -1, changed: this.changed, said: this.said.textContent, ms: this.ms ?? null, solving_ms: this.solving ?? null }; }

  // Solve what is wished and show it. Returns whether it is shown: a newer wish, or a failure, keeps it from that.
  async solve() {
    if (!this.changed) {
      this.back();
      return true;
    }
    const began = performance.now(), id = ++this.#id, { start } = this, wishes = { ...this.wishes };
    this.#say('solving …');
    const answer = await this.#ask(start, wishes);
    if (id !== this.#id || answer.dropped) return false;
    if (answer.failed) {
      this.#say(`No such landing: ${answer.failed}. Shown is the one before.`, true);
      return false;
    }
    this.app.show(this.model(start, wishes, answer), 'what if');
    Object.assign(this, { ms: performance.now() - began, solving: answer.ms });
    this.#say(this.#words(start, wishes));
    return true;
  }

  // A landing of the map that was not recorded: solved from its own start, if the page has it; it can then be changed.
  // Null where it cannot be had.
  async landing(cell) {
    const start = this.about.cells?.[cell.open];
    if (!start) return null;
    const id = ++this.#id, wishes = Object.fromEntries(start.sliders.map(slider => [slider.name, slider.value]));
    this.#say('solving …');
    const answer = await this.#ask(start, wishes);
    if (id !== this.#id || answer.dropped) return null;
    if (answer.failed) {
      this.#say(`No such landing: ${answer.failed}.`, true);
      return null;
    }
    const found = this.model(start, wishes, answer, '');
    found.head.opened = `${cell.words}: solved in this browser`;
    this.#begin([start], found);
    return found;
  }

  // -- the worker ---------------------------------------------------------------------------------------------------

  #ask(start, wishes) {
    this.#worker ??= this.#started();
    const id = `${this.#waiting.size}-${performance.now()}`, { step, end } = this.about;
    const words = this.app.original.get(BLOCKS), block = words.slice(start.first, start.first + start.given);
    return new Promise(done => {
      this.#waiting.set(id, done);
      this.#worker.then(worker => worker.postMessage({ id, start, block, wishes, step, end: start.end ?? end, frame: FRAME }),
        error => this.#answer({ id, failed: `the solver does not start: ${error.message}` }));
    });
  }

  async #started() {
    const source = document.getElementById('worker').textContent, wasm = await unpack(document.getElementById('wasm').textContent);
    const worker = new Worker(URL.createObjectURL(new Blob([source], { type: 'text/javascript' })));
    worker.onmessage = ({ data }) => this.#answer(data);
    worker.onerror = event => {
      this.app.page.errors.push(`worker: ${event.message}`);
      for (const id of [...this.#waiting.keys()]) this.#answer({ id, failed: `the solver stopped: ${event.message}` });
    };
    worker.postMessage({ wasm }, [wasm]);
    return worker;
  }

  #answer(answer) {
    this.#waiting.get(answer.id)?.(answer);
    this.#waiting.delete(answer.id);
  }

  // -- what is shown ------------------------------------------------------------------------------------------------

  // The answer as the page shows landings; verdict and limits are its own.
  model(start, wishes, { time, signals, tension, line }, before = 'What if: ') {
    const { original } = this.app, arrays = { time, ...signals, [TENSION_ALONG]: tension };
    for (const [name, values] of Object.entries(line)) arrays[`line.${name}`] = values;
    for (const name of Object.keys(original.arrays)) {   // inputs over time are as they were
      if (INPUTS.test(name)) arrays[name] = Float64Array.from(time, t => original.at(name, t));
    }
    const scene = start.scene ?? {}, own = original.head, same = start.robot === own.robot?.name && own.plots?.length;
    const panels = same ? {} : { plots: plots(start, signals), hud: hud(start) };
    const head = { ...own, ...scene, ...panels, line: { prefix: '', exact: true }, reference: null, runs: [], whatif: this.about };
    const said = judge(limitsFor(start, wishes.mass), new Model(head, arrays)), [word, name] = said.safety.startsWith('NOT CLEARLY') ? NOT_CLEAR : VERDICTS[said.safe];
    const verdict = { word: before ? before + word.toLowerCase() : word, class: name };
    return new Model({ ...head, verdict, safety: this.#covers(said), limits: said.limits, not_judged: said.not_judged }, arrays);
  }

  get #solver() { return `${this.about.solver} solver, local tolerance ${this.about.tolerance.toExponential().replace('e-', 'e−')} m`; }

  #covers({ safety, not_judged: missing }) {
    const left = Object.keys(missing);
    return `${safety}${left.length ? `; not judged: ${left.join(', ')}` : ''}. A what-if by the ${this.#solver}: its error is not estimated.`;
  }

  // What was solved, by what, and how the command line gives the same.
  #words(start, wishes) {
    const first = this.starts[0];
    const settings = start.sliders.filter(({ name, value }) => wishes[name] !== value).map(({ name, key }) => `--set ${key}=${+wishes[name].toPrecision(12)}`);
    if (wishes.mass !== start.sliders[0].value) settings.push(...Object.entries(start.held).map(([key, value]) => `--set ${key}=${+value.toPrecision(15)}`));
    if (start.position !== first.position) settings.unshift(`--set landing.position=${start.position}`);
    if (start.robot !== first.robot) settings.unshift(`--robot ${start.robot}`);
    return `A what-if, not the run: by the ${this.#solver}, in this page in ${fixed(this.ms / 1000, 2)} s; no estimate of its error. ` +
      `As ${this.about.cells ? 'the landing of the map' : this.about.scenario} with ${settings.join(' ')}.`;
  }
}

// -- plots of a landing that the page has none for ------------------------------------------------------------------

const DEGREES = 180 / Math.PI;

const numbers = start => Array.from({ length: start.scene?.robot?.wheels.length ?? 1 }, (_, i) => i + 1);

function plots(start, signals) {
  const { known } = start.limits, angle = DEGREES * (known.roll?.limit ?? NaN), line = (at, name) => (Number.isFinite(at) ? [{ at, name }] : []);
  const lowest = known.z ? known.z.reference - known.z.limit - signals['robot.body.position.z'][0] : NaN;
  const most = 1e-3 * (known.tension ? known.tension.limit * known.tension.reference : NaN), wheels = numbers(start);
  const curve = (name, label, i) => ({ name, label, colour: String(i + 1), dash: [] });
  const forces = wheels.length > 1 ? wheels.map(k => curve(`contact${k}.normal_force`, `wheel ${k}`, k - 1))
    : [curve('contact1.normal_force', 'normal', 1), curve('contact1.friction_force', 'friction', 2)];
  return [
    { title: 'Height of the robot', unit: 'm', factor: 1, digits: 3, from_start: true, signals: [curve('robot.body.position.z', 'height', 0)], limits: line(lowest, `lowest allowed, ${fixed(lowest, 2)} m`) },
    { title: 'Roll', unit: '°', factor: DEGREES, digits: 2, from_start: false, signals: [curve('robot.roll', 'roll', 0)], limits: [angle, -angle].flatMap(at => line(at, `limit, ${fixed(at, 1)}°`)) },
    { title: 'Contact force', unit: 'N', factor: 1, digits: 0, from_start: false, signals: forces, limits: [] },
    { title: 'Tension of the line', unit: 'kN', factor: 1e-3, digits: 2, from_start: false, signals: ['left', 'mid', 'right'].map((end, i) => curve(`cable.tension_${end}`, end, i)), limits: line(most, `limit, ${fixed(most, 1)} kN`) },
  ];
}

function hud(start) {
  const wheels = numbers(start), force = k => ({ label: wheels.length > 1 ? `force ${k}` : 'contact force', name: `contact${k}.normal_force`, factor: 1, unit: 'N', digits: 0 });
  return [
    { label: 'height', name: 'robot.body.position.z', factor: 1, unit: 'm', digits: 3, from_start: true },
    { label: 'roll', name: 'robot.roll', factor: DEGREES, unit: '°', digits: 2 },
    ...wheels.map(force),
    { label: 'tension', name: 'cable.tension_mid', factor: 1e-3, unit: 'kN', digits: 2 },
    { label: 'rotor–line gap', expr: 'clearance', factor: 1e3, unit: 'mm', digits: 0 },
  ];
}

const named = (start, first) => (start.robot !== first.robot ? `${start.robot} at ${+start.position.toFixed(3)} m` : `at ${+start.position.toFixed(3)} m`);

// The nearest value on the slider's steps, counted from that of the run.
function onStep({ value, step, least, most }, wanted) {
  const found = value + Math.round((wanted - value) / step) * step;
  return Math.min(Math.max(+found.toPrecision(12), least), most);
}
