"""VRM files: sound glTF, the bones and permissions VRM wants, accepted by three-vrm and VRM's types."""

import json
import shutil
import subprocess
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pygltflib
import pytest

import avatargen
from assets import BuildConfig, build
from assets.asset.animate import animate, figure_of
from assets.asset.asset import Asset, TexturedAsset
from assets.asset.joints import drop_idle_joints
from assets.asset.names import VRM_HUMAN_BONES, rename_joints
from avatargen.body.joints import SMPLH_JOINT_NAMES
from avatargen.body.model import forward_kinematics
from avatargen.errors import InputError
from avatargen.motion.clips import CLIPS, make_clip
from exporters import FORMATS, export, vrm
from tests.figure import figure, in_motion, without_weight_on
from tests.tube import tube
from tests.verdicts import (
    AGREE,
    JUDGES,
    ask_engine,
    ask_node,
    khronos_issues,
    our_vertices,
    random_poses,
    require,
)

# of VRM 1.0's specification: bones a person must have, each below the nearest of the others that is there
PARENTS = {
    "hips": None,
    "spine": "hips",
    "chest": "spine",
    "upperChest": "chest",
    "neck": "upperChest",
    "head": "neck",
}
for side in ("left", "right"):
    for bone, parent in (
        ("UpperLeg", "hips"),
        ("LowerLeg", f"{side}UpperLeg"),
        ("Foot", f"{side}LowerLeg"),
        ("Toes", f"{side}Foot"),
        ("Shoulder", "upperChest"),
        ("UpperArm", f"{side}Shoulder"),
        ("LowerArm", f"{side}UpperArm"),
        ("Hand", f"{side}LowerArm"),
    ):
        PARENTS[side + bone] = parent


def extension(data: bytes) -> tuple[Any, dict]:
    document: Any = pygltflib.GLTF2.load_from_bytes(data)
    assert document.extensionsUsed == ["VRMC_vrm"]
    return document, document.extensions["VRMC_vrm"]


def test_bones_stand_where_vrm_wants_them() -> None:
    document, found = extension(vrm.encode(figure()))
    node_of = {bone: entry["node"] for bone, entry in found["humanoid"]["humanBones"].items()}
    parent = {child: i for i, node in enumerate(document.nodes) for child in node.children or []}

    assert set(PARENTS) <= set(node_of)
    for bone, above in PARENTS.items():
        assert parent.get(node_of[bone]) == (None if above is None else node_of[above]), bone
    assert found["specVersion"] == "1.0"
    assert found["firstPerson"]["meshAnnotations"] == [{"node": len(document.nodes) - 1, "type": "auto"}]
    assert all(node.scale is None for node in document.nodes)


@pytest.mark.parametrize("preset", ["smpl", "mixamo", "unity", "unreal"])
def test_khronos_and_three_vrm_accept_it(tmp_path: Path, preset: str) -> None:
    asset = rename_joints(figure(), preset)
    poses = random_poses(asset, count=2, angle=0.5)
    export(asset, tmp_path / "person.vrm")
    issues = khronos_issues(tmp_path / "person.vrm")
    found = ask_engine("three_check.mjs", "@pixiv/three-vrm", tmp_path / "person.vrm", asset, poses)

    assert [message["code"] for message in issues["messages"]] == ["UNSUPPORTED_EXTENSION"]  # VRM itself
    assert (issues["numErrors"], issues["numWarnings"]) == (0, 0)
    assert found["vrm"]["version"] == "1"
    assert found["vrm"]["name"] == "avatar 3"
    assert set(PARENTS) <= set(found["vrm"]["bones"])
    for posed, transforms in zip(found["posed"], poses, strict=True):
        np.testing.assert_allclose(posed, our_vertices(asset, transforms), atol=AGREE / 10)


def test_three_vrm_bends_a_persons_every_human_bone(tmp_path: Path) -> None:
    """The default body's 52 joints are all human bones, fingers included, and three-vrm's own pose of them
    bends the mesh as our skinning does."""
    avatar = avatargen.load_generator().sample(3)
    asset = build(avatar, BuildConfig(pose="t", resolution=128, faces=6000, texture=64))
    poses = random_poses(asset, count=3, angle=0.5)
    export(asset, tmp_path / "person.vrm")
    found = ask_engine("three_check.mjs", "@pixiv/three-vrm", tmp_path / "person.vrm", asset, poses)["vrm"]

    assert asset.skeleton.joint_names == SMPLH_JOINT_NAMES
    assert found["bones"] == {VRM_HUMAN_BONES[name]: name for name in SMPLH_JOINT_NAMES}
    assert np.abs(asset.weights[asset.joints >= 22]).max() > 0.5  # fingers do move something
    for posed, transforms in zip(found["posed"], poses, strict=True):
        ours = our_vertices(asset, transforms)
        np.testing.assert_allclose(np.reshape(posed, (-1, 3)), ours, atol=AGREE)
        assert np.abs(ours - asset.vertices).max() > 0.05


def type_errors(
    folder: Path, found: object, kind: str = "VRMCVRM", package: str = "types-vrmc-vrm-1.0"
) -> str:
    """What TypeScript says of an extension against VRM's published types; empty if it fits."""
    node = shutil.which("node")
    for needed in ("typescript", f"@pixiv/{package}"):
        require(node is not None and (JUDGES / "node_modules" / needed).is_dir(), needed)
    (folder / "node_modules").symlink_to((JUDGES / "node_modules").resolve())
    source = f'import type {{ {kind} }} from "@pixiv/{package}";\nexport const found: {kind} = '
    (folder / "found.ts").write_text(f"{source}{json.dumps(found)};\n")
    compiler = JUDGES / "node_modules" / "typescript" / "bin" / "tsc"
    command = [str(node), str(compiler), "--noEmit", "--strict", "--skipLibCheck", "found.ts"]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=60).stdout


@pytest.mark.parametrize("licence", ["CC0-1.0", "all rights reserved"])
def test_the_extension_fits_vrms_published_types(tmp_path: Path, licence: str) -> None:
    asset = figure()
    asset = replace(asset, info=replace(asset.info, licence=licence))
    _, found = extension(vrm.encode(asset))
    assert type_errors(tmp_path, found) == ""
    assert found["meta"]["licenseUrl"] == "https://vrm.dev/licenses/1.0/"
    assert found["meta"]["authors"] and found["meta"]["copyrightInformation"] == licence
    # nothing is permitted in the name of someone who did not say so
    assert found["meta"].get("avatarPermission") == ("everyone" if licence == "CC0-1.0" else None)


@pytest.mark.parametrize(
    ("part", "entry", "value"),
    [
        ("meta", "commercialUsage", "anything"),
        ("meta", "authors", None),
        ("humanoid", "humanBones", {"leftThumb": {"node": 0}}),
    ],
)
def test_the_judge_of_types_is_awake(tmp_path: Path, part: str, entry: str, value: object) -> None:
    _, found = extension(vrm.encode(figure()))
    found[part][entry] = value
    assert "error TS" in type_errors(tmp_path, found)


def turned(asset: Asset, degrees: float) -> Asset:
    """As if the left arm had been turned to get to the rest pose."""
    angles = np.tile(np.eye(3), (24, 1, 1))
    arm = asset.skeleton.joint_names.index("left_shoulder")
    angles[arm][:2, :2] = [
        [np.cos(np.radians(degrees)), -np.sin(np.radians(degrees))],
        [np.sin(np.radians(degrees)), np.cos(np.radians(degrees))],
    ]
    joints, parents = asset.skeleton.joints.copy(), asset.skeleton.parents
    rotations = forward_kinematics(joints, angles, parents)[:, :3, :3]
    return replace(asset, skeleton=replace(asset.skeleton, rest_rotations=rotations))


def test_what_vrm_cannot_hold_is_refused(tmp_path: Path) -> None:
    asset = figure()
    unrigged = TexturedAsset(**{part.name: getattr(asset, part.name) for part in fields(TexturedAsset)})
    lifted = replace(asset, vertices=asset.vertices + np.float32(0.5))
    for bad, reason in (
        (unrigged, "no skeleton"),
        (tube(joint_count=3), "no joint is known as head, leftUpperArm"),
        (turned(asset, -50), "rests 50 degrees off the T-pose, which VRM wants; build with pose='t'"),
        (lifted, r"the soles are at y = 0.50 m, wanted 0"),
    ):
        with pytest.raises(InputError, match=reason):
            export(bad, tmp_path / "person.vrm")
    assert list(tmp_path.iterdir()) == []
    assert vrm.encode(turned(asset, 3)) == vrm.encode(asset)
    assert FORMATS[".vrm"].rest_pose == "t"


def test_a_skeleton_of_moving_joints_is_still_a_persons() -> None:
    """Whatever moves no vertex, VRM finds its bones and the built-in clips their joints."""
    asset = figure()
    idle = without_weight_on(asset, *range(1, len(asset.skeleton.parents)))
    lean = drop_idle_joints(idle)
    _, found = extension(vrm.encode(lean))
    assert set(vrm.REQUIRED_BONES) <= set(found["humanoid"]["humanBones"])
    assert set(lean.skeleton.joint_names) < set(idle.skeleton.joint_names)
    person = figure_of(lean)
    clips = [make_clip(clip, person) for clip in CLIPS]
    for clip, animation in zip(clips, animate(lean, clips).animations, strict=True):
        assert animation.name == clip.name


def test_clips_stand_beside_as_vrm_animation(tmp_path: Path) -> None:
    """Sound glTF, the extension of VRM's published types, and three-vrm-animation plays it on the .vrm as our
    skinning does, at every frame of every clip."""
    asset = in_motion(figure())
    export(asset, tmp_path / "person.vrm")
    assert sorted(file.name for file in tmp_path.iterdir()) == ["person.vrm", "person.vrma"]
    messages = khronos_issues(tmp_path / "person.vrma")["messages"]
    assert {message["code"] for message in messages} <= {
        "UNSUPPORTED_EXTENSION",
        "NODE_EMPTY",
    }  # the last joints
    document: Any = pygltflib.GLTF2.load_from_bytes((tmp_path / "person.vrma").read_bytes())
    assert document.extensionsUsed == ["VRMC_vrm_animation"] and not document.meshes
    found = document.extensions["VRMC_vrm_animation"]
    assert type_errors(tmp_path, found, "VRMCVRMAnimation", "types-vrmc-vrm-animation-1.0") == ""
    times = [asset.animations[0].times.tolist(), asset.animations[1].times.tolist()]
    paths = [tmp_path / name for name in ("person.vrm", "person.vrma")]
    played = ask_node("vrma_check.mjs", "@pixiv/three-vrm-animation", *paths, json.dumps(times))
    for clip, frames in zip(asset.animations, played["vertices"], strict=True):
        for vertices, transforms in zip(frames, clip.T_posed_rest(asset.skeleton), strict=True):
            ours = our_vertices(asset, transforms)
            np.testing.assert_allclose(np.reshape(vertices, (-1, 3)), ours, atol=AGREE)
            assert np.abs(ours - asset.vertices).max() > 0.05


def test_clips_stay_behind_and_morphs_come_along() -> None:
    document, _ = extension(vrm.encode(in_motion(figure())))
    assert not document.animations
