// The line as a tube: exact ANCF shape, true diameter but never thinner than two pixels, strands as a texture.
import {
  BufferGeometry,
  CanvasTexture,
  DynamicDrawUsage,
  Float32BufferAttribute,
  Mesh,
  MeshPhongMaterial,
  RepeatWrapping,
  SRGBColorSpace,
} from 'three';
import { hermite } from './model.js';

const SIDES = 12;
const PIXELS = 1.1; // least radius
const LAY = 9; // length in which a strand goes once round, in diameters
const STRANDS = 8;

// Arc lengths with a ring: the nodes, every `step`, and dense where robots land.
export function ringsAt(arc, focus, step) {
  const [first, last] = [arc[0], arc[arc.length - 1]];
  const found = new Set([...arc]);
  for (let s = first; s < last; s += step) found.add(s);
  for (const centre of focus) {
    for (let d = 0; d < 5; d += 0.015 + 0.06 * d) {
      found.add(centre + d);
      found.add(centre - d);
    }
  }
  return Float64Array.from([...found].filter(s => s >= first && s <= last)).sort();
}

// One tile of the surface, `rows` strands high; `paint` gives a grey (or a normal) for the place across a strand.
function tile(paint) {
  const size = 64;
  const canvas = document.createElement('canvas');
  canvas.width = canvas.height = size;
  const pen = canvas.getContext('2d');
  const image = pen.createImageData(size, size);
  for (let y = 0; y < size; y++) {
    for (let x = 0; x < size; x++) {
      // strands run diagonally over the tile, so that it repeats in both directions
      const across = 2 * (((x + y) / size) % 1) - 1;
      image.data.set([...paint(across), 255], 4 * (y * size + x));
    }
  }
  pen.putImageData(image, 0, 0);
  const texture = new CanvasTexture(canvas);
  texture.wrapS = texture.wrapT = RepeatWrapping;
  texture.anisotropy = 8;
  return texture;
}

export function strandMaterial() {
  const map = tile(u => {
    const grey = 96 + 118 * Math.sqrt(1 - u * u * 0.96);
    return [grey, grey + 2, grey + 5];
  });
  map.colorSpace = SRGBColorSpace;
  const normalMap = tile(u => [128 + 70 * u, 128 + 70 * u, 128 + 126 * Math.sqrt(1 - u * u * 0.6)]);
  return new MeshPhongMaterial({ color: 0xd8dde2, map, normalMap, shininess: 60, specular: 0x666666 });
}

export class Cable {
  constructor(arc, radius, focus, material) {
    this.radius = radius;
    this.s = ringsAt(arc, focus, Math.max((arc[arc.length - 1] - arc[0]) / 160, 0.02));
    this.centre = new Float32Array(3 * this.s.length);
    this.mesh = new Mesh(this.#geometry(), material);
    this.mesh.frustumCulled = false;
  }

  #geometry() {
    const n = this.s.length;
    const row = SIDES + 1;
    const index = [];
    const uv = new Float32Array(2 * n * row);
    const pitch = (2 * this.radius * LAY) / STRANDS; // of the pattern along the line
    for (let i = 0, o = 0; i < n; i++) {
      for (let k = 0; k <= SIDES; k++) {
        uv[o++] = (STRANDS * k) / SIDES;
        uv[o++] = this.s[i] / pitch;
      }
    }
    for (let i = 0; i < n - 1; i++) {
      for (let k = 0, a = i * row; k < SIDES; k++, a++) index.push(a, a + row, a + 1, a + row, a + row + 1, a + 1);
    }
    const geometry = new BufferGeometry().setIndex(index);
    geometry.setAttribute('uv', new Float32BufferAttribute(uv, 2));
    for (const name of ['position', 'normal']) {
      const values = new Float32BufferAttribute(new Float32Array(3 * n * row), 3);
      geometry.setAttribute(name, values.setUsage(DynamicDrawUsage));
    }
    return geometry;
  }

  // Bring the tube to the shape of `nodes`; `place` moves a point to where it is drawn, `eye` sees it.
  shape(nodes, place, eye, perPixel) {
    const point = [0, 0, 0];
    for (let i = 0; i < this.s.length; i++) {
      this.centre.set(place(hermite(nodes, this.s[i], point)), 3 * i);
    }
    this.#skin(eye, perPixel);
  }

  #skin(eye, perPixel) {
    const { position, normal } = this.mesh.geometry.attributes;
    const c = this.centre;
    const last = this.s.length - 1;
    for (let i = 0; i <= last; i++) {
      const o = 3 * i;
      const l = 3 * Math.max(i - 1, 0);
      const r = 3 * Math.min(i + 1, last);
      const frame = across(c[r] - c[l], c[r + 1] - c[l + 1], c[r + 2] - c[l + 2]);
      const distance = Math.hypot(c[o] - eye.x, c[o + 1] - eye.y, c[o + 2] - eye.z);
      ring(
        position.array,
        normal.array,
        i * (SIDES + 1) * 3,
        c,
        o,
        frame,
        Math.max(this.radius, PIXELS * distance * perPixel),
      );
    }
    position.needsUpdate = normal.needsUpdate = true;
  }

  dispose() {
    this.mesh.geometry.dispose();
  }
}

// Two unit vectors across a tangent: one as level as can be, and the other.
function across(x, y, z) {
  const level = Math.hypot(x, y) || 1e-12;
  const length = Math.hypot(level, z);
  const a = [y / level, -x / level, 0];
  const t = [x / length, y / length, z / length];
  return [a, [a[1] * t[2], -a[0] * t[2], a[0] * t[1] - a[1] * t[0]]];
}

const CIRCLE = Array.from({ length: SIDES + 1 }, (_, k) => [
  Math.cos((2 * Math.PI * k) / SIDES),
  Math.sin((2 * Math.PI * k) / SIDES),
]);

function ring(position, normal, from, centre, o, [a, b], radius) {
  let p = from;
  for (const [cos, sin] of CIRCLE) {
    for (let k = 0; k < 3; k++, p++) {
      normal[p] = cos * a[k] + sin * b[k];
      position[p] = centre[o + k] + radius * normal[p];
    }
  }
}
