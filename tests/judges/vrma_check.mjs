// node vrma_check.mjs FILE.vrm FILE.vrma TIMES.json: { vertices: [clip [frame W*3]] }, as three-vrm-animation plays
// the animations on the person, at the times given for each in seconds.
import { read } from "./browser_parts.mjs";
import * as THREE from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { VRMLoaderPlugin } from "@pixiv/three-vrm";
import { VRMAnimationLoaderPlugin, createVRMAnimationClip } from "@pixiv/three-vrm-animation";

const [file, motionFile, times] = process.argv.slice(2);

async function load(path) {
  const loader = new GLTFLoader(new THREE.LoadingManager());
  loader.register((parser) => new VRMLoaderPlugin(parser));
  loader.register((parser) => new VRMAnimationLoaderPlugin(parser));
  const bytes = read(path);
  return loader.parseAsync(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength), "");
}

const { scene, userData } = await load(file);
const { vrm } = userData;
const meshes = [];
scene.traverse((o) => o.isSkinnedMesh && meshes.push(o));

function vertices(mesh) {
  scene.updateMatrixWorld(true);
  const found = [];
  const point = new THREE.Vector3();
  for (let i = 0; i < mesh.geometry.attributes.position.count; i++) {
    mesh.getVertexPosition(i, point).applyMatrix4(mesh.matrixWorld);
    found.push(point.x, point.y, point.z);
  }
  return found;
}

const { vrmAnimations } = (await load(motionFile)).userData;
const played = vrmAnimations.map((animation, index) => {
  const clip = createVRMAnimationClip(animation, vrm);
  const mixer = new THREE.AnimationMixer(vrm.scene);
  mixer.clipAction(clip).setLoop(THREE.LoopOnce).play();
  const frames = JSON.parse(times)[index].map((time) => {
    mixer.setTime(Math.min(time, clip.duration * (1 - 1e-7)));
    vrm.update(0);
    return vertices(meshes[0]);
  });
  mixer.stopAllAction();
  return frames;
});
console.log(JSON.stringify({ vertices: played }));
