// Verdict and tiles: written by the server for the landing of the page, rewritten for what is shown instead.
//   <div class="tile" data-limit="roll"> … <b>value</b> <small>note</small> <div class="bar"><i style="width:…">
import { fixed } from './dom.js';

const DEGREES = 180 / Math.PI;
const READABLE = { rad: ['°', DEGREES, 1], m: ['mm', 1000, 0], N: ['kN', 1e-3, 2], 1: ['%', 100, 1] };

export function readable(value, unit) {
  const [name, factor, digits] = READABLE[unit] ?? [unit, 1, 2];
  return `${fixed(value * factor, digits)} ${name}`;
}

export class Tiles {
  constructor(app) {
    this.app = app;
    this.verdict = document.querySelector('.verdict');
    this.note = document.querySelector('.what-if-note');
    this.kept = [...document.querySelectorAll('.tile[data-limit]')].map(tile => ({ tile, html: tile.innerHTML, style: tile.className }));
    this.word = this.verdict && { text: this.verdict.textContent, style: this.verdict.className };
  }

  show(model, note) {
    const original = model === this.app.original;
    this.#says(original ? '' : note);
    if (original) return this.#restore();
    const { word, class: name } = model.head.verdict ?? { word: 'not judged', class: 'none' };
    if (this.verdict) Object.assign(this.verdict, { textContent: word, className: `verdict ${name}` });
    for (const { tile } of this.kept) this.#fill(tile, model.head.limits?.[tile.dataset.limit]);
  }

  #restore() {
    if (this.verdict) Object.assign(this.verdict, { textContent: this.word.text, className: this.word.style });
    for (const { tile, html, style } of this.kept) Object.assign(tile, { innerHTML: html, className: style });
  }

  // What is shown is not what was recorded: said beside the verdict.
  #says(note) {
    if (!this.verdict) return;
    this.note ??= this.verdict.insertAdjacentElement('afterend', Object.assign(document.createElement('span'), { className: 'what-if-note' }));
    this.note.textContent = note;
    this.note.hidden = !note;
  }

  #fill(tile, limit) {
    const [value, small, bar] = [tile.querySelector('b'), tile.querySelector('small'), tile.querySelector('.bar i')];
    const known = limit && Number.isFinite(limit.worst), used = known && limit.limit ? Math.abs(limit.worst / limit.limit) : 0;
    if (value) value.textContent = known ? readable(limit.worst, limit.unit) : '–';
    if (small) small.textContent = known ? `limit ${readable(limit.limit, limit.unit)}, margin ${readable(limit.margin, limit.unit)}` : 'not judged';
    if (bar) bar.style.width = `${Math.min(100, 100 * used)}%`;
    tile.classList.toggle('over', used > 1);
  }
}
