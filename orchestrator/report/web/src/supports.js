// What stands around the line: towers (posts for short spans), insulators, the ground. For orientation only.
import {
  BufferGeometry,
  Color,
  CylinderGeometry,
  Float32BufferAttribute,
  Group,
  LineBasicMaterial,
  LineSegments,
  Mesh,
  MeshPhongMaterial,
  PlaneGeometry,
  ShaderMaterial,
} from 'three';
import { mergeGeometries } from 'three/examples/jsm/utils/BufferGeometryUtils.js';

const SHORT = 40; // m; shorter spans hang from posts
const STORIES = 13;

// How far the ground lies below the supports for a line that hangs `sag` (as drawn) below them.
export const groundBelow = (length, sag) =>
  length < SHORT ? Math.max(0.2 * length, 1.2 * sag + 1) : Math.max(24, 1.15 * sag + 8);

// Lattice tower of height 1 below its top at the origin, widths in m.
function lattice() {
  const lines = [];
  const width = h => 0.55 + 2.1 * h;
  const level = i => -i / STORIES;
  const corners = i =>
    [
      [-1, -1],
      [1, -1],
      [1, 1],
      [-1, 1],
    ].map(([x, y]) => [x * width(i / STORIES), y * width(i / STORIES), level(i)]);
  for (let i = 0; i < STORIES; i++) {
    const high = corners(i);
    const low = corners(i + 1);
    for (let k = 0; k < 4; k++) {
      const n = (k + 1) % 4;
      lines.push(high[k], low[k], high[k], low[n], high[n], low[k], low[k], low[n]);
    }
  }
  return lines;
}

const segments = (points, material) => {
  const geometry = new BufferGeometry();
  geometry.setAttribute('position', new Float32BufferAttribute(points.flat(), 3));
  return new LineSegments(geometry, material);
};

function arms() {
  const lines = [];
  for (const side of [-1, 1]) {
    for (const y of [-0.5, 0.5]) lines.push([0, y, 0], [4 * side, 0, 0]);
    lines.push([0, 0, 1.2], [4 * side, 0, 0]);
  }
  return lines;
}

function insulator(length) {
  const discs = Math.max(3, Math.round(length / 0.2));
  const radius = 0.06 * length;
  const one = k =>
    new CylinderGeometry(0.4 * radius, radius, (0.5 * length) / discs, 18)
      .rotateX(Math.PI / 2)
      .translate(0, 0, ((k + 0.6) * length) / discs);
  return mergeGeometries(Array.from({ length: discs }, (_, k) => one(k)));
}

// Towers at both ends of `span`, which reach the ground at height `ground` as drawn.
export class Supports {
  constructor(span, palette) {
    this.group = new Group();
    this.bodies = [];
    const short = span.length < SHORT;
    const string = short ? 0.02 * span.length : 2;
    for (const end of [span.left, span.right]) {
      const top = end[2] + string;
      const body = short ? this.#post(palette) : segments(lattice(), palette.tower);
      body.position.set(end[0], end[1], top);
      this.bodies.push(body);
      const discs = new Mesh(insulator(string), palette.insulator);
      discs.position.set(...end);
      this.group.add(body, discs);
      if (!short)
        this.group.add(
          Object.assign(segments(arms(), palette.tower), {}).translateX(end[0]).translateY(end[1]).translateZ(top),
        );
    }
  }

  #post(palette) {
    return new Mesh(new CylinderGeometry(0.05, 0.07, 1, 16).rotateX(Math.PI / 2).translate(0, 0, -0.5), palette.post);
  }

  stand(ground) {
    for (const body of this.bodies) body.scale.z = Math.max(body.position.z - ground, 1);
  }
}

export const supportPalette = () => ({
  tower: new LineBasicMaterial({ color: 0x55616e }),
  post: new MeshPhongMaterial({ color: 0x7a848f }),
  insulator: new MeshPhongMaterial({ color: 0x6b4636, shininess: 80 }),
});

const VERTEX = `varying vec3 place;
void main() {
  vec4 world = modelMatrix * vec4(position, 1.0);
  place = world.xyz;
  gl_Position = projectionMatrix * viewMatrix * world;
}`;

// Lines as wide as a pixel, fading where they would run together and with the distance.
const FRAGMENT = `varying vec3 place;
uniform vec3 line; uniform vec3 plain; uniform float cell; uniform float far;
void main() {
  vec2 at = place.xy / cell, width = fwidth(at);
  vec2 near = abs(fract(at - 0.5) - 0.5) / max(width, vec2(1e-6));
  vec2 ink = 0.8 * (1.0 - clamp(near, 0.0, 1.0)) * (1.0 - smoothstep(0.15, 0.5, width));
  float fade = 1.0 - smoothstep(0.15 * far, far, distance(place, cameraPosition));
  gl_FragColor = vec4(mix(plain, line, max(ink.x, ink.y)), fade);
}`;

export class Ground {
  constructor() {
    const uniforms = {
      line: { value: new Color() },
      plain: { value: new Color() },
      cell: { value: 20 },
      far: { value: 600 },
    };
    const material = new ShaderMaterial({
      vertexShader: VERTEX,
      fragmentShader: FRAGMENT,
      uniforms,
      transparent: true,
      depthWrite: false,
    });
    this.mesh = new Mesh(new PlaneGeometry(1, 1), material);
    this.mesh.renderOrder = -1;
  }

  // Level plane at height z about the middle of a span.
  lay([x, y], z, length) {
    const size = 12 * Math.max(length, 100);
    const { cell, far } = this.mesh.material.uniforms;
    this.mesh.position.set(x, y, z);
    this.mesh.scale.set(size, size, 1);
    cell.value = length < SHORT ? 1 : 20;
    far.value = Math.max(3 * length, 120);
  }

  colour(line, plain) {
    const { uniforms } = this.mesh.material;
    // the shader writes what the screen shows: colours as they stand in the style sheet
    uniforms.line.value.set(line).convertLinearToSRGB();
    uniforms.plain.value.set(plain).convertLinearToSRGB();
  }
}
