"""Godot and assimp read our files as they were written, and Godot bends them as we do."""

from pathlib import Path

import numpy as np
import pytest

from assets.asset.names import rename_joints
from exporters import export
from exporters.weld import weld
from tests.figure import figure, in_motion
from tests.system_judges import ask_godot, assimp_scene, name_in_godot
from tests.tube import tube
from tests.verdicts import AGREE, our_vertices, parent_names, random_poses


@pytest.mark.parametrize("person", [False, True], ids=["tube", "person"])
def test_godot_bends_as_ours_does(tmp_path: Path, person: bool) -> None:
    asset = in_motion(rename_joints(figure(), "unity")) if person else tube(rings=24, joint_count=4, tilt=0.3)
    poses = random_poses(asset, count=2, angle=0.6)
    export(asset, tmp_path / "a.glb")
    played = ask_godot(tmp_path / "a.glb", asset, poses)

    bones = {name: parent and name_in_godot(parent) for name, parent in parent_names(asset).items()}
    assert played.found["bones"] == {name_in_godot(name): parent for name, parent in bones.items()}
    assert played.found["triangles"] == len(asset.faces)
    assert played.found["images"] == [list(asset.texture.shape[:2])]
    np.testing.assert_allclose(played.rest, asset.vertices, atol=AGREE / 10)
    for posed, transforms in zip(played.posed, poses, strict=True):
        np.testing.assert_allclose(posed, our_vertices(asset, transforms), atol=AGREE / 10)
    assert np.abs(played.posed[0] - played.rest).max() > 0.05
    clips = {clip.name: float(clip.times[-1]) for clip in asset.animations}
    assert played.found["clips"] == pytest.approx(clips)
    assert played.found["morphs"] == [morph.name for morph in asset.morphs]


@pytest.mark.parametrize("name", ["a.glb", "a.gltf"])
def test_assimp_reads_the_skin(tmp_path: Path, name: str) -> None:
    asset = in_motion(figure())
    poses = random_poses(asset, count=2, angle=0.6)
    export(asset, tmp_path / name)
    scene = assimp_scene(tmp_path / name)

    assert set(scene.bones) == set(asset.skeleton.joint_names)
    parents = {name: scene.parents[name] for name in scene.bones}
    parents["pelvis"] = None  # the scene's own root is no bone
    assert parents == parent_names(asset)
    np.testing.assert_array_equal(scene.faces, asset.faces)
    assert scene.uv_count == len(asset.vertices)
    assert scene.clips == tuple(clip.name for clip in asset.animations)
    np.testing.assert_allclose(scene.vertices, asset.vertices, atol=AGREE / 10)
    for transforms in poses:
        posed = scene.posed(dict(zip(asset.skeleton.joint_names, transforms, strict=True)))
        np.testing.assert_allclose(posed, our_vertices(asset, transforms), atol=AGREE / 10)


@pytest.mark.parametrize("suffix", [".obj", ".ply", ".stl"])
def test_assimp_reads_the_shape(tmp_path: Path, suffix: str) -> None:
    asset = tube(rings=24)  # whose first byte is no line end: of a .ply's numbers assimp would lose that
    export(asset, tmp_path / f"a{suffix}")
    scene = assimp_scene(tmp_path / f"a{suffix}")
    assert len(scene.faces) == len(asset.faces)
    corners = asset.vertices[asset.faces]
    np.testing.assert_allclose(scene.vertices[scene.faces], corners, atol=AGREE / 10)
    assert scene.uv_count == (3 * len(asset.faces) if suffix == ".obj" else 0)
    if suffix == ".ply":
        assert len(scene.vertices) == len(weld(asset).vertices)
