"""Twist bones: nothing moves without a roll, wrists keep their volume, clips and VRM roll them by half."""

# USD's modules fill themselves when they load, so their names are unknown before.
# pyright: reportAttributeAccessIssue=false

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pygltflib
import pytest
from scipy.spatial.transform import Rotation

from assets.asset.animate import animate, animation_of
from assets.asset.asset import Asset
from assets.asset.bones import aim_bones
from assets.asset.drop import rims
from assets.asset.names import NAME_PRESETS, VRM_HUMAN_BONES, rename_joints
from assets.asset.root_bone import with_root
from assets.asset.twist import LIMBS, add_twists, axis_of, half_rolls
from avatargen.motion.motion import Motion
from exporters import export, vrm
from tests.figure import figure
from tests.test_bones import body_asset
from tests.usdskel import usdskel_vertices
from tests.verdicts import AGREE, ask_engine, blender_verdict, our_vertices, random_poses

AROUND = 0.05  # m of the limb on either side of a joint


@cache
def person(twist: bool, rest: str = "t") -> Asset:
    asset = aim_bones(body_asset(rest=rest))
    return add_twists(asset) if twist else asset


def motion(asset: Asset, turns: dict[str, np.ndarray]) -> Motion:
    """Rotation vectors [T 3] of joints, against their parents from the T-pose."""
    frames = len(next(iter(turns.values())))
    return Motion(
        name="turn",
        joint_names=tuple(turns),
        times=np.arange(frames) / 30,
        rotations=np.stack([Rotation.from_rotvec(turn).as_quat() for turn in turns.values()], axis=1),
        translation=np.zeros((frames, 3)),
    )


def posed(asset: Asset, turns: dict[str, np.ndarray], frame: int = -1) -> np.ndarray:
    clip = animation_of(asset.skeleton, motion(asset, turns))
    return our_vertices(asset, clip.T_posed_rest(asset.skeleton)[frame])


def limb_of(bone: str) -> Any:
    return next(limb for limb in LIMBS if limb.bone == bone)


def roll(asset: Asset, bone: str, degrees: float) -> np.ndarray:
    """Rotation vectors of a roll about a limb, frame by frame."""
    return np.linspace(0, np.radians(degrees), 10)[:, None] * axis_of(asset.skeleton, limb_of(bone))


def slab_volume(asset: Asset, places: np.ndarray, bone: str, joint: str) -> float:
    """Cubic metres of the arm within AROUND of a joint along the limb, capped, as a pose leaves it."""
    names, skeleton = asset.skeleton.joint_names, asset.skeleton
    limb = limb_of(bone)
    near, far = (skeleton.joints[names.index(each)] for each in (limb.bone, limb.end))
    way = (far - near) / np.linalg.norm(far - near)
    middle = skeleton.joints[names.index(joint)]
    along = (asset.vertices - middle) @ way
    arm = np.linalg.norm(asset.vertices - middle - along[:, None] * way, axis=1) < 0.12
    arm &= np.sign(asset.vertices[:, 0]) == np.sign(middle[0])
    kept = (np.abs(along) < AROUND) & arm
    faces = asset.faces[kept[asset.faces].all(axis=1)]
    volume = np.linalg.det(places[faces]).sum() / 6
    for loop in rims(faces, faces):
        centre = places[loop].mean(axis=0)
        fan = np.stack([places[np.roll(loop, -1)], places[loop], np.tile(centre, (len(loop), 1))], axis=1)
        volume += np.linalg.det(fan).sum() / 6
    return float(volume)


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_wrist_turned_by_90_degrees_loses_less_than_half_as_much(side: str) -> None:
    """The slab of forearm and hand around the wrist."""
    kept = {}
    for twist in (False, True):
        asset = person(twist, "t")
        turns = {f"{side}_wrist": roll(asset, f"{side}_elbow", 90)}
        rest = slab_volume(asset, asset.vertices.astype(np.float64), f"{side}_elbow", f"{side}_wrist")
        kept[twist] = slab_volume(asset, posed(asset, turns), f"{side}_elbow", f"{side}_wrist") / rest
    assert 1 - kept[False] > 0.1, kept  # the candy wrapper is there
    assert 1 - kept[True] < 0.5 * (1 - kept[False]), kept


def test_no_slab_of_the_arm_is_thinner_than_the_wrist_was() -> None:
    """The roll that leaves the wrist does not wring the forearm: no vertex comes as near to its axis."""
    worst = {}
    for twist in (False, True):
        asset = person(twist, "t")
        turns = {"left_wrist": roll(asset, "left_elbow", 90)}
        near, far = (
            asset.skeleton.joints[asset.skeleton.joint_names.index(f"left_{j}")] for j in ("elbow", "wrist")
        )
        way = (far - near) / np.linalg.norm(far - near)
        moved = asset.vertices.astype(np.float64) - near
        along = moved @ way
        radius = np.linalg.norm(moved - along[:, None] * way, axis=1)
        on_arm = (radius < 0.08) & (along > 0.02) & (along < np.linalg.norm(far - near) + 0.01)
        there = posed(asset, turns) - near
        after = np.linalg.norm(there - (there @ way)[:, None] * way, axis=1)
        worst[twist] = np.min(after[on_arm] / radius[on_arm])
    assert worst[True] > worst[False] + 0.1, worst


def test_a_shoulder_rolled_by_90_degrees_keeps_more() -> None:
    kept = {}
    for twist in (False, True):
        asset = person(twist, "t")
        turns = {"left_shoulder": roll(asset, "left_shoulder", 90)}
        before = slab_volume(asset, asset.vertices.astype(np.float64), "left_shoulder", "left_shoulder")
        kept[twist] = slab_volume(asset, posed(asset, turns), "left_shoulder", "left_shoulder") / before
    assert 1 - kept[True] < 0.6 * (1 - kept[False]), kept


@pytest.mark.parametrize("rest", ["a", "t"])
def test_poses_without_roll_look_as_before(rest: str) -> None:
    plain, twisted = person(False, rest), person(True, rest)
    assert np.array_equal(plain.vertices, twisted.vertices)
    swing = np.cross(axis_of(plain.skeleton, limb_of("left_elbow")), [0.0, 0.0, 1.0])
    turns = {"left_wrist": np.outer(np.linspace(0, 1, 4), swing), "right_knee": np.full((4, 3), 0.3)}
    for each in (turns, {"pelvis": np.zeros((1, 3))}):  # shares under a thousandth are dropped
        assert np.abs(posed(plain, each) - posed(twisted, each)).max() < 2e-4


def test_rolls_are_halved_without_a_jump_at_180_degrees() -> None:
    axis = np.array([0.6, 0.0, 0.8])
    angles = np.radians(np.linspace(-30, 400, 87))
    swings = Rotation.from_rotvec(np.outer(np.linspace(0, 1, 87), [0.8, 0.0, -0.6]))
    rolls = Rotation.from_rotvec(angles[:, None] * axis)
    for forward in (True, False):
        halves = half_rolls((swings * rolls).as_matrix(), axis, forward)
        wanted = Rotation.from_rotvec((angles / 2 if forward else -angles / 2)[:, None] * axis).as_matrix()
        assert np.abs(halves - wanted).max() < 1e-9
    overhead = Rotation.from_rotvec(np.pi * np.array([[0.8, 0.0, -0.6]])).as_matrix()
    assert (
        np.abs(half_rolls(overhead, axis, True) - np.eye(3)).max() < 2e-4
    )  # shares under a thousandth are dropped


def test_a_rest_pose_with_a_roll_is_still_a_rest_pose() -> None:
    """Played as a motion, the pose in which an asset rests leaves every vertex where it is."""
    asset = body_asset(rest="t")
    names = asset.skeleton.joint_names
    turn = Rotation.from_rotvec(np.radians(70) * axis_of(asset.skeleton, limb_of("left_elbow"))).as_matrix()
    turned = np.tile(np.eye(3), (len(names), 1, 1))
    below = [names.index("left_wrist")]
    for joint, parent in enumerate(asset.skeleton.parents):
        if parent in below:
            below.append(joint)
    turned[below] = turn
    rolled = add_twists(replace(asset, skeleton=replace(asset.skeleton, rest_rotations=turned)))
    turns = {"left_wrist": Rotation.from_matrix(turn).as_rotvec()[None]}
    assert np.abs(posed(rolled, turns) - rolled.vertices).max() < 1e-6


@pytest.mark.parametrize("preset", NAME_PRESETS)
def test_every_preset_names_them(preset: str) -> None:
    names = rename_joints(person(True), preset).skeleton.joint_names[-4:]
    wanted = {
        "smpl": ("left_shoulder_twist", "left_elbow_twist"),
        "unreal": ("upperarm_twist_01_l", "lowerarm_twist_01_l"),
        "unity": ("LeftUpperArmTwist", "LeftLowerArmTwist"),
        "mixamo": ("mixamorig:LeftArmTwist", "mixamorig:LeftForeArmTwist"),
        "rpm": ("LeftArmTwist", "LeftForeArmTwist"),
    }
    assert names[:2] == wanted[preset]
    assert not any(bone.endswith("Twist") for bone in VRM_HUMAN_BONES.values())


def test_clips_turn_them_together_with_a_root_bone() -> None:
    asset = person(True)
    moved = animate(asset, [motion(asset, {"left_wrist": roll(asset, "left_elbow", 90)})])
    (clip,), skeleton = moved.animations, moved.skeleton
    twist, elbow = (skeleton.joint_names.index(name) for name in ("left_elbow_twist", "left_elbow"))
    world = clip.T_posed_rest(skeleton)[-1, :, :3, :3]
    angle = Rotation.from_matrix(world[elbow].T @ world[twist]).magnitude()
    assert np.degrees(angle) == pytest.approx(45, abs=1e-6)
    rooted = with_root(moved)
    after = rooted.animations[0].T_posed_rest(rooted.skeleton)[:, 1:]
    assert np.abs(after - clip.T_posed_rest(skeleton)).max() < 1e-9


def capsule() -> Asset:
    return add_twists(aim_bones(figure()))


def test_blender_and_usd_bend_them_as_we_do(tmp_path: Path) -> None:
    asset = capsule()
    poses = random_poses(asset, count=2, angle=0.5)
    verdict = blender_verdict(asset, poses, tmp_path)
    export(asset, tmp_path / "person.usdc")
    usd = usdskel_vertices(tmp_path / "person.usdc", poses)
    for blender, skel, transforms in zip(verdict.posed, usd, poses, strict=True):
        ours = our_vertices(asset, transforms)
        assert np.abs(blender - ours).max() < AGREE and np.abs(skel - ours).max() < AGREE


def test_vrm_rolls_the_forearms(tmp_path: Path) -> None:
    """three-vrm turns the twist bones by half of a hand's roll by itself, and says nothing of other bones."""
    asset = capsule()
    names = asset.skeleton.joint_names
    document: Any = pygltflib.GLTF2.load_from_bytes(vrm.encode(asset))
    assert document.extensionsUsed == ["VRMC_vrm", "VRMC_node_constraint"]
    found = {node.name for node in document.nodes if "VRMC_node_constraint" in (node.extensions or {})}
    assert found == {"left_elbow_twist", "right_elbow_twist"}
    turns = {"left_wrist": roll(asset, "left_elbow", 80), "right_wrist": roll(asset, "right_elbow", -50)}
    clip = animation_of(asset.skeleton, motion(asset, turns))
    transforms = clip.T_posed_rest(asset.skeleton)[[-1, 4]]
    export(asset, tmp_path / "person.vrm")
    judged = ask_engine("three_check.mjs", "@pixiv/three-vrm", tmp_path / "person.vrm", asset, transforms)
    assert judged["vrm"]["bones"]["leftLowerArm"] == "left_elbow" and "left_elbow_twist" in names
    for posed_there, ours in zip(judged["vrm"]["posed"], transforms, strict=True):
        theirs = np.reshape(posed_there, (-1, 3))
        np.testing.assert_allclose(theirs, our_vertices(asset, ours), atol=AGREE)
        assert np.abs(theirs - asset.vertices).max() > 0.02
