// node spring_check.mjs FILE.vrm MOVES.json: a person whose springs three-vrm swings, as JSON.
// MOVES.json holds `frames`, [{ place: [x, y, z], turns: {human bone: quaternion} }], a sixtieth of a second each,
// and `vertices`, whose places are wanted. Printed are { joints: [name], places: [T n*3] }: the joints that sway, and
// where those vertices are in the world after each frame.
import { read } from "./browser_parts.mjs";
import * as THREE from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { VRMLoaderPlugin } from "@pixiv/three-vrm";

const [file, movesFile] = process.argv.slice(2);
const moves = JSON.parse(new TextDecoder().decode(read(movesFile)));
const loader = new GLTFLoader();
loader.register((parser) => new VRMLoaderPlugin(parser));
const bytes = read(file);
const { vrm } = (await loader.parseAsync(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength), "")).userData;
const meshes = [];
vrm.scene.traverse((o) => o.isSkinnedMesh && meshes.push(o));
const [mesh] = meshes;
vrm.scene.updateMatrixWorld(true);
vrm.springBoneManager.setInitState();
const point = new THREE.Vector3();
const places = moves.frames.map(({ place, turns }) => {
  vrm.scene.position.set(...place);
  for (const [bone, turn] of Object.entries(turns)) vrm.humanoid.getNormalizedBoneNode(bone).quaternion.set(...turn);
  vrm.scene.updateMatrixWorld(true);
  vrm.update(1 / 60);
  vrm.scene.updateMatrixWorld(true);
  return moves.vertices.flatMap((v) => mesh.getVertexPosition(v, point).applyMatrix4(mesh.matrixWorld).toArray());
});
console.log(JSON.stringify({ joints: [...vrm.springBoneManager.joints].map(({ bone }) => bone.name), places }));
