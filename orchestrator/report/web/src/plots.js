// Plots of the signals: one cursor and one zoom for all, limits as lines, the value at the cursor or at the time shown.
import uPlot from 'uplot';
import { axisText, curves, extent, power, powerText, range } from './curves.js';
import { colour, css, element, fixed, FONT, inMemory } from './dom.js';
import { locate } from './model.js';

const LEAST = 118;
const MOST = 200;
const PHONE = 520;
const LAST = 20; // px; the last panel carries the axis of time
const CLICK = 4; // px that a click may move

export class Plots {
  constructor(app, root) {
    this.app = app;
    this.root = root;
    this.list = [];
    this.mode = 'values';
    this.#buttons();
    this.body = element('div', { className: 'panels' });
    root.append(this.bar, this.body);
    new ResizeObserver(() => this.resize()).observe(root);
  }

  #buttons() {
    const button = (mode, text) =>
      element('button', { type: 'button', textContent: text, onclick: () => this.#setMode(mode) });
    this.modes = {
      values: button('values', 'Values'),
      difference: button('difference', 'Difference from the reference'),
    };
    this.whole = element('button', {
      type: 'button',
      textContent: 'Whole time',
      hidden: true,
      onclick: () => this.#zoom(null),
    });
    const hint = element('span', { className: 'hint', textContent: 'drag to zoom, click to go there' });
    this.switch = element('span', { className: 'group' }, ...Object.values(this.modes));
    this.bar = element('div', { className: 'plot-bar' }, this.switch, this.whole, hint);
  }

  #setMode(mode) {
    this.mode = mode;
    this.build();
    this.app.invalidate();
  }

  show(model) {
    this.model = model;
    this.comparable =
      model.hasReference || Object.keys(model.arrays).some(name => name.startsWith(`${model.prefix}difference/`));
    if (!this.comparable) this.mode = 'values';
    this.switch.hidden = !this.comparable;
    this.build();
  }

  theme() {
    this.build();
  }

  // Draw at once what else would be drawn after this task: for paper.
  flush() {
    for (const { plot } of this.list) plot.batch(() => {});
  }

  build() {
    const kept = this.zoomed;
    for (const { plot } of this.list) plot.destroy();
    this.body.replaceChildren();
    this.list = [];
    for (const [name, button] of Object.entries(this.modes))
      button.setAttribute('aria-pressed', String(name === this.mode));
    const panels = this.model?.time.length > 1 ? (this.model.head.plots ?? []) : [];
    const made = panels.map(panel => this.#content(panel)).filter(content => content.curves.length);
    made.forEach((content, i) =>
      this.app.guard('plots', () => this.list.push(this.#panel(content, i === made.length - 1))),
    );
    this.resize();
    if (kept) this.#zoom(kept);
  }

  // What a panel shows, scaled by a power of a thousand where differences are small.
  #content(panel) {
    const original =
      this.model === this.app.original || this.model.prefix !== this.app.original.prefix ? null : this.app.original;
    const found = curves(this.model, panel, this.mode, original);
    const isDifference = this.mode === 'difference';
    const exponent = isDifference ? power(found.map(c => c.values)) : 0;
    if (exponent) for (const c of found) c.values = c.values.map(x => (x === null ? null : x / 10 ** exponent));
    const unit = `${powerText(exponent)}${panel.unit ?? ''}`.trim();
    return {
      ...panel,
      curves: found,
      unit,
      digits: isDifference ? 3 : panel.digits,
      limits: isDifference ? [] : (panel.limits ?? []),
      title: isDifference ? `Δ ${panel.title}` : panel.title,
    };
  }

  #panel(content, isLast) {
    const value = element('span', { className: 'now' });
    const caption = element(
      'figcaption',
      {},
      element('b', { textContent: content.title }),
      element('span', { className: 'unit', textContent: content.unit }),
      value,
    );
    const host = element('div');
    const figure = element('figure', {}, caption, host);
    figure.setAttribute('aria-label', `${content.title}${content.unit ? `, ${content.unit}` : ''}, over time`);
    figure.setAttribute('role', 'group');
    this.body.append(figure);
    const data = [Array.from(this.model.time), ...content.curves.map(c => c.values)];
    const plot = inMemory(() => new uPlot(this.#options(content, isLast), data, host));
    const mark = element('div', { className: 'mark' });
    plot.over.append(mark);
    this.#clicks(plot);
    return { plot, mark, value, content, isLast };
  }

  #options(content, isLast) {
    const axis = {
      stroke: css('--ink'),
      grid: { stroke: css('--rule'), width: 1 },
      ticks: { show: false },
      font: `11px ${FONT}`,
    };
    const [low, high] = extent(content.curves.map(c => c.values));
    const limits = range(low, high, content.limits);
    return {
      width: 400,
      height: LEAST,
      legend: { show: false },
      padding: [6, 16, isLast ? 0 : -8, 0],
      cursor: {
        sync: { key: 'replay', scales: ['x', null] },
        drag: { x: true, y: false, dist: 6 },
        points: { size: 6 },
      },
      scales: { x: { time: false }, y: { range: () => limits } },
      axes: [
        { ...axis, size: isLast ? 30 : 12, values: (_, ticks) => (isLast ? seconds(ticks) : ticks.map(() => '')) },
        {
          ...axis,
          size: 50,
          space: 26,
          values: (_, ticks) => ticks.map(v => axisText(v, ticks.length > 1 ? ticks[1] - ticks[0] : 1)),
        },
      ],
      series: [{}, ...content.curves.map(series)],
      hooks: {
        draw: [plot => drawLimits(plot, content.limits)],
        setScale: [(plot, key) => key === 'x' && this.#zoomed(plot)],
        setCursor: [() => this.#values()],
      },
    };
  }

  #clicks(plot) {
    let down = 0;
    plot.over.addEventListener('mousedown', event => {
      down = event.clientX;
    });
    plot.over.addEventListener('mouseup', event => {
      if (Math.abs(event.clientX - down) < CLICK) this.app.seek(plot.posToVal(event.offsetX, 'x'));
    });
    plot.over.addEventListener('dblclick', () => this.#zoom(null));
  }

  // All panels show the same stretch of time.
  #zoomed(plot) {
    if (this.zooming || !this.list.length) return;
    const { min, max } = plot.scales.x;
    const whole = min <= this.model.start + 1e-9 && max >= this.model.end - 1e-9;
    this.#zoom(whole ? null : [min, max]);
  }

  #zoom(stretch) {
    this.zooming = true;
    this.zoomed = stretch;
    const [min, max] = stretch ?? [this.model.start, this.model.end];
    for (const { plot } of this.list) plot.setScale('x', { min, max });
    this.whole.hidden = !stretch;
    this.zooming = false;
    this.app.invalidate();
  }

  resize() {
    const width = this.body.clientWidth - 8;
    if (!(width > 60) || !this.list.length) return;
    const height = this.#height(width);
    for (const { plot, isLast } of this.list) plot.setSize({ width, height: height + (isLast ? LAST : 0) });
    this.at(this.app.t);
  }

  // Beside the stage the panels share its height.
  #height(width) {
    const { stage } = this.app.places;
    const beside = !stage.hidden && stage.offsetTop === this.root.offsetTop && stage.offsetHeight;
    if (!beside || width < PHONE / 2) return width < PHONE ? LEAST + 12 : 150;
    const room = stage.offsetHeight - this.bar.offsetHeight - LAST - 10 - 22 * this.list.length;
    return Math.min(MOST, Math.max(LEAST, Math.floor(room / this.list.length)));
  }

  at(t) {
    for (const { plot, mark } of this.list) {
      const x = plot.valToPos(t, 'x');
      mark.style.display = x >= 0 && x <= plot.over.clientWidth ? '' : 'none';
      mark.style.transform = `translateX(${x}px)`;
    }
    this.#values();
  }

  // Values under the pointer where it is in a plot, else at the time shown.
  #values() {
    for (const { plot, value, content } of this.list) {
      const hovered = plot.cursor.idx;
      const [i, f] = locate(this.model.time, this.app.t);
      const at = hovered ?? i + Math.round(f);
      const words = content.curves
        .filter(c => c.kind !== 'reference')
        .map(c => {
          const x = c.values[at];
          const text = x === null || x === undefined ? '–' : fixed(x, content.digits ?? 2);
          const name = content.curves.length > 1 && c.label ? `${c.label} ` : '';
          return element('span', {}, element('i', { style: `background:${colour(c.colour)}` }), `${name}${text}`);
        });
      const when =
        hovered == null
          ? []
          : [element('span', { className: 'when', textContent: `${fixed(this.model.time[at], 2)} s` })];
      value.replaceChildren(...when, ...words);
    }
  }
}

const seconds = ticks => ticks.map((x, i) => (i === ticks.length - 1 ? `${+x.toFixed(6)} s` : `${+x.toFixed(6)}`));

const DASHES = { own: undefined, reference: [4, 4], other: [8, 4], difference: undefined };

function series({ label, colour: number, dash, kind }) {
  const style = { own: 1.5, reference: 1.2, other: 1.2, difference: 1.4 };
  return {
    label,
    stroke: kind === 'reference' ? css('--reference') : colour(number),
    width: style[kind],
    points: { show: false },
    dash: DASHES[kind] ?? (Array.isArray(dash) ? dash : dash ? [6, 4] : undefined),
  };
}

// Dashed lines; a limit beyond the axis is named at the edge that it lies behind.
function drawLimits(plot, limits) {
  const {
    ctx: pen,
    bbox: { left, top, width, height },
  } = plot;
  const px = devicePixelRatio || 1;
  pen.save();
  Object.assign(pen, {
    strokeStyle: css('--bad'),
    fillStyle: css('--bad'),
    lineWidth: px,
    textAlign: 'right',
    font: `${11 * px}px ${FONT}`,
  });
  pen.setLineDash([6 * px, 4 * px]);
  for (const { at, name } of limits) {
    const y = plot.valToPos(at, 'y', true);
    const above = y < top;
    const below = y > top + height;
    if (!above && !below) {
      pen.beginPath();
      pen.moveTo(left, y);
      pen.lineTo(left + width, y);
      pen.stroke();
    }
    if (name)
      pen.fillText(
        above ? `${name} ↑` : below ? `${name} ↓` : name,
        left + width - 4 * px,
        labelHeight(y, top, height, px),
      );
  }
  pen.restore();
}

// Above its line, below it at the upper edge.
function labelHeight(y, top, height, px) {
  const room = 12 * px;
  if (y < top + room) return Math.max(y, top) + room;
  return Math.min(y, top + height) - 6 * px;
}
