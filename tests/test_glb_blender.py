"""Blender imports our files whole and bends them as our own linear blend skinning does."""

import json
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scipy.spatial.transform import Rotation
from tube import tube

from assets.asset import Asset
from avatargen.body.model import forward_kinematics
from avatargen.body.skinning import skin
from exporters import export

AGREE = 1e-4  # metres between Blender's vertices and ours


@dataclass(frozen=True)
class Verdict:
    """What Blender found, its vertices at rest and in each pose, and its picture of the first pose."""

    found: dict
    rest: np.ndarray
    posed: np.ndarray
    picture: np.ndarray


def judge(blender: list[str], asset: Asset, T_posed_rest: np.ndarray, folder: Path) -> Verdict:
    export(asset, folder / "asset.glb")
    np.savez(folder / "poses.npz", names=np.array(asset.skeleton.joint_names), T_posed_rest=T_posed_rest)
    command = [*blender, str(folder / "asset.glb"), str(folder / "poses.npz"), str(folder)]
    run = subprocess.run(command, capture_output=True, text=True, timeout=240)
    assert (folder / "posed.png").exists(), run.stdout + run.stderr
    with np.load(folder / "deformed.npz") as arrays, Image.open(folder / "posed.png") as picture:
        return Verdict(
            found=json.loads((folder / "found.json").read_text()),
            rest=arrays["rest"],
            posed=arrays["posed"],
            picture=np.asarray(picture.convert("RGB")).astype(float),
        )


def random_poses(asset: Asset, count: int, angle: float) -> np.ndarray:
    """Posed <- rest transforms [P J 4 4] of poses that turn every joint by up to `angle` radians."""
    generator = np.random.default_rng(0)
    rest = asset.skeleton.T_world_joint
    poses = []
    for _ in range(count):
        turns = Rotation.from_rotvec(generator.uniform(-angle, angle, (len(rest), 3))).as_matrix()
        T_world_joint = forward_kinematics(rest[:, :3, 3], turns, asset.skeleton.parents)
        T_posed_rest = T_world_joint.copy()
        T_posed_rest[:, :3, 3] -= np.einsum("jab,jb->ja", T_world_joint[:, :3, :3], rest[:, :3, 3])
        poses.append(T_posed_rest)
    return np.array(poses)


def our_vertices(asset: Asset, T_posed_rest: np.ndarray) -> np.ndarray:
    weights = np.zeros((len(asset.vertices), len(T_posed_rest)))
    np.add.at(weights, (np.arange(len(weights))[:, None], asset.joints), asset.weights)
    return skin(asset.vertices.astype(np.float64), weights, T_posed_rest.astype(np.float64))


def check(verdict: Verdict, asset: Asset, T_posed_rest: np.ndarray) -> None:
    """Names, hierarchy, weights, picture and bent shape are all what was exported."""
    names, parents = asset.skeleton.joint_names, asset.skeleton.parents
    expected = {
        name: names[parent] if parent >= 0 else None for name, parent in zip(names, parents, strict=True)
    }
    assert verdict.found["bones"] == expected
    assert set(verdict.found["vertex_groups"]) == set(names)
    used = {names[j] for j in np.unique(asset.joints[asset.weights > 0])}
    assert set(verdict.found["groups_with_vertices"]) == used
    assert verdict.found["triangles"] == len(asset.faces)
    height, width = asset.texture.shape[:2]
    assert verdict.found["images"] == [{"name": "base_color", "size": [width, height], "packed": True}]
    np.testing.assert_allclose(verdict.rest, asset.vertices, atol=AGREE)
    for posed, transforms in zip(verdict.posed, T_posed_rest, strict=True):
        np.testing.assert_allclose(posed, our_vertices(asset, transforms), atol=AGREE)
    assert np.abs(verdict.posed[0] - verdict.rest).max() > 0.05  # the pose did move it


@pytest.mark.parametrize("tilt", [0.0, 0.3])
def test_tube_bends_as_ours_does(blender: list[str], tmp_path: Path, tilt: float) -> None:
    asset = tube(rings=24, joint_count=4, tilt=tilt)
    T_posed_rest = random_poses(asset, count=3, angle=0.6)
    verdict = judge(blender, asset, T_posed_rest, tmp_path)

    check(verdict, asset, T_posed_rest)
    background = verdict.picture[0, 0]
    covered = (np.abs(verdict.picture - background).max(axis=-1) > 12).mean()
    assert 0.02 < covered < 0.6  # something stands before the grey, and it does not fill the view
    assert verdict.picture.std(axis=(0, 1)).min() > 5  # with more than one colour on it
