"""A root bone on the ground: nothing moves otherwise than before, and the way over the ground is its own, in
every kind of file."""

# USD's modules fill themselves when they load, so their names are unknown before.
# pyright: reportAttributeAccessIssue=false

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pygltflib
import pytest
from pxr import Usd, UsdSkel

from assets.asset.names import NAME_PRESETS, rename_joints
from assets.asset.root_bone import ON_GROUND, with_root
from assets.errors import GeometryError
from exporters import export, glb
from exporters.check_gltf import check_gltf
from exporters.check_usd import check_usd
from exporters.check_vrm import check_vrm
from exporters.read_glb import read_glb
from tests.figure import figure, in_motion
from tests.test_glb import load, read
from tests.usdskel import played_vertices
from tests.verdicts import AGREE, ask_engine, ask_node, blender_motion, our_vertices, random_poses


def moving():
    return in_motion(figure())


def test_nothing_moves_otherwise_and_the_way_is_shared_out() -> None:
    asset = moving()
    rooted = with_root(asset)
    names, joints = rooted.skeleton.joint_names, rooted.skeleton.joints
    assert names == ("root", *asset.skeleton.joint_names)
    assert joints[0] == pytest.approx(asset.skeleton.joints[0] * ON_GROUND) and joints[0, 1] == 0
    assert np.array_equal(rooted.skeleton.T_world_joint[0, :3, :3], np.eye(3))
    assert np.array_equal(rooted.vertices, asset.vertices)
    for before, after in zip(asset.animations, rooted.animations, strict=True):
        there, wanted = after.T_world_joint(rooted.skeleton), before.T_world_joint(asset.skeleton)
        assert np.abs(there[:, 1:] - wanted).max() < 1e-12
        assert np.abs(there[:, 0, :3, 3] - before.root * ON_GROUND).max() < 1e-12
        assert after.hips is not None and np.abs(after.hips[:, [0, 2]]).max() == 0
        for ours, theirs in zip(
            before.T_posed_rest(asset.skeleton), after.T_posed_rest(rooted.skeleton), strict=True
        ):
            assert np.abs(our_vertices(asset, ours) - our_vertices(rooted, theirs)).max() < 1e-9
    assert rooted.morphs[0].joints.shape == (len(names), 3)


@pytest.mark.parametrize("preset", NAME_PRESETS)
def test_every_preset_keeps_its_name(preset: str) -> None:
    assert rename_joints(with_root(figure()), preset).skeleton.joint_names[0] == "root"


def test_a_second_root_is_refused() -> None:
    with pytest.raises(GeometryError, match="leave --root out"):
        with_root(with_root(figure()))


def test_gltf_has_an_armature_above_all_and_reads_back(tmp_path: Path) -> None:
    rooted = with_root(moving())
    document: Any = load(glb.encode(rooted))
    (top,) = document.scenes[0].nodes
    mesh_node = len(rooted.skeleton.parents)
    assert document.nodes[top].name == "Armature" and document.nodes[top].children == [0, mesh_node]
    assert document.nodes[top].translation is None and document.nodes[0].name == "root"
    assert top not in document.skins[0].joints
    for encoded, ours in zip(document.animations, rooted.animations, strict=True):
        ways = {c.target.node: c.sampler for c in encoded.channels if c.target.path == "translation"}
        assert set(ways) == {0, 1}
        for joint, sampler in ways.items():
            found = read(document, encoded.samplers[sampler].output)
            np.testing.assert_allclose(found, ours.ways[joint], atol=1e-6)
    export(rooted, tmp_path / "person.glb")
    assert check_gltf(tmp_path / "person.glb") in ([], None)
    back: Any = read_glb(tmp_path / "person.glb", rest="t")
    assert back.skeleton.joint_names == rooted.skeleton.joint_names
    assert np.array_equal(back.skeleton.parents, rooted.skeleton.parents)
    plain: Any = pygltflib.GLTF2.load_from_bytes(glb.encode(moving()))
    assert not any(node.name == "Armature" for node in plain.nodes)


def test_blender_plays_it_as_we_do(tmp_path: Path) -> None:
    rooted = with_root(moving())
    export(rooted, tmp_path / "person.glb")
    clip = rooted.animations[0]
    found = blender_motion(
        tmp_path / "person.glb",
        [clip.name] * 2,
        clip.times[[1, 3]].tolist(),
        [morph.name for morph in rooted.morphs],
        np.zeros((2, 1)),
    )
    for theirs, transforms in zip(found["vertices"], clip.T_posed_rest(rooted.skeleton)[[1, 3]], strict=True):
        assert np.abs(theirs - our_vertices(rooted, transforms)).max() < AGREE
    assert "root" in found["names"].tolist()


def test_usd_plays_it_as_we_do(tmp_path: Path) -> None:
    rooted = replace(with_root(moving()), morphs=())
    export(rooted, tmp_path / "person.usda")
    stage = Usd.Stage.Open(str(tmp_path / "person.usda"))
    skeleton = UsdSkel.Skeleton(stage.GetPrimAtPath("/avatar/skeleton"))
    assert list(skeleton.GetJointsAttr().Get())[:2] == ["root", "root/pelvis"]
    assert check_usd(tmp_path / "person.usda") == []
    clip = rooted.animations[1]
    for time, transforms in zip(clip.times, clip.T_posed_rest(rooted.skeleton), strict=True):
        found = played_vertices(stage, "/avatar/walk_it", time * 24)
        assert np.abs(found - our_vertices(rooted, transforms)).max() < AGREE


def test_vrm_holds_it_and_its_clips_keep_their_way(tmp_path: Path) -> None:
    """three-vrm poses the person by human bones, and plays the clips, whose way is the hips' there."""
    rooted = replace(with_root(moving()), morphs=())
    poses = random_poses(rooted, count=2, angle=0.5)
    export(rooted, tmp_path / "person.vrm")
    assert check_vrm(tmp_path / "person.vrm") == []
    found = ask_engine("three_check.mjs", "@pixiv/three-vrm", tmp_path / "person.vrm", rooted, poses)
    for posed, transforms in zip(found["posed"], poses, strict=True):
        np.testing.assert_allclose(posed, our_vertices(rooted, transforms), atol=AGREE)
    assert found["vrm"]["bones"]["hips"] == "pelvis" and found["bones"]["pelvis"] == "root"
    times = [clip.times.tolist() for clip in rooted.animations]
    paths = [tmp_path / name for name in ("person.vrm", "person.vrma")]
    played = ask_node("vrma_check.mjs", "@pixiv/three-vrm-animation", *paths, json.dumps(times))
    for clip, frames in zip(rooted.animations, played["vertices"], strict=True):
        for vertices, transforms in zip(frames, clip.T_posed_rest(rooted.skeleton), strict=True):
            np.testing.assert_allclose(
                np.reshape(vertices, (-1, 3)), our_vertices(rooted, transforms), atol=AGREE
            )
