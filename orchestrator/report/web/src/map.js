// The map of a sweep: least margin (or probability) of every landing, the safe region's outline, which limit binds.
// Cells are chosen by mouse or keyboard, and open their landing.
import { css, element, fixed } from './dom.js';
import { edges, outline, shade } from './mapping.js';

const NS = 'http://www.w3.org/2000/svg';
const LEFT = 76;
const RIGHT = 16;
const TOP = 12;
const BOTTOM = 50; // px around the cells
const NARROWEST = 320;
const WIDEST = 1100;
const LETTERS = 'abcdefghijklmnopqrstuvwxyz';

const svg = (tag, attributes = {}, text = null) => {
  const node = document.createElementNS(NS, tag);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  if (text !== null) node.textContent = text;
  return node;
};

const USUAL_MEASURES = [
  { key: 'margin', label: 'Least margin', unit: '%', factor: 100, digits: 0, kind: 'margin' },
  {
    key: 'probability',
    label: 'Probability that all limits hold',
    unit: '%',
    factor: 100,
    digits: 0,
    kind: 'probability',
  },
];

export class SweepMap {
  constructor(app, root) {
    this.app = app;
    this.root = root;
    this.map = app.original.head.map;
    this.cells = this.map?.cells ?? [];
    this.measures = (this.map?.measures ?? USUAL_MEASURES).filter(m =>
      this.cells.some(c => Number.isFinite(c[m.key])),
    );
    this.measure = this.measures[0] ?? USUAL_MEASURES[0];
    this.limits = this.map?.limits ?? [...new Set(this.cells.map(c => c.limit).filter(Boolean))].sort();
    for (const cell of this.cells) cell.words = this.#words(cell);
    this.#frame();
    new ResizeObserver(() => this.map && this.host.clientWidth !== this.width && this.draw()).observe(this.host);
    app.page.map = { cells: this.cells, open: i => this.#open(i), select: i => this.#select(i) };
  }

  show() {
    if (this.map) this.draw();
  }
  theme() {
    if (this.map) this.draw();
  }

  #frame() {
    const title = element('h2', { textContent: this.map?.title ?? 'Where it is safe to land' });
    const select = element('select', {
      onchange: () => {
        this.measure = this.measures[select.selectedIndex];
        this.draw();
      },
    });
    select.append(...this.measures.map(m => element('option', { textContent: m.label })));
    const choice = element('label', { hidden: this.measures.length < 2 }, 'shown ', select);
    this.host = element('div', { className: 'map' });
    this.key = element('div', { className: 'map-key' });
    this.said = element('p', { className: 'map-said' });
    this.said.setAttribute('aria-live', 'polite');
    const hint = this.map?.text ?? '';
    this.root.prepend(
      title,
      element('p', { className: 'map-text', textContent: hint, hidden: !hint }),
      choice,
      this.host,
      this.key,
      this.said,
    );
  }

  draw() {
    const { x, y } = this.map;
    const kept = this.chosen ?? 0;
    const rows = y?.values.length ?? 1;
    const height = TOP + BOTTOM + Math.min(420, Math.max(rows > 1 ? 160 : 70, rows * 44));
    const width = Math.min(WIDEST, Math.max(NARROWEST, this.host.clientWidth || WIDEST));
    this.width = this.host.clientWidth;
    const box = { x0: LEFT, x1: width - RIGHT, y0: TOP, y1: height - BOTTOM };
    this.ex = edges(x);
    this.ey = y ? edges(y) : [0, 1];
    this.px = v => box.x0 + ((v - this.ex[0]) / (this.ex[this.ex.length - 1] - this.ex[0])) * (box.x1 - box.x0);
    this.py = v => box.y1 - ((v - this.ey[0]) / (this.ey[this.ey.length - 1] - this.ey[0])) * (box.y1 - box.y0);
    const drawing = svg('svg', {
      viewBox: `0 0 ${width} ${height}`,
      role: 'group',
      'aria-label': `${this.measure.label}: map of ${this.cells.length} landings`,
    });
    this.rects = this.cells.map((cell, i) => this.#cell(drawing, cell, i));
    this.#outline(drawing);
    this.#axes(drawing, box, x, y);
    this.ring = drawing.appendChild(svg('rect', { class: 'map-ring', visibility: 'hidden' }));
    this.host.replaceChildren(drawing);
    this.#legend();
    this.rects[kept]?.setAttribute('tabindex', '0');
  }

  #box({ x, y = 0, box }) {
    const [x0, x1, y0, y1] = box ?? [this.ex[x], this.ex[x + 1], this.ey[y], this.ey[y + 1]];
    return { x: this.px(x0), y: this.py(y1), width: this.px(x1) - this.px(x0), height: this.py(y0) - this.py(y1) };
  }

  #cell(drawing, cell, i) {
    const value = cell[this.measure.key];
    const at = this.#box(cell);
    const known = Number.isFinite(value);
    const { fill, ink } = shade(value, this.measure.kind ?? 'margin');
    const rect = svg('rect', {
      ...at,
      fill,
      tabindex: '-1',
      role: 'button',
      'aria-label': cell.words,
      'data-own-keys': '',
      class: known ? 'cell' : 'cell unknown',
    });
    rect.append(svg('title', {}, cell.words));
    rect.addEventListener('click', () => this.#open(i));
    rect.addEventListener('focus', () => this.#select(i));
    rect.addEventListener('keydown', event => this.#key(event, i));
    drawing.append(rect);
    if (at.width > 16 && at.height > 14) this.#letters(drawing, cell, at, known, ink);
    return rect;
  }

  // The number where there is room, and a letter for the limit that binds.
  #letters(drawing, cell, at, known, ink) {
    const letter = LETTERS[this.limits.indexOf(cell.limit)] ?? '';
    const { factor = 1, digits = 0, key } = this.measure;
    const number = known && at.width > 42 ? fixed(factor * cell[key], digits) : '';
    const text = known ? [number, letter].filter(Boolean).join(' ') : '×';
    const size = at.width > 42 ? 13 : 11;
    drawing.append(
      svg(
        'text',
        {
          x: at.x + at.width / 2,
          y: at.y + at.height / 2 + 4,
          fill: known ? ink : css('--muted'),
          class: 'map-letter',
          'font-size': size,
        },
        text,
      ),
    );
  }

  // Between landings that are safe and those that are not.
  #outline(drawing) {
    const lines = outline(this.cells).map(([a, b]) => `M${this.#corner(a)}L${this.#corner(b)}`);
    drawing.append(svg('path', { d: lines.join(''), class: 'map-outline' }));
  }

  #corner([i, j]) {
    return `${this.px(this.ex[i])} ${this.py(this.ey[j])}`;
  }

  #axes(drawing, { x0, x1, y0, y1 }, x, y) {
    const text = (px, py, words, anchor = 'middle', more = {}) =>
      drawing.append(svg('text', { x: px, y: py, 'text-anchor': anchor, class: 'map-axis', ...more }, words));
    const name = axis => (axis.unit && axis.unit !== '1' ? `${axis.label} [${axis.unit}]` : axis.label);
    ticks(x, this.ex, (x1 - x0) / 52).forEach(([v, words]) => text(this.px(v), y1 + 18, words));
    text((x0 + x1) / 2, y1 + 40, name(x));
    if (!y) return;
    ticks(y, this.ey, (y1 - y0) / 20).forEach(([v, words]) => text(x0 - 8, this.py(v) + 4, words, 'end'));
    text(0, 0, name(y), 'middle', { transform: `translate(16 ${(y0 + y1) / 2}) rotate(-90)` });
  }

  #legend() {
    const { label, unit = '', factor = 1, kind = 'margin' } = this.measure;
    const stops = kind === 'probability' ? [0, 0.5, 0.9, 1] : [-0.5, -0.1, 0.1, 0.5, 1];
    const patch = value =>
      element(
        'span',
        {},
        element('i', { style: `background:${shade(value, kind).fill}` }),
        `${fixed((Math.round(value * 10) / 10) * factor, 0)} ${unit}`,
      );
    const names = this.limits.map((name, i) =>
      element('span', {}, element('b', { textContent: LETTERS[i] }), ` ${this.map.limit_names?.[name] ?? name}`),
    );
    const line = element('span', {}, element('i', { className: 'k-outline' }), 'edge of the safe region');
    const missing = this.cells.some(c => !Number.isFinite(c[this.measure.key]))
      ? [element('span', {}, element('b', { textContent: '×' }), ' no result')]
      : [];
    this.key.replaceChildren(
      element('span', { textContent: `${label}:` }),
      ...stops.map(patch),
      line,
      ...(names.length ? [element('span', { textContent: 'Binding limit:' }), ...names] : []),
      ...missing,
    );
  }

  #words(cell) {
    const where = [
      [this.map.x, cell.x],
      [this.map.y, cell.y ?? 0],
    ]
      .filter(([axis]) => axis)
      .map(([axis, i]) => `${axis.label} ${named(axis, i)}`);
    const facts = this.measures
      .filter(m => Number.isFinite(cell[m.key]))
      .map(m =>
        `${m.label.toLowerCase()} ${fixed((m.factor ?? 1) * cell[m.key], m.digits ?? 0)} ${m.unit ?? ''}`.trim(),
      );
    const binds = cell.limit ? [`${this.map.limit_names?.[cell.limit] ?? cell.limit} binds`] : [];
    return cell.text ?? [where.join(', '), ...[cell.verdict, ...facts, ...binds].filter(Boolean)].join('; ');
  }

  #select(i) {
    const rect = this.rects[i];
    if (!rect) return;
    this.rects[this.chosen ?? 0]?.setAttribute('tabindex', '-1');
    this.chosen = i;
    rect.setAttribute('tabindex', '0');
    for (const name of ['x', 'y', 'width', 'height']) this.ring.setAttribute(name, rect.getAttribute(name));
    this.ring.setAttribute('visibility', 'visible');
    this.said.textContent = this.cells[i].words;
  }

  #key(event, i) {
    const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
    if (event.key === 'Enter' || event.key === ' ') {
      event.preventDefault();
      this.#open(i);
    }
    if (!step) return;
    event.preventDefault();
    const next = this.#neighbour(this.cells[i], step);
    if (next >= 0) this.rects[next].focus();
  }

  // The nearest cell in a direction; a map may have holes.
  #neighbour(cell, [dx, dy]) {
    const distance = c => {
      const [x, y] = [(c.x - cell.x) * (dx || dy * 0), ((c.y ?? 0) - (cell.y ?? 0)) * dy];
      const ahead = dx ? x : y;
      const aside = dx ? Math.abs((c.y ?? 0) - (cell.y ?? 0)) : Math.abs(c.x - cell.x);
      return ahead > 0 ? ahead + 100 * aside : Infinity;
    };
    const all = this.cells.map(distance);
    const least = Math.min(...all);
    return Number.isFinite(least) ? all.indexOf(least) : -1;
  }

  async #open(i) {
    this.#select(i);
    const cell = this.cells[i];
    this.said.textContent = `${cell.words} …`;
    try {
      const opened = await this.app.open(cell);
      this.said.textContent = opened
        ? `${cell.words}: shown in the replay and the plots`
        : `${cell.words}: its signals were not kept, and it cannot be solved here`;
      return opened;
    } catch (error) {
      this.said.textContent = `${cell.words}: ${error.message ?? error}`;
      this.app.page.errors.push(`map: ${error}`);
      return false;
    }
  }
}

const named = (axis, i) => {
  const value = axis.labels?.[i] ?? axis.values[i];
  return axis.unit && axis.unit !== '1' && !axis.labels ? `${value} ${axis.unit}` : String(value);
};

// Ticks at the values, fewer where they would run together: [[place, words]].
function ticks(axis, cells, most) {
  const n = axis.values.length;
  const every = Math.max(1, Math.ceil(n / Math.max(most, 1)));
  const words = i => String(axis.labels?.[i] ?? +Number(axis.values[i]).toPrecision(5));
  return axis.values.map((_, i) => [(cells[i] + cells[i + 1]) / 2, words(i)]).filter((_, i) => i % every === 0);
}
