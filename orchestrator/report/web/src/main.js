// Starts the page: reads what it holds, puts the parts together, says when it is ready.
import { App } from './app.js';
import { read } from './model.js';
import { whatif } from './whatif.js';

const started = performance.now();
const page = (window.__page = { ready: false, frames: 0, time: 0, playing: false, errors: [] });
addEventListener('error', event => page.errors.push(String(event.message)));
addEventListener('unhandledrejection', event => page.errors.push(String(event.reason)));

async function start() {
  const app = new App(await read(document), page);
  page.app = app;
  await app.begin();
  app.guard('what-if', () => whatif(app));
  page.ready = true;
  page.load_ms = performance.now() - started;
  page.since_navigation_ms = performance.now();
  const calm = matchMedia('(prefers-reduced-motion: reduce)').matches || location.hash.includes('paused');
  if (!calm && app.model.end > app.model.start && app.has.replay) app.play(true);
}

start();
