// node three_check.mjs FILE POSES.json: what three.js (and three-vrm) makes of a .glb, .gltf or .vrm, as JSON.
// { posed: [P W*3], bones: {name: parent}, images: [[w, h]], clips: {name: {times, vertices: [T W*3]}}, vrm }
// vrm: { version, name, bones: {human bone: node}, posed: [P W*3] as three-vrm bends it by its human bones }
import { beside, read, readPoses } from "./browser_parts.mjs";
import * as THREE from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { VRMLoaderPlugin } from "@pixiv/three-vrm";

const [file, posesFile] = process.argv.slice(2);

async function load() {
  const manager = new THREE.LoadingManager();
  manager.setURLModifier((address) => beside(file, address));
  const loader = new GLTFLoader(manager);
  loader.register((parser) => new VRMLoaderPlugin(parser));
  const bytes = read(file);
  return loader.parseAsync(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength), "");
}

// The mesh's vertices in the world, as three.js bends them on the CPU.
function vertices(scene, mesh) {
  scene.updateMatrixWorld(true);
  const found = [];
  const point = new THREE.Vector3();
  for (let i = 0; i < mesh.geometry.attributes.position.count; i++) {
    mesh.getVertexPosition(i, point).applyMatrix4(mesh.matrixWorld);
    found.push(point.x, point.y, point.z);
  }
  return found;
}

// Put every bone where its posed <- rest transform takes it, parents first.
function pose(bones, restWorld, transforms) {
  const world = transforms.map((rows, j) => new THREE.Matrix4().set(...rows.flat()).multiply(restWorld[j]));
  bones.forEach((bone, j) => {
    const parent = bones.indexOf(bone.parent);
    const outer = parent >= 0 ? world[parent] : bone.parent.matrixWorld;
    outer.clone().invert().multiply(world[j]).decompose(bone.position, bone.quaternion, bone.scale);
  });
}

function play(scene, mesh, clip) {
  const mixer = new THREE.AnimationMixer(scene);
  mixer.clipAction(clip).setLoop(THREE.LoopOnce).play();
  const times = [...new Set(clip.tracks.flatMap((track) => [...track.times]))].sort((a, b) => a - b);
  const frames = times.map((time) => {
    mixer.setTime(Math.min(time, clip.duration * (1 - 1e-7)));
    return vertices(scene, mesh);
  });
  mixer.stopAllAction();
  return { times, vertices: frames };
}

// A pose for three-vrm: each human bone's turn against its parent's, in the world's axes.
function humanPose(vrm, bones, transforms) {
  const turns = transforms.map((rows) => new THREE.Quaternion().setFromRotationMatrix(new THREE.Matrix4().set(...rows.flat())));
  const human = Object.entries(vrm.humanoid.humanBones).map(([name, { node }]) => [name, bones.indexOf(node)]);
  return Object.fromEntries(
    human.map(([name, j]) => {
      const parent = bones.indexOf(bones[j].parent);
      const outer = parent >= 0 ? turns[parent].clone().invert() : new THREE.Quaternion();
      return [name, { rotation: outer.multiply(turns[j]).toArray() }];
    }),
  );
}

function describeVrm(vrm, scene, mesh, bones, poses) {
  if (!vrm) return null;
  const named = Object.entries(vrm.humanoid.humanBones).map(([bone, { node }]) => [bone, node.name]);
  mesh.skeleton.pose();
  const posed = poses.map((transforms) => {
    vrm.humanoid.resetNormalizedPose();
    vrm.humanoid.setNormalizedPose(humanPose(vrm, bones, transforms));
    vrm.update(0);
    return vertices(scene, mesh);
  });
  return { version: vrm.meta.metaVersion, name: vrm.meta.name, bones: Object.fromEntries(named), posed };
}

const gltf = await load();
const { names, T_posed_rest } = readPoses(posesFile);
const meshes = [];
gltf.scene.traverse((o) => o.isSkinnedMesh && meshes.push(o));
if (meshes.length !== 1) throw new Error(`${meshes.length} skinned meshes; one is wanted`);
const [mesh] = meshes;
const clips = Object.fromEntries(gltf.animations.map((clip) => [clip.name, play(gltf.scene, mesh, clip)]));
mesh.skeleton.pose();
const rest = vertices(gltf.scene, mesh);
const bones = mesh.skeleton.bones;
const order = names.map((_, j) => bones[j]);
const restWorld = order.map((bone) => bone.matrixWorld.clone());
const posed = T_posed_rest.map((transforms) => {
  pose(order, restWorld, transforms);
  return vertices(gltf.scene, mesh);
});
const nameOf = (bone) => bone.userData.name ?? bone.name;
console.log(
  JSON.stringify({
    rest,
    posed,
    bones: Object.fromEntries(order.map((b) => [nameOf(b), bones.includes(b.parent) ? nameOf(b.parent) : null])),
    images: [mesh.material.map, mesh.material.normalMap].flatMap((map) => (map ? [[map.image.width, map.image.height]] : [])),
    clips,
    morphs: Object.keys(mesh.morphTargetDictionary ?? {}),
    vrm: describeVrm(gltf.userData.vrm, gltf.scene, mesh, order, T_posed_rest),
  }),
);
