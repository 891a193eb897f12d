// node khronos.cjs FILE: Khronos' verdict on a .glb, .gltf or .vrm as JSON on standard output.
const fs = require("node:fs");
const path = require("node:path");
const validator = require("gltf-validator");

const file = process.argv[2];
const beside = (uri) => path.join(path.dirname(file), decodeURIComponent(uri));
const options = {
  maxIssues: 1000,
  externalResourceFunction: async (uri) => new Uint8Array(fs.readFileSync(beside(uri))),
};
validator
  .validateBytes(new Uint8Array(fs.readFileSync(file)), options)
  .then((report) => console.log(JSON.stringify(report.issues)))
  .catch((error) => {
    console.error(String(error));
    process.exit(1);
  });
