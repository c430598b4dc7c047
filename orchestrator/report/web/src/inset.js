// The whole span from the side, in two dimensions: supports, band of all shapes, line at rest, line now, robot.
import { css, FONT, pixels } from './dom.js';
import { contactArc } from './geometry.js';
import { hermite } from './model.js';

const SAMPLES = 96;
const MARGIN = 14;
const TOP = 24;
const MOST = 60;

const samples = nodes => {
  const out = [];
  const first = nodes.s[0];
  const length = nodes.s[nodes.s.length - 1] - first;
  for (let i = 0; i <= SAMPLES; i++) out.push(hermite(nodes, first + (length * i) / SAMPLES));
  return out;
};

export class Inset {
  constructor(app, canvas) {
    this.app = app;
    this.canvas = canvas;
    new ResizeObserver(() => app.invalidate()).observe(canvas);
  }

  show(model) {
    this.band = model.band();
    this.canvas.hidden = !this.band;
    if (!this.band) return;
    const rest = model.line(model.start);
    this.rest = rest && samples(rest);
    const lows = [...this.band.low].filter(Number.isFinite);
    const highs = [...this.band.high].filter(Number.isFinite);
    this.range = [Math.min(...lows), Math.max(...highs)];
    const length = Math.abs(this.band.y[this.band.y.length - 1] - this.band.y[0]);
    this.canvas.setAttribute(
      'aria-label',
      `The whole span of ${length.toFixed(0)} m from the side, with all shapes of the line`,
    );
  }

  at(t, model) {
    const drawing = this.band && pixels(this.canvas);
    if (!drawing) return;
    const scale = this.#scale(drawing);
    this.#supports(drawing, scale);
    this.#band(drawing, scale);
    if (this.rest) stroke(drawing.pen, this.rest, scale, css('--muted'), 1, [4, 3]);
    const reference = model.hasReference && model.line(t, `reference/${model.linePrefix}`);
    if (reference) stroke(drawing.pen, samples(reference), scale, css('--ghost'), 2.5, [6, 3]);
    const nodes = model.line(t);
    if (nodes) stroke(drawing.pen, samples(nodes), scale, css('--ink'), 1.7);
    if (nodes && model.head.robot) dot(drawing.pen, hermite(nodes, contactArc(model, t)), scale);
    this.#caption(drawing, scale);
  }

  #scale({ width, height }) {
    const { y } = this.band;
    const [low, high] = this.range;
    const length = Math.abs(y[y.length - 1] - y[0]) || 1;
    const kx = (width - 2 * MARGIN) / length;
    const kz = Math.min((height - TOP - MARGIN) / (high - low || 1e-9), MOST * kx);
    const zero = Math.min(y[0], y[y.length - 1]);
    return { x: p => MARGIN + (p - zero) * kx, z: p => TOP + (high - p) * kz, ratio: kz / kx, length };
  }

  #supports({ pen, height }, { x, z }) {
    const { y, high } = this.band;
    pen.strokeStyle = css('--muted');
    pen.lineWidth = 2;
    for (const j of [0, y.length - 1]) {
      const [px, pz] = [x(y[j]), z(high[j])];
      pen.beginPath();
      pen.moveTo(px, pz - 6);
      pen.lineTo(px, height);
      pen.moveTo(px - 6, pz - 2);
      pen.lineTo(px + 6, pz - 2);
      pen.stroke();
    }
  }

  #band({ pen }, { x, z }) {
    const { y, low, high } = this.band;
    pen.fillStyle = css('--band');
    pen.beginPath();
    for (let j = 0; j < y.length; j++) pen.lineTo(x(y[j]), z(high[j]));
    for (let j = y.length - 1; j >= 0; j--) pen.lineTo(x(y[j]), z(low[j]));
    pen.fill();
  }

  #caption({ pen, width }, { ratio, length }) {
    pen.fillStyle = css('--muted');
    pen.font = `11px ${FONT}`;
    pen.textAlign = 'center';
    const times = ratio >= 10 ? ratio.toFixed(0) : ratio.toFixed(1);
    pen.fillText(`span ${length.toFixed(0)} m, heights ×${times}; band: all shapes`, width / 2, 13);
  }
}

function stroke(pen, points, { x, z }, style, width, dash = []) {
  pen.setLineDash(dash);
  pen.strokeStyle = style;
  pen.lineWidth = width;
  pen.beginPath();
  for (const p of points) pen.lineTo(x(p[1]), z(p[2]));
  pen.stroke();
  pen.setLineDash([]);
}

function dot(pen, p, { x, z }) {
  pen.fillStyle = css('--robot');
  pen.beginPath();
  pen.arc(x(p[1]), z(p[2]), 4.5, 0, 7);
  pen.fill();
}
