// node babylon_check.cjs FILE POSES.json: what Babylon.js makes of a .glb or .gltf, as JSON.
// { rest: [W*3], posed: [P W*3], bones: {name: parent} }
const fs = require("node:fs");
const path = require("node:path");
globalThis.XMLHttpRequest = class {}; // never used: files are given as data
const BABYLON = require("babylonjs");
require("babylonjs-loaders");

const [file, posesFile] = process.argv.slice(2);
const address = (bytes) => `data:application/octet-stream;base64,${bytes.toString("base64")}`;

async function load() {
  const scene = new BABYLON.Scene(new BABYLON.NullEngine());
  scene.useRightHandedSystem = true; // glTF's own axes, without a turned root
  BABYLON.SceneLoader.OnPluginActivatedObservable.add((loader) => {
    loader.preprocessUrlAsync = async (url) => {
      const beside = path.join(path.dirname(file), decodeURIComponent(url));
      return /^(data|blob):/.test(url) || !fs.existsSync(beside) ? url : address(fs.readFileSync(beside));
    };
  });
  const extension = file.endsWith(".gltf") ? ".gltf" : ".glb";
  await BABYLON.SceneLoader.AppendAsync("", address(fs.readFileSync(file)), scene, undefined, extension);
  return scene;
}

// The mesh's vertices in the world, as Babylon bends them on the CPU.
function vertices(scene, mesh) {
  scene.transformNodes.forEach((node) => node.computeWorldMatrix(true));
  scene.meshes.forEach((node) => node.computeWorldMatrix(true));
  mesh.skeleton.prepare(true);
  const found = mesh.getPositionData(true, true);
  const world = mesh.getWorldMatrix();
  const flat = [];
  for (let i = 0; i < found.length; i += 3) {
    const point = BABYLON.Vector3.TransformCoordinates(BABYLON.Vector3.FromArray(found, i), world);
    flat.push(point.x, point.y, point.z);
  }
  return flat;
}

// Put every joint's node where its posed <- rest transform takes it, parents first. Babylon's vectors are rows.
function pose(nodes, restWorld, transforms) {
  const world = transforms.map((rows, j) => {
    const T = BABYLON.Matrix.FromArray(rows.flat()).transpose();
    return restWorld[j].multiply(T);
  });
  nodes.forEach((node, j) => {
    const parent = nodes.indexOf(node.parent);
    const outer = parent >= 0 ? world[parent] : (node.parent?.getWorldMatrix() ?? BABYLON.Matrix.Identity());
    const local = world[j].multiply(BABYLON.Matrix.Invert(outer));
    node.rotationQuaternion ??= new BABYLON.Quaternion();
    local.decompose(node.scaling, node.rotationQuaternion, node.position);
  });
}

async function main() {
  const scene = await load();
  scene.animationGroups.forEach((group) => group.stop());
  const meshes = scene.meshes.filter((mesh) => mesh.skeleton);
  if (meshes.length !== 1) throw new Error(`${meshes.length} skinned meshes; one is wanted`);
  const [mesh] = meshes;
  const { names, T_posed_rest } = JSON.parse(fs.readFileSync(posesFile));
  const nodes = names.map((name) => scene.getTransformNodeByName(name));
  const rest = vertices(scene, mesh);
  const restWorld = nodes.map((node) => node.getWorldMatrix().clone());
  const posed = T_posed_rest.map((transforms) => {
    pose(nodes, restWorld, transforms);
    return vertices(scene, mesh);
  });
  const bones = nodes.map((n) => [n.name, nodes.includes(n.parent) ? n.parent.name : null]);
  const found = JSON.stringify({ rest, posed, bones: Object.fromEntries(bones) });
  process.stdout.write(`${found}\n`, () => process.exit(0)); // timers of the engine would keep it alive
}

main().catch((error) => {
  console.error(error.stack ?? String(error));
  process.exit(1);
});
