// One clock for everything on the page. Parts are told what to show (`show`), at which time (`at`), in which colours.
import { clearance } from './geometry.js';
import { Hud } from './hud.js';
import { Inset } from './inset.js';
import { SweepMap } from './map.js';
import { Plots } from './plots.js';
import { printable } from './print.js';
import { Stage } from './stage.js';
import { Tiles } from './tiles.js';

const LONGEST_FRAME = 0.25; // s; a page that was hidden goes on where it stood
const NUDGE = 0.05; // s, of the arrow keys

export class App {
  #parts = [];
  #pending = false;
  #then = 0;

  constructor(model, page) {
    this.original = model;
    this.model = model;
    this.page = page;
    this.t = model.start;
    this.speed = 1;
    this.playing = false;
    this.note = '';
    this.has = { replay: Boolean(model.head.line || model.head.robot) && model.time.length > 0 };
  }

  // Put the parts into the page and draw the first frame.
  async begin() {
    const { stage, plots, map } = this.#places();
    this.#add('stage', () => stage && (this.stage = new Stage(this, stage)));
    this.#add('inset', () => this.stage && new Inset(this, this.stage.inset));
    this.#add('hud', () => this.stage && new Hud(this, this.stage.hud));
    this.#add('plots', () => plots && (this.plots = new Plots(this, plots)));
    this.#add('tiles', () => new Tiles(this));
    this.#add('map', () => map && (this.map = new SweepMap(this, map)));
    this.#listen();
    this.#expose();
    this.show(this.original);
    await new Promise(done =>
      requestAnimationFrame(now => {
        this.#frame(now);
        done();
      }),
    );
  }

  // Where scripts draw: the body's own places, made where it has none. A graph has plots alone.
  #places() {
    const found = id => document.getElementById(id);
    const main = document.getElementById('page');
    const make = (id, parent) =>
      found(id) ?? parent.appendChild(Object.assign(document.createElement('section'), { id, className: 'card' }));
    const work = document.querySelector('.work') ?? document.createElement('div');
    if (!work.isConnected) {
      work.className = 'work';
      (document.querySelector('.tiles') ?? main.querySelector('header') ?? main.firstElementChild).after(work);
    }
    const stage = make('stage', work);
    const plots = make('plots', work);
    this.places = { work, stage, plots };
    return { stage, plots, map: this.model.head.map ? make('map', main) : found('map') };
  }

  // A part that fails to start or to draw is left out; the others go on.
  #add(name, make) {
    const part = this.guard(name, make);
    if (part) this.#parts.push({ name, part });
  }

  guard(name, action) {
    try {
      return action();
    } catch (error) {
      this.page.errors.push(`${name}: ${error?.stack ?? error}`);
      console.error(name, error);
      return null;
    }
  }

  // A part that fails in a frame is left alone until another model is shown: one error, not sixty a second.
  #tell(method, ...values) {
    for (const entry of this.#parts) {
      const { name, part } = entry;
      if (method === 'show') entry.failed = false;
      if (!part[method] || entry.failed) continue;
      const before = this.page.errors.length;
      this.guard(name, () => part[method](...values));
      entry.failed = this.page.errors.length > before;
    }
  }

  // Show another model everywhere: a what-if, or a landing of the map. `note` says what it is; none: the original.
  show(model, note = '') {
    this.model = model;
    this.note = note;
    this.has.replay = Boolean(model.head.line || model.head.robot) && model.time.length > 0;
    this.t = Math.min(Math.max(this.t, model.start), model.end);
    const { work, stage, plots } = this.places;
    stage.hidden = !this.has.replay;
    plots.hidden = !(model.head.plots?.length && model.time.length > 1);
    work.classList.toggle('single', stage.hidden || plots.hidden);
    work.hidden = stage.hidden && plots.hidden;
    this.#tell('show', model, note);
    this.invalidate();
  }

  seek(t) {
    if (!Number.isFinite(t)) return;
    this.t = Math.min(Math.max(t, this.model.start), this.model.end);
    this.invalidate();
  }

  play(on) {
    if (on && this.t >= this.model.end - 1e-9) this.t = this.model.start;
    this.playing = this.page.playing = on && this.model.end > this.model.start;
    this.#then = performance.now();
    this.#tell('playing', this.playing);
    this.invalidate();
  }

  view(name) {
    this.stage?.view(name);
  }

  // Open a landing of the map: its recorded signals where the page has them, else `solver` (what-if) solves it here.
  async open(cell) {
    const recorded = this.original.head.landings?.[cell.open];
    const shown = recorded ? this.original.other(recorded.prefix, recorded.head) : await this.solver?.(cell);
    if (!shown) return false;
    this.play(false);
    this.show(shown, `${cell.words}: ${recorded ? 'recorded' : 'solved in this browser'}`);
    this.places.work.scrollIntoView({ block: 'nearest' });
    return true;
  }

  theme(name) {
    if (name) document.documentElement.dataset.theme = name;
    else delete document.documentElement.dataset.theme;
    this.#tell('theme');
    this.invalidate();
  }

  // Ask for one frame; nothing is drawn while nothing changes.
  invalidate() {
    if (this.#pending) return;
    this.#pending = true;
    requestAnimationFrame(now => this.#frame(now));
  }

  #frame(now) {
    this.#pending = false;
    // the time stamp of a frame may lie before that of the click which started the replay
    const passed = Math.min(Math.max(now - this.#then, 0) / 1000, LONGEST_FRAME);
    this.#then = now;
    if (this.playing) this.#advance(this.speed * passed);
    this.draw();
    if (this.playing) this.invalidate();
  }

  #advance(step) {
    this.t = Math.min(this.t + step, this.model.end);
    if (this.t >= this.model.end) this.play(false);
  }

  draw() {
    this.#tell('at', this.t, this.model);
    this.page.time = this.t;
    this.page.frames++;
  }

  #listen() {
    addEventListener('keydown', event => this.#key(event));
    document.addEventListener('click', event => {
      const button = event.target.closest?.('[data-seek]');
      if (button) {
        this.play(false);
        this.seek(Number(button.dataset.seek));
      }
    });
    matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => {
      this.#tell('theme');
      this.invalidate();
    });
    this.#themeButton();
    printable(this);
  }

  #key(event) {
    const tag = event.target.tagName;
    if (event.ctrlKey || event.metaKey || event.altKey || /^(SELECT|TEXTAREA)$/.test(tag) || !this.has.replay) return;
    if (tag === 'INPUT' && !(event.target.type === 'checkbox' && event.key !== ' ')) return;
    if (event.key === ' ' && /^(BUTTON|SUMMARY|A)$/.test(tag)) return;
    if (event.defaultPrevented || event.target.closest?.('[data-own-keys]')) return;
    const act = {
      ' ': () => this.play(!this.playing),
      ArrowRight: () => this.seek(this.t + NUDGE),
      ArrowLeft: () => this.seek(this.t - NUDGE),
      Home: () => this.seek(this.model.start),
      End: () => this.seek(this.model.end),
      1: () => this.view('landing'),
      2: () => this.view('side'),
      3: () => this.view('wheel'),
      4: () => this.view('span'),
    }[event.key];
    if (act) {
      act();
      event.preventDefault();
    }
  }

  #themeButton() {
    const button = Object.assign(document.createElement('button'), {
      type: 'button',
      id: 'theme',
      textContent: '◐',
      title: 'Light or dark',
    });
    button.setAttribute('aria-label', 'Light or dark');
    (document.querySelector('header') ?? document.getElementById('page')).append(button);
    button.onclick = () => this.theme(isDark() ? 'light' : 'dark');
  }

  // What tests, and people at the console, may use.
  #expose() {
    Object.assign(this.page, {
      seek: t => this.seek(t),
      play: on => this.play(on),
      view: name => this.view(name),
      theme: name => this.theme(name),
      info: () => this.stage?.info() ?? null,
      state: () => this.stage?.state() ?? null,
      clearance: t => clearance(this.model, t ?? this.t),
      size: () => this.model.time.length,
    });
  }
}

export function isDark() {
  const chosen = document.documentElement.dataset.theme;
  return chosen ? chosen === 'dark' : matchMedia('(prefers-color-scheme: dark)').matches;
}
