"""Judges that the system's packages bring: Godot 3's headless editor (godot3-server), assimp (assimp-utils).

Without one the test skips; where SYSTEM_JUDGES is set, as `.ci/run` does, it fails.
"""

import json
import os
import re
import shutil
import subprocess
import tempfile
import time
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from assets.asset.asset import Asset
from tests.verdicts import JUDGES

PROJECT_GODOT = 'config_version=4\n[application]\nconfig/name="judge"\n'
# As the editor imports by default, but for 16 bits a weight, which alone move vertices by up to 0.1 mm.
IMPORT_GODOT = '[remap]\nimporter="scene"\ntype="PackedScene"\n[params]\nmeshes/compress=false\n'
PATIENCE = 60.0  # seconds


def require_program(name: str, package: str) -> str:
    """Where a program is; without it the test skips, or fails where the system's judges are wanted."""
    found = shutil.which(name)
    if found is None and os.environ.get("SYSTEM_JUDGES"):
        pytest.fail(f"{name} is not installed; .ci/run installs Debian's {package}")
    if found is None:
        pytest.skip(f"{name} is not installed; it is in Debian's package {package}")
    return found


@dataclass(frozen=True)
class Scene:
    """What assimp read: corners as they stand in the file, and the skin where there is one."""

    vertices: np.ndarray  # [W 3]
    faces: np.ndarray  # [F 3]
    uv_count: int
    bones: dict[str, np.ndarray]  # inverse bind matrices [4 4]
    weights: np.ndarray  # [W J], columns as in `bones`
    clips: tuple[str, ...]
    parents: dict[str, str | None]  # of every node
    T_world_node: dict[str, np.ndarray]  # of every node, at rest

    def posed(self, T_posed_rest: dict[str, np.ndarray]) -> np.ndarray:
        """The vertices [W 3] under assimp's own weights and bind matrices."""
        homogeneous = np.concatenate([self.vertices, np.ones((len(self.vertices), 1))], axis=1)
        bent = np.zeros_like(homogeneous)
        for column, (name, bind) in enumerate(self.bones.items()):
            T_world_mesh = T_posed_rest[name] @ self.T_world_node[name] @ bind
            bent += self.weights[:, column : column + 1] * (homogeneous @ T_world_mesh.T)
        return bent[:, :3]


def assimp_scene(path: Path) -> Scene:
    """A file as assimp reads it, without any step after the reading."""
    program = require_program("assimp", "assimp-utils")
    with tempfile.TemporaryDirectory() as folder:
        dump = Path(folder) / "dump.assxml"
        run = subprocess.run(
            [program, "dump", str(path), str(dump)], capture_output=True, text=True, timeout=PATIENCE
        )
        assert dump.exists(), run.stdout + run.stderr
        root = ElementTree.parse(dump).getroot()
    (mesh,) = root.iter("Mesh")
    vertices = numbers(mesh.find("Positions")).reshape(-1, 3)
    bones = {str(bone.get("name")): numbers(bone.find("Matrix4")).reshape(4, 4) for bone in mesh.iter("Bone")}
    weights = np.zeros((len(vertices), len(bones)))
    for column, bone in enumerate(mesh.iter("Bone")):
        for weight in bone.iter("Weight"):
            weights[int(weight.get("index", -1)), column] += float(weight.text or "nan")
    return Scene(
        vertices=vertices,
        faces=np.array([numbers(face) for face in mesh.iter("Face")], dtype=np.int64),
        uv_count=len(numbers(mesh.find("TextureCoords"))) // 2,
        bones=bones,
        weights=weights,
        clips=tuple(str(clip.get("name")) for clip in root.iter("Animation")),
        parents={
            str(child.get("name")): node.get("name")
            for node in root.iter("Node")
            for child in node.findall("NodeList/Node")
        },
        T_world_node=world_transforms(root.find("Scene/Node"), np.eye(4)),
    )


def world_transforms(node: ElementTree.Element | None, T_world_outer: np.ndarray) -> dict[str, np.ndarray]:
    """World <- node of a node and all below it."""
    if node is None:
        return {}
    T_world_node = T_world_outer @ numbers(node.find("Matrix4")).reshape(4, 4)
    found = {str(node.get("name")): T_world_node}
    for child in node.findall("NodeList/Node"):
        found |= world_transforms(child, T_world_node)
    return found


def numbers(element: ElementTree.Element | None) -> np.ndarray:
    return np.array((element.text or "").split() if element is not None else [], dtype=np.float64)


@dataclass(frozen=True)
class Played:
    """What Godot found, the vertices at rest [W 3] and bent [P W 3]."""

    found: dict
    rest: np.ndarray
    posed: np.ndarray


def ask_godot(path: Path, asset: Asset, T_posed_rest: np.ndarray) -> Played:
    """A .glb imported by Godot's editor and bent by its skeleton; `T_posed_rest` is [P J 4 4]."""
    program = require_program("godot3-server", "godot3-server")
    names = asset.skeleton.joint_names
    poses = [
        dict(zip(map(name_in_godot, names), transforms.tolist(), strict=True)) for transforms in T_posed_rest
    ]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        shutil.copy(path, folder / "person.glb")
        (folder / "project.godot").write_text(PROJECT_GODOT)
        (folder / "person.glb.import").write_text(IMPORT_GODOT)
        (folder / "poses.json").write_text(json.dumps({"T_posed_rest": poses}))
        home = os.environ | {"HOME": name, "XDG_CONFIG_HOME": name, "XDG_DATA_HOME": name}
        import_in_godot(program, folder, home)
        command = [program, "--path", name, "-s", str(JUDGES / "godot_check.gd")]
        run = subprocess.run(command, env=home, capture_output=True, text=True, timeout=PATIENCE)
        assert (folder / "found.bin").exists(), run.stdout + run.stderr
        flat = np.fromfile(folder / "found.bin", dtype="<f4").astype(np.float64)
        vertices = flat.reshape(1 + len(T_posed_rest), -1, 3)
        found = json.loads((folder / "found.json").read_text())
    return Played(found=found, rest=vertices[0], posed=vertices[1:])


def name_in_godot(name: str) -> str:
    """Godot 3 parts the words and numbers of bones' names: LeftHand becomes left_hand, spine1 spine_1."""
    return re.sub(r"(?<=[a-z])(?=[A-Z0-9])", "_", name).lower()


def import_in_godot(program: str, folder: Path, home: dict[str, str]) -> None:
    """Let the editor import what lies in the folder. This one never ends by itself when told to quit."""
    command = [program, "--path", str(folder), "--editor"]
    with subprocess.Popen(command, env=home, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        deadline = time.monotonic() + PATIENCE
        while not list(folder.glob(".import/*.md5")) and time.monotonic() < deadline:
            time.sleep(0.05)
        process.kill()
    assert list(folder.glob(".import/*.md5")), "Godot has not imported the file in time"
