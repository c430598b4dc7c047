// Values at the time shown, over the scene.
import { element, fixed } from './dom.js';
import { clearance } from './geometry.js';

const MILLI = 1e3;

export class Hud {
  constructor(app, list) {
    this.app = app;
    this.list = list;
    this.rows = [];
  }

  show(model) {
    this.list.replaceChildren();
    const known = (model.head.hud ?? []).filter(row => row.expr || model.has(row.name));
    this.rows = known.map(row => ({ row, value: element('dd') }));
    for (const { row, value } of this.rows)
      this.list.append(element('div', {}, element('dt', { textContent: row.label }), value));
    this.list.hidden = !known.length;
  }

  at(t, model) {
    for (const { row, value } of this.rows) {
      const text = row.expr === 'clearance' ? gap(model, t, row) : shown(model, t, row);
      if (value.textContent !== text) value.textContent = text;
    }
  }
}

function shown(model, t, { name, factor = 1, unit = '', digits = 2, from_start: fromStart }) {
  const value = model.at(name, t) - (fromStart ? model.first(name) : 0);
  return `${fixed(factor * value, digits)} ${unit}`.trim();
}

// The gap between the rotors' plane and the line, and which side is the closer one.
function gap(model, t, { digits = 0, factor = MILLI, unit = 'mm' }) {
  const found = clearance(model, t);
  if (!found) return '–';
  const difference = factor * (found.before - found.after);
  const side = difference < 0 ? '◂ ' : ' ▸';
  const text = `${fixed(factor * found.least, digits)} ${unit}`;
  if (!(Math.abs(difference) >= 1)) return text;
  return difference < 0 ? side + text : text + side;
}
