// Verdict and tiles: written by the server for the landing of the page, rewritten for what is shown instead.
//   <div class="tile" data-limit="roll"> … <b>value</b> <small>note</small> <div class="bar"><i style="width:…">
import { fixed } from './dom.js';
import { clearance } from './geometry.js';

const DEGREES = 180 / Math.PI;
const READABLE = { rad: ['°', DEGREES, 1], m: ['mm', 1000, 0], N: ['kN', 1e-3, 2], 1: ['%', 100, 1] };
const BEYOND = { kept: 'margin', unclear: 'margin, not clear,', exceeded: 'exceeded by' };

export function readable(value, unit) {
  const [name, factor, digits] = READABLE[unit] ?? [unit, 1, 2];
  return `${fixed(value * factor, digits)}${name === '°' ? '' : ' '}${name}`;
}

export class Tiles {
  constructor(app) {
    this.app = app;
    this.verdict = document.querySelector('.verdict');
    this.covers = document.getElementById('covers');
    this.note = document.querySelector('.what-if-note');
    this.kept = [...document.querySelectorAll('.tile[data-limit], .tile[data-tile]')].map(tile => ({
      tile,
      html: tile.innerHTML,
      style: tile.className,
    }));
    this.word = this.verdict && {
      text: this.verdict.textContent,
      style: this.verdict.className,
      covers: this.covers?.textContent,
    };
  }

  show(model, note) {
    const original = model === this.app.original;
    this.#says(original ? '' : note);
    if (original) return this.#restore();
    const { word, class: name } = model.head.verdict ?? { word: 'not judged', class: 'none' };
    if (this.verdict) Object.assign(this.verdict, { textContent: word, className: `verdict ${name}` });
    if (this.covers) this.covers.textContent = model.head.safety ?? '';
    for (const { tile } of this.kept) this.#fill(tile, model);
  }

  #restore() {
    if (this.verdict) Object.assign(this.verdict, { textContent: this.word.text, className: this.word.style });
    if (this.covers) this.covers.textContent = this.word.covers;
    for (const { tile, html, style } of this.kept) Object.assign(tile, { innerHTML: html, className: style });
  }

  // What is shown is not what was recorded: said beside the verdict.
  #says(note) {
    if (!this.verdict) return;
    this.note ??= this.verdict.insertAdjacentElement(
      'afterend',
      Object.assign(document.createElement('span'), { className: 'what-if-note' }),
    );
    this.note.textContent = note;
    this.note.hidden = !note;
  }

  #fill(tile, model) {
    const { limit, tile: kind } = tile.dataset;
    const { value, small, used, over = false } = limit ? ofLimit(model, limit) : (OTHERS[kind]?.(model) ?? NOTHING);
    const write = (selector, text) => {
      const part = tile.querySelector(selector);
      if (part) part.textContent = text;
    };
    write('b', value);
    write('small', small);
    const bar = tile.querySelector('.bar i');
    if (bar) bar.style.width = `${Math.min(100, 100 * Math.max(0, used ?? 0))}%`;
    bar?.parentElement.setAttribute(
      'aria-label',
      used === undefined ? 'not known' : `${fixed(100 * used, 0)} % of the limit used`,
    );
    tile.classList.toggle('over', over);
  }
}

const NOTHING = { value: '–', small: 'not known of what is shown' };

function ofLimit(model, name) {
  const judged = model.head.limits?.[name];
  if (!judged || !Number.isFinite(judged.worst))
    return {
      value: '–',
      small: judged ? 'not finite' : `not judged: ${model.head.not_judged?.[name] ?? 'not known'}`,
      over: Boolean(judged),
    };
  const { unit, limit, margin, share, time, wheel, verdict } = judged;
  const at = ` at ${fixed(time, 2)} s${wheel ? `, wheel ${wheel}` : ''}`;
  const left = `${BEYOND[verdict] ?? 'margin'} ${readable(Math.abs(margin), unit)}`;
  const small = `limit ${readable(limit, unit)}: ${left}${at}`;
  return { value: readable(Math.abs(judged.worst), unit), small, used: share, over: verdict === 'exceeded' };
}

// The largest force of all wheels, within the steps where that is known.
function largestForce(model) {
  let top = null;
  for (const k of model.contacts) {
    const values = model.get(`contact${k}.normal_force_max`) ?? model.get(`contact${k}.normal_force`) ?? [];
    values.forEach((x, i) => {
      if (!top || x > top.x) top = { x, i, k };
    });
  }
  if (!top) return NOTHING;
  const wheel = model.contacts.length > 1 ? `, wheel ${top.k}` : '';
  return {
    value: top.x >= 1e4 ? `${fixed(top.x / 1e3, 1)} kN` : `${fixed(top.x, 0)} N`,
    small: `at ${fixed(model.time[top.i], 2)} s${wheel}`,
  };
}

// The least gap between the rotors' plane and the line, over all shapes of the line.
function leastGap(model) {
  const times = model.get(`${model.linePrefix}line.time`) ?? [];
  const level = Math.abs(model.head.robot?.line ?? NaN);
  let least = null;
  for (const t of times) {
    const gap = clearance(model, t)?.least;
    if (Number.isFinite(gap) && !(gap >= least?.gap)) least = { gap, t };
  }
  if (!least) return NOTHING;
  const small = `of ${fixed(1e3 * level, 0)} mm over a straight line; at ${fixed(least.t, 2)} s`;
  return { value: `${fixed(1e3 * least.gap, 0)} mm`, small, used: 1 - least.gap / level };
}

const OTHERS = { force: largestForce, clearance: leastGap };
