// On paper: light colours, and canvases as pictures that fit the sheet.
import { element } from './dom.js';

export function printable(app) {
  let before = null;
  addEventListener('beforeprint', () => {
    if (before !== null) return;
    before = document.documentElement.dataset.theme ?? '';
    app.play(false);
    app.theme('light');
    app.draw();
    app.plots?.flush();
    for (const canvas of document.querySelectorAll('canvas')) picture(canvas);
  });
  addEventListener('afterprint', () => {
    for (const image of document.querySelectorAll('img.printed')) image.remove();
    app.theme(before);
    before = null;
  });
}

// The picture lies where the canvas does; style.css shows it on paper alone.
function picture(canvas) {
  if (!canvas.width || !canvas.height || !canvas.clientWidth) return;
  const image = element('img', {
    className: `printed ${canvas.className}`,
    src: canvas.toDataURL(),
    alt: canvas.getAttribute('aria-label') ?? '',
  });
  canvas.after(image);
}
