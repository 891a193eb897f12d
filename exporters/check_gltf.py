"""What is wrong with a .glb, .gltf or .vrm file: the verdict of Khronos' validator, which runs in Node.

The validator is looked for among Node's own packages and, in a checkout, among the tests' judges.
"""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

VALIDATE = """
const fs = require("node:fs");
const path = require("node:path");
const validator = require("gltf-validator");
const file = process.argv[1];
const beside = (uri) => path.join(path.dirname(file), decodeURIComponent(uri));
const options = {
  maxIssues: 1000,
  externalResourceFunction: async (uri) => new Uint8Array(fs.readFileSync(beside(uri))),
};
validator
  .validateBytes(new Uint8Array(fs.readFileSync(file)), options)
  .then((report) => console.log(JSON.stringify(report.issues)))
  .catch((error) => console.log(JSON.stringify({ unreadable: String(error) })));
"""
SECONDS = 120  # a large file takes one
HARMLESS = ("NODE_SKINNED_MESH_NON_ROOT",)  # an Armature node above a mesh has no transform to be lost
WARNING = 1  # severities up to it are faults; notes and hints are above


def check_gltf(path: str | Path) -> list[str] | None:
    """Every error and warning about the file, a sentence each; None where the validator is missing."""
    report = khronos_report(path)
    if report is None:
        return None
    if "unreadable" in report:
        return ["the file cannot be read as glTF; it is damaged, cut short or of another kind"]
    return [
        f"{message['pointer']}: {message['message']}" if message.get("pointer") else message["message"]
        for message in report["messages"]
        if message["severity"] <= WARNING and message["code"] not in HARMLESS
    ]


def khronos_report(path: str | Path) -> dict | None:
    """The validator's own words: `messages` and their counts, or why the file is `unreadable`.

    None where Node or the validator is not installed.
    """
    node = shutil.which("node") or shutil.which("node", path=Path(sys.executable).parent)
    folders = package_folders(node) if node else []
    if node is None or not any((folder / "gltf-validator").is_dir() for folder in folders):
        return None
    places = os.environ | {"NODE_PATH": os.pathsep.join(map(str, folders))}
    command = [node, "-e", VALIDATE, str(Path(path).resolve())]
    try:
        run = subprocess.run(
            command, env=places, capture_output=True, encoding="utf-8", timeout=SECONDS, check=True
        )
    except subprocess.SubprocessError:
        return {"unreadable": "the validator gave up on it"}
    return json.loads(run.stdout)


def package_folders(node: str) -> list[Path]:
    """Where Node's packages may be: the tests' judges, NODE_PATH, and what `npm install -g` fills."""
    named = [Path(place) for place in os.environ.get("NODE_PATH", "").split(os.pathsep) if place]
    project = Path(__file__).parents[1]
    shared = Path(node).resolve().parents[1] / "lib" / "node_modules"
    return [project / "tests" / "judges" / "node_modules", *named, shared]
