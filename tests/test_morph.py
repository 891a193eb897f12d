"""Sliders: any sum of them is the mesh that those betas build; what they cannot do is as large as we say."""

import functools
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from assets.asset.animate import animate, figure_of
from assets.asset.asset import Asset
from assets.errors import GeometryError
from avatargen.motion.clips import make_clip
from exporters import export
from tests.verdicts import blender_motion, our_vertices
from tests.walker import walker

OWN = (1.0, -0.5, 0.25)
OTHER = np.array([0.4, 1.1, -0.8, 0.5, -0.3, 0.9, -1.2, 0.1, 0.7, -0.6])


@functools.cache
def slid(pose: str) -> tuple[Asset, Asset, np.ndarray]:
    """A person, the same built with other betas, and the weights that lead from one to the other."""
    weights = OTHER - np.pad(OWN, (0, 7))
    return walker(OWN, pose=pose), walker(tuple(OTHER.tolist()), pose=pose), weights


def added(asset: Asset, weights: np.ndarray) -> np.ndarray:
    steps = [weight * morph.vertices for weight, morph in zip(weights, asset.morphs, strict=True)]
    return asset.vertices.astype(np.float64) + np.sum(steps, axis=0)


@pytest.mark.parametrize("pose", ["a", "t", "x"])
def test_a_sum_of_sliders_is_the_mesh_built_with_those_betas(pose: str) -> None:
    """But for the height: the pelvis keeps its place, the rebuilt person stands on the ground."""
    asset, other, weights = slid(pose)
    found = added(asset, weights)
    moved = asset.skeleton.joints + np.einsum("s,sjd->jd", weights, [m.joints for m in asset.morphs])
    lift = other.skeleton.joints[0] - moved[0]
    assert np.abs(lift[[0, 2]]).max() < 1e-6
    np.testing.assert_allclose(moved + lift, other.skeleton.joints, atol=1e-6)
    np.testing.assert_allclose(found + lift, other.vertices, atol=2e-6)
    assert [morph.name for morph in asset.morphs] == [f"beta_{i}" for i in range(10)]


def test_blenders_slider_is_the_mesh_built_with_those_betas(tmp_path: Path) -> None:
    """At rest within 0.01 mm. Posed it bends about the old joints: off by no more than the joints are."""
    asset, other, weights = slid("t")
    still = make_clip("walk", figure_of(asset))
    still = replace(still, rotations=still.rotations * 0 + [0.0, 0, 0, 1], translation=still.translation * 0)
    walk = make_clip("walk", figure_of(asset))
    moving = animate(asset, [replace(still, name="still"), walk], on_ground=False)
    export(moving, tmp_path / "asset.glb")
    found = blender_motion(
        tmp_path / "asset.glb",
        ["still", "walk"],
        [0.0, float(walk.times[5])],
        [morph.name for morph in asset.morphs],
        np.stack([weights, weights]),
    )["vertices"]
    moved = asset.skeleton.joints + np.einsum("s,sjd->jd", weights, [m.joints for m in asset.morphs])
    lift = other.skeleton.joints[0] - moved[0]
    np.testing.assert_allclose(found[0] + lift, other.vertices, atol=1e-5)

    rebuilt = animate(other, [walk], on_ground=False).animations[0]
    wanted = our_vertices(other, rebuilt.T_posed_rest(other.skeleton)[5])
    off = np.linalg.norm(found[1] + lift - wanted, axis=1)
    joints_off = np.linalg.norm(moved - moved[0] - asset.skeleton.joints + asset.skeleton.joints[0], axis=1)
    assert 1e-4 < off.max() < 2 * joints_off.max()


def test_morphs_check_themselves() -> None:
    asset, _, _ = slid("t")
    with pytest.raises(GeometryError, match="morph beta_0"):
        replace(asset.morphs[0], joints=np.full((24, 3), np.nan))
    short = replace(asset.morphs[0], vertices=asset.morphs[0].vertices[:-1])
    with pytest.raises(GeometryError, match="is not of its"):
        replace(asset, morphs=(short,))
    with pytest.raises(GeometryError, match="share a name"):
        replace(asset, morphs=(asset.morphs[0], asset.morphs[0]))
