// Little helpers for elements and colours.

export function element(tag, properties = {}, ...children) {
  const node = Object.assign(document.createElement(tag), properties);
  node.append(...children);
  return node;
}

// Value of a CSS variable as it is now: colours live in style.css alone.
export const css = name => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

export const colour = number => css(`--c${number ?? 1}`);

export const fixed = (value, digits = 2) => {
  if (!Number.isFinite(value)) return '–';
  const text = value.toFixed(digits);
  return Number(text) === 0 ? text.replace('-', '') : text.replace('-', '−'); // no −0
};

// Small drawings are made in memory: where graphics are software, curves sent to "the card" take seconds.
const IN_MEMORY = { willReadFrequently: true };

// Make something whose canvases are to be drawn in memory, although it does not ask for that itself (uPlot).
export function inMemory(make) {
  const prototype = HTMLCanvasElement.prototype;
  const { getContext } = prototype;
  prototype.getContext = function context(kind, options) {
    return getContext.call(this, kind, { ...options, ...IN_MEMORY });
  };
  try {
    return make();
  } finally {
    prototype.getContext = getContext;
  }
}

// A canvas of as many pixels as its place on the screen has; returns what is needed to draw in CSS pixels.
export function pixels(canvas) {
  const ratio = Math.min(devicePixelRatio || 1, 2);
  const width = canvas.clientWidth;
  const height = canvas.clientHeight;
  if (!width || !height) return null;
  const [w, h] = [Math.round(width * ratio), Math.round(height * ratio)];
  if (canvas.width !== w || canvas.height !== h) {
    canvas.width = w;
    canvas.height = h;
  }
  const pen = canvas.getContext('2d', IN_MEMORY);
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  return { pen, width, height };
}

export const FONT = 'system-ui, -apple-system, "Segoe UI", Roboto, "DejaVu Sans", sans-serif';
