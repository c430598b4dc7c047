// The stage: the 3-D view with its controls; without WebGL the span from the side takes its place.
import { element, fixed } from './dom.js';
import { View } from './scene.js';

export class Stage {
  constructor(app, root) {
    this.app = app;
    this.root = root;
    root.append(document.getElementById('stage-parts').content.cloneNode(true));
    this.viewport = root.querySelector('.viewport');
    this.canvas = root.querySelector('.scene');
    this.inset = root.querySelector('.inset');
    this.hud = root.querySelector('.hud');
    this.key = root.querySelector('.key');
    this.#controls();
    new ResizeObserver(() => this.#fit()).observe(this.viewport);
  }

  act(name) {
    return this.root.querySelector(`[data-act=${name}]`);
  }

  show(model, note) {
    const scrub = this.act('scrub');
    Object.assign(scrub, { min: model.start, max: model.end, step: 'any' });
    this.root.classList.toggle('has-reference', model.hasReference);
    this.#openView(model);
    const words = model.head.alt ?? `Replay of ${model.head.title ?? 'the landing'}`;
    this.canvas.setAttribute('aria-label', note ? `${words} (${note})` : words);
    if (this.gl) this.app.guard('scene', () => this.gl.show(model));
    this.#references(model);
    this.#marks();
  }

  // The 3-D view is made with the first model that has something to show in it.
  #openView(model) {
    if (this.gl || this.flat || !(model.head.line || model.head.robot)) return;
    try {
      this.gl = new View(this.canvas, () => this.app.invalidate());
    } catch (error) {
      this.flat = true;
      this.app.page.no_gl = String(error);
      this.root.classList.add('flat');
      this.root.querySelector('.no-gl').hidden = false;
    }
    this.#fit();
  }

  #fit() {
    if (this.viewport.clientWidth && this.viewport.clientHeight) this.gl?.size();
    this.app.invalidate();
  }

  at(t) {
    if (this.gl && !this.root.hidden) this.gl.update(t);
    const scrub = this.act('scrub');
    const text = fixed(t, 2);
    scrub.value = t;
    scrub.setAttribute('aria-valuetext', `${text} seconds`);
    this.root.querySelector('.clock').textContent = `${text} s`;
  }

  theme() {
    this.gl?.theme();
    this.#marks();
  }

  playing(on) {
    const button = this.act('play');
    button.textContent = on ? '❚❚' : '▶';
    button.setAttribute('aria-label', on ? 'Pause' : 'Play');
  }

  view(name) {
    this.gl?.view(name);
    this.#marks();
    this.app.invalidate();
  }

  #controls() {
    const { app } = this;
    const change = (name, action) => {
      this.act(name).addEventListener('change', event => {
        action(event.target);
        this.#marks();
        app.invalidate();
      });
    };
    this.act('play').onclick = () => app.play(!app.playing);
    this.act('scrub').oninput = event => {
      app.play(false);
      app.seek(Number(event.target.value));
    };
    this.act('scrub').setAttribute('data-own-keys', '');
    this.act('scrub').onkeydown = event => this.#scrubKey(event);
    change('speed', select => {
      app.speed = Number(select.value);
    });
    change('heights', select => this.gl?.set({ heights: Number(select.value) }));
    change('forces', select => this.gl?.set({ forces: select.value }));
    change('trace', box => this.gl?.set({ trace: box.checked }));
    change('reference', select => this.gl?.set({ reference: Number(select.value) }));
    for (const button of this.root.querySelectorAll('[data-view]'))
      button.onclick = () => this.view(button.dataset.view);
  }

  // A range without steps moves by a hundredth; a landing is moved through as with the arrow keys elsewhere.
  #scrubKey(event) {
    const step = { ArrowRight: 0.05, ArrowUp: 0.05, ArrowLeft: -0.05, ArrowDown: -0.05, PageUp: 1, PageDown: -1 }[
      event.key
    ];
    if (step) {
      this.app.seek(this.app.t + step);
      event.preventDefault();
    }
    if (event.key === ' ') {
      this.app.play(!this.app.playing);
      event.preventDefault();
    }
  }

  // How the reference is drawn: not at all, where it is, or with its difference from the run exaggerated.
  #references(model) {
    const select = this.act('reference');
    const found = this.gl && model.hasReference;
    const values = found
      ? [0, ...new Set([1, ...[1, 2, 3, 4, 5, 6].map(n => 10 ** n), this.gl.options.reference])]
      : [0];
    select.replaceChildren(
      ...values
        .sort((a, b) => a - b)
        .map(value => {
          const text =
            value === 0 ? 'hidden' : value === 1 ? 'as it is' : `difference ×${value.toLocaleString('en')}`;
          return element('option', { value, textContent: text });
        }),
    );
    if (found) select.value = this.gl.options.reference;
  }

  // Buttons, selects and the key say what the view does, whoever changed it.
  #marks() {
    const view = this.gl;
    for (const button of this.root.querySelectorAll('[data-view]')) {
      button.setAttribute('aria-pressed', String(view?.name === button.dataset.view));
    }
    for (const node of this.root.querySelectorAll('.for-scene')) node.hidden = !view;
    if (!view) return this.key.replaceChildren();
    const { heights, size } = view.options;
    this.#choose(this.act('heights'), heights);
    this.root.querySelector('[data-say=size]').textContent = size === 1 ? '' : `robot ×${size}`;
    this.key.replaceChildren(
      ...view.legend().map(([name, text]) => element('span', {}, element('i', { className: `k-${name}` }), text)),
    );
  }

  #choose(select, value) {
    if (![...select.options].some(option => Number(option.value) === value)) {
      select.append(element('option', { value, textContent: `×${value}` }));
    }
    select.value = value;
  }

  info() {
    return this.gl?.info() ?? null;
  }
  state() {
    return this.gl?.state() ?? null;
  }
}
