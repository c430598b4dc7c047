// Arrows for forces: all shafts in one draw call, all heads in another.
import {
  Color,
  ConeGeometry,
  CylinderGeometry,
  InstancedMesh,
  Matrix4,
  MeshPhongMaterial,
  Quaternion,
  Vector3,
} from 'three';

const UP = new Vector3(0, 1, 0);
const HEAD = 0.11; // m, of an arrow of size 1

export class Arrows {
  #matrix = new Matrix4();
  #turn = new Quaternion();
  #direction = new Vector3();
  #place = new Vector3();
  #scale = new Vector3();
  #colour = new Color();

  constructor(most) {
    const material = new MeshPhongMaterial({ color: 0xffffff, emissive: 0x222222, shininess: 20 });
    this.shafts = new InstancedMesh(new CylinderGeometry(0.014, 0.014, 1, 14).translate(0, 0.5, 0), material, most);
    this.heads = new InstancedMesh(new ConeGeometry(0.038, HEAD, 22).translate(0, HEAD / 2, 0), material, most);
    this.most = most;
    this.meshes = [this.shafts, this.heads];
    for (const mesh of this.meshes) mesh.frustumCulled = false;
    this.clear();
  }

  clear() {
    this.count = 0;
    for (const mesh of this.meshes) mesh.count = 0;
  }

  // An arrow from `from` along `vector`, `length` m long, `size` thick; what is too short to be seen is left out.
  add(from, vector, length, size, colour) {
    if (this.count >= this.most || !(length > 0.02 * size)) return;
    this.#direction.set(...vector).normalize();
    this.#turn.setFromUnitVectors(UP, this.#direction);
    const head = Math.min(HEAD * size, 0.6 * length);
    const thick = Math.min(size, head / HEAD);
    this.#put(this.shafts, from, 0, [thick, length - head, thick], colour);
    this.#put(this.heads, from, length - head, [thick, thick, thick], colour);
    this.count++;
    for (const mesh of this.meshes) mesh.count = this.count;
  }

  #put(mesh, from, ahead, scale, colour) {
    this.#place.set(...from).addScaledVector(this.#direction, ahead);
    mesh.setMatrixAt(this.count, this.#matrix.compose(this.#place, this.#turn, this.#scale.set(...scale)));
    mesh.setColorAt(this.count, this.#colour.set(colour));
    mesh.instanceMatrix.needsUpdate = mesh.instanceColor.needsUpdate = true;
  }
}
