"""Ask the real judges: Khronos' validator, Blender, web engines.

Without one the test skips; under CI it fails.
"""

import json
import os
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from assets.asset.asset import Asset
from avatargen.body.model import forward_kinematics
from avatargen.body.pose import axis_angle_to_matrix
from avatargen.body.skinning import skin
from exporters import export
from exporters.check_gltf import khronos_report
from exporters.glb import pictures

PROJECT = Path(__file__).parents[1]
JUDGES = PROJECT / "tests" / "judges"
AGREE = 1e-4  # metres between Blender's vertices and ours


def require(there: bool, judge: str) -> None:
    if not there and os.environ.get("CI"):
        pytest.fail(f"{judge} is not installed; run `make judges`")
    if not there:
        pytest.skip(f"{judge} is not installed; run `make judges`")


def ask_node(script: str, package: str, *arguments: str | Path) -> dict:
    """What a judge that runs in Node prints; `package` is what it stands on."""
    node = shutil.which("node") or shutil.which("node", path=PROJECT / ".venv" / "bin")
    require(node is not None and (JUDGES / "node_modules" / package).is_dir(), package)
    command = [str(node), str(JUDGES / script), *map(str, arguments)]
    run = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert run.returncode == 0, run.stderr
    return json.loads(run.stdout.splitlines()[-1])


def khronos_issues(path: Path) -> dict:
    """What Khronos' validator has to say: `messages`, and counts of errors, warnings, notes and hints."""
    report = khronos_report(path)
    require(report is not None, "Khronos' gltf-validator")
    assert report is not None
    return report


def ask_engine(script: str, package: str, path: Path, asset: Asset, T_posed_rest: np.ndarray) -> dict:
    """What a web engine makes of a file: its `posed` vertices [P W 3], its `bones` and what else it tells."""
    poses = path.with_suffix(".poses.json")
    names = asset.skeleton.joint_names
    poses.write_text(json.dumps({"names": names, "T_posed_rest": T_posed_rest.tolist()}))
    found = ask_node(script, package, path, poses)
    found["posed"] = np.array(found["posed"]).reshape(len(T_posed_rest), len(asset.vertices), 3)
    return found


def parent_names(asset: Asset) -> dict[str, str | None]:
    """Each joint's parent by name, as the judges tell it."""
    names, parents = asset.skeleton.joint_names, asset.skeleton.parents
    return {name: names[parent] if parent >= 0 else None for name, parent in zip(names, parents, strict=True)}


@dataclass(frozen=True)
class Verdict:
    """What Blender found, its vertices at rest and in each pose, and its picture of the first pose."""

    found: dict
    rest: np.ndarray
    posed: np.ndarray
    picture: np.ndarray


def blender_python() -> Path:
    python = PROJECT / ".venv-blender" / "bin" / "python"
    require(python.exists(), "Blender (bpy in .venv-blender)")
    return python


def blender_verdict(asset: Asset, T_posed_rest: np.ndarray, folder: Path, name: str = "asset.glb") -> Verdict:
    """Export, then import and pose in Blender's own process; `T_posed_rest` is [P J 4 4]."""
    python = blender_python()
    export(asset, folder / name)
    np.savez(folder / "poses.npz", names=np.array(asset.skeleton.joint_names), T_posed_rest=T_posed_rest)
    script = JUDGES / "blender_check.py"
    command = [str(python), str(script), str(folder / name), str(folder / "poses.npz"), str(folder)]
    run = subprocess.run(command, capture_output=True, text=True, timeout=240)
    assert (folder / "posed.png").exists(), run.stdout + run.stderr
    with np.load(folder / "deformed.npz") as arrays, Image.open(folder / "posed.png") as picture:
        return Verdict(
            found=json.loads((folder / "found.json").read_text()),
            rest=arrays["rest"],
            posed=arrays["posed"],
            picture=np.asarray(picture.convert("RGB")).astype(float),
        )


def blender_motion(
    path: Path, clips: list[str], seconds: list[float], keys: list[str], weights: np.ndarray
) -> dict[str, np.ndarray]:
    """A file as Blender plays it: see blender_motion.py. A moment is a clip's name, a time and weights."""
    python = PROJECT / ".venv-blender" / "bin" / "python"
    require(python.exists(), "Blender (bpy in .venv-blender)")
    asked, found = path.with_suffix(".asked.npz"), path.with_suffix(".found.npz")
    np.savez(
        asked,
        clips=np.array(clips),
        seconds=np.array(seconds),
        keys=np.array(keys, dtype=str),
        weights=weights,
    )
    command = [str(python), str(JUDGES / "blender_motion.py"), str(path), str(asked), str(found)]
    run = subprocess.run(command, capture_output=True, text=True, timeout=240)
    assert found.exists(), run.stdout + run.stderr
    with np.load(found) as arrays:
        return dict(arrays)


def random_poses(asset: Asset, count: int, angle: float) -> np.ndarray:
    """Posed <- rest transforms [P J 4 4] of poses that turn every joint by up to `angle` radians an axis."""
    generator = np.random.default_rng(0)
    rest = asset.skeleton.T_world_joint
    poses = []
    for _ in range(count):
        turns = axis_angle_to_matrix(generator.uniform(-angle, angle, (len(rest), 3)))
        T_posed_rest = forward_kinematics(rest[:, :3, 3].copy(), turns, asset.skeleton.parents)
        T_posed_rest[:, :3, 3] -= np.einsum("jab,jb->ja", T_posed_rest[:, :3, :3], rest[:, :3, 3])
        poses.append(T_posed_rest)
    return np.array(poses)


def our_vertices(asset: Asset, T_posed_rest: np.ndarray) -> np.ndarray:
    weights = np.zeros((len(asset.vertices), len(T_posed_rest)))
    np.add.at(weights, (np.arange(len(weights))[:, None], asset.joints), asset.weights)
    return skin(asset.vertices.astype(np.float64), weights, T_posed_rest.astype(np.float64))


def check_blender(verdict: Verdict, asset: Asset, T_posed_rest: np.ndarray) -> None:
    """Names, hierarchy, weights, picture and bent shape are what was exported, and something was drawn."""
    names = asset.skeleton.joint_names
    assert verdict.found["bones"] == parent_names(asset)
    assert set(verdict.found["vertex_groups"]) == set(names)
    weighted = {names[j] for j in np.unique(asset.joints[asset.weights > 0])}
    assert set(verdict.found["groups_with_vertices"]) == weighted
    assert verdict.found["triangles"] == len(asset.faces)
    sizes = [list(pixels.shape[:2]) for pixels in pictures(asset).values()]  # all are square
    assert [image["size"] for image in verdict.found["images"]] == sizes
    kept = np.unique(asset.faces)  # Blender drops those that only coarser levels name
    np.testing.assert_allclose(verdict.rest, asset.vertices[kept], atol=AGREE)
    for posed, transforms in zip(verdict.posed, T_posed_rest, strict=True):
        np.testing.assert_allclose(posed, our_vertices(asset, transforms)[kept], atol=AGREE)
    assert np.abs(verdict.posed[0] - verdict.rest).max() > 0.05  # the pose did move it
    covered = (np.abs(verdict.picture - verdict.picture[0, 0]).max(axis=-1) > 12).mean()
    assert 0.02 < covered < 0.6  # something stands before the grey, and it does not fill the view
    assert verdict.picture.std(axis=(0, 1)).min() > 5
