"""Levels of detail in a GLB: shared vertices, a fallback to the finest, and what the judges make of them."""

import json
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from assets import with_levels
from assets.asset.asset import Asset
from exporters import export, glb
from exporters.glb_levels import coverages
from exporters.read_glb import read_glb
from tests.test_glb import load, read
from tests.tube import tube, welded
from tests.verdicts import (
    JUDGES,
    blender_python,
    blender_verdict,
    check_blender,
    khronos_issues,
    random_poses,
)


def levelled_tube() -> Asset:
    """A tube of 720 faces with levels of 400 and 150."""
    return with_levels(welded(tube(rings=18, sides=20, joint_count=4, tilt=0.2)), (400, 150))


def test_levels_share_everything_but_their_indices() -> None:
    asset = levelled_tube()
    data = glb.encode(asset)
    document = load(data)
    finest, *coarser = (mesh.primitives[0] for mesh in document.meshes)

    assert np.array_equal(read(document, finest.indices).reshape(-1, 3), asset.faces)
    for primitive, level in zip(coarser, asset.levels, strict=True):
        assert vars(primitive.attributes) == vars(finest.attributes)
        assert primitive.material == finest.material
        assert np.array_equal(read(document, primitive.indices).reshape(-1, 3), level)
    without = len(glb.encode(replace(asset, levels=())))
    assert len(data) - without < 2 * 3 * (400 + 150) + 1500  # indices of two bytes, and names


def test_the_extension_names_the_nodes_and_no_scene_does() -> None:
    asset = levelled_tube()
    document = load(glb.encode(asset))
    node = next(node for node in document.nodes if node.mesh == 0)
    ids = node.extensions["MSFT_lod"]["ids"]

    assert document.extensionsUsed == ["MSFT_lod"]
    assert not document.extensionsRequired
    assert [document.nodes[i].mesh for i in ids] == [1, 2]
    assert all(document.nodes[i].skin == node.skin for i in ids)
    assert not set(ids) & set(document.scenes[0].nodes)
    assert node.extras["MSFT_screencoverage"] == coverages(asset)
    assert coverages(asset) == sorted(coverages(asset), reverse=True)
    assert len(coverages(asset)) == 3 and coverages(asset)[-1] == 0


def test_khronos_has_no_error_and_no_warning(tmp_path: Path) -> None:
    export(levelled_tube(), tmp_path / "tube.glb")
    issues = khronos_issues(tmp_path / "tube.glb")

    assert (issues["numErrors"], issues["numWarnings"]) == (0, 0)
    codes = {message["code"] for message in issues["messages"]}
    assert codes == {
        "UNSUPPORTED_EXTENSION",
        "UNUSED_OBJECT",
    }  # it does not know the extension, so sees no use


def test_blender_shows_the_finest_and_keeps_the_others_aside(tmp_path: Path) -> None:
    asset = levelled_tube()
    poses = random_poses(asset, count=2, angle=0.5)
    verdict = blender_verdict(asset, poses, tmp_path)
    check_blender(verdict, asset, poses)

    script = JUDGES / "blender_levels.py"
    run = subprocess.run(
        [str(blender_python()), str(script), str(tmp_path / "asset.glb")],
        capture_output=True,
        text=True,
        timeout=240,
    )
    found = json.loads(run.stdout.splitlines()[-1])
    assert found == {
        "avatar": {"triangles": len(asset.faces), "in_scene": True, "groups": 4},
        "avatar_lod1": {"triangles": len(asset.levels[0]), "in_scene": False, "groups": 4},
        "avatar_lod2": {"triangles": len(asset.levels[1]), "in_scene": False, "groups": 4},
    }


def test_our_reader_takes_the_finest(tmp_path: Path) -> None:
    asset = levelled_tube()
    export(asset, tmp_path / "tube.glb")
    assert np.array_equal(read_glb(tmp_path / "tube.glb").faces, asset.faces)


@pytest.mark.parametrize("suffix", [".gltf", ".usda", ".obj", ".ply", ".stl"])
def test_other_formats_write_the_finest_or_all(tmp_path: Path, suffix: str) -> None:
    asset = levelled_tube()
    with_, without = tmp_path / f"with{suffix}", tmp_path / f"without{suffix}"
    more = export(asset, with_) - export(replace(asset, levels=()), without)
    assert (more > 2 * 3 * 550) == (suffix == ".gltf")
