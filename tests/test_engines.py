"""Engines bend our files as our own linear blend skinning does: Blender, three.js, Babylon.js."""

from pathlib import Path

import numpy as np
import pytest

from exporters import export
from tests.figure import figure, in_motion
from tests.tube import tube
from tests.verdicts import (
    AGREE,
    ask_engine,
    blender_verdict,
    check_blender,
    our_vertices,
    parent_names,
    random_poses,
)

ENGINES = [("three_check.mjs", "three"), ("babylon_check.cjs", "babylonjs")]


@pytest.mark.parametrize("engine", ENGINES, ids=["three", "babylon"])
@pytest.mark.parametrize(("name", "person"), [("tube.glb", False), ("a person.gltf", True)])
def test_web_engines_bend_as_ours_does(
    tmp_path: Path, engine: tuple[str, str], name: str, person: bool
) -> None:
    asset = figure() if person else tube(rings=24, joint_count=4, tilt=0.3)
    poses = random_poses(asset, count=3, angle=0.6)
    export(asset, tmp_path / name)
    found = ask_engine(*engine, tmp_path / name, asset, poses)

    assert found["bones"] == parent_names(asset)
    np.testing.assert_allclose(np.reshape(found["rest"], (-1, 3)), asset.vertices, atol=AGREE / 10)
    for posed, transforms in zip(found["posed"], poses, strict=True):
        np.testing.assert_allclose(posed, our_vertices(asset, transforms), atol=AGREE / 10)
    assert np.abs(found["posed"][0] - asset.vertices).max() > 0.05
    if engine[1] == "three":  # the other engine draws nothing here, so it reads no picture
        assert found["images"] == ([[64, 64], [32, 32]] if person else [[64, 64]])


def test_three_plays_the_clips_and_knows_the_morphs(tmp_path: Path) -> None:
    asset = in_motion(figure())
    export(asset, tmp_path / "person.glb")
    found = ask_engine("three_check.mjs", "three", tmp_path / "person.glb", asset, np.zeros((0, 24, 4, 4)))

    assert found["morphs"] == ["taller"]
    assert set(found["clips"]) == {clip.name for clip in asset.animations}
    for clip in asset.animations:
        played = found["clips"][clip.name]
        np.testing.assert_allclose(played["times"], clip.times, atol=1e-6)
        for vertices, transforms in zip(played["vertices"], clip.T_posed_rest(asset.skeleton), strict=True):
            ours = our_vertices(asset, transforms)
            np.testing.assert_allclose(np.reshape(vertices, (-1, 3)), ours, atol=AGREE)


@pytest.mark.parametrize("suffix", [".gltf", ".vrm"])
def test_blender_bends_as_ours_does(tmp_path: Path, suffix: str) -> None:
    asset = figure()
    poses = random_poses(asset, count=1, angle=0.5)
    check_blender(blender_verdict(asset, poses, tmp_path, f"asset{suffix}"), asset, poses)
