"""Bones along limbs: frames turned and ends added move nothing, and Blender draws bones where limbs are."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from assets.asset.animate import animate, figure_of
from assets.asset.asset import Asset
from assets.asset.bones import add_ends, aim_bones, bone_tails
from assets.asset.names import rename_joints
from assets.asset.rig import Skeleton
from avatargen.avatar import shipped
from avatargen.body.fingers import without_fingers
from avatargen.body.load import load_body
from avatargen.body.model import pose, shape
from avatargen.body.pose import named_pose
from avatargen.motion.clips import make_clip
from tests.tube import tube
from tests.verdicts import AGREE, blender_verdict, our_vertices, random_poses


@cache
def body_asset(fingers: bool = True, rest: str = "a") -> Asset:
    """The default body itself as an asset: every joint and all of its skin."""
    body = load_body(shipped("body.npz"))
    body = body if fingers else without_fingers(body)
    posed = pose(body, shape(body, np.zeros(10)), named_pose(rest, body.joint_names))
    joints = np.argsort(-body.weights, axis=1, kind="stable")[:, :4]
    weights = np.take_along_axis(body.weights, joints, axis=1)
    T_world_joint = np.tile(np.eye(4), (body.joint_count, 1, 1))
    T_world_joint[:, :3, 3] = posed.joints
    plain, W = tube(), len(body.v_template)
    return replace(
        plain,
        vertices=posed.vertices.astype(np.float32),
        normals=np.tile(np.array([0, 1, 0], dtype=np.float32), (W, 1)),
        uv=np.zeros((W, 2), dtype=np.float32),
        faces=body.faces,
        joints=np.where(weights > 0, joints, 0),
        weights=weights / weights.sum(axis=1, keepdims=True),
        skeleton=Skeleton(
            joint_names=body.joint_names,
            parents=body.parents,
            T_world_joint=T_world_joint,
            rest_rotations=posed.T_world_joint[:, :3, :3],
        ),
        welded=np.arange(W),
    )


@pytest.mark.parametrize("fingers", [True, False])
def test_every_frame_is_a_rotation_whose_y_axis_lies_along_the_bone(fingers: bool) -> None:
    asset = body_asset(fingers)
    aimed = aim_bones(asset)
    frames = aimed.skeleton.T_world_joint
    assert np.abs(frames[:, :3, :3] @ frames[:, :3, :3].transpose(0, 2, 1) - np.eye(3)).max() < 1e-12
    assert np.linalg.det(frames[:, :3, :3]) == pytest.approx(1)
    assert np.array_equal(aimed.skeleton.joints, asset.skeleton.joints)
    names = asset.skeleton.joint_names
    onward = {
        "pelvis": "spine1",
        "spine3": "neck",
        "left_knee": "left_ankle",
        "right_collar": "right_shoulder",
    }
    onward["left_wrist"] = "left_middle1" if fingers else "left_hand"
    tails = bone_tails(asset)
    for joint, child in onward.items():
        way = asset.skeleton.joints[names.index(child)] - asset.skeleton.joints[names.index(joint)]
        assert np.array_equal(tails[names.index(joint)], asset.skeleton.joints[names.index(child)])
        assert frames[names.index(joint), :3, 1] == pytest.approx(way / np.linalg.norm(way))


def test_the_last_bones_end_where_the_flesh_does() -> None:
    asset = body_asset()
    names, tails = asset.skeleton.joint_names, bone_tails(asset)
    crown = asset.vertices[:, 1].max()
    assert tails[names.index("head")][1] == pytest.approx(crown, abs=0.02)
    for joint, longest in (("left_foot", 0.1), ("right_index3", 0.04), ("left_thumb3", 0.05)):
        bone = tails[names.index(joint)] - asset.skeleton.joints[names.index(joint)]
        assert 0.015 < np.linalg.norm(bone) < longest
        nearest = np.linalg.norm(asset.vertices - tails[names.index(joint)], axis=1).min()
        assert nearest < 0.013  # a tip is round


@pytest.mark.parametrize("fingers", [True, False])
@pytest.mark.parametrize("rest", ["a", "t"])
def test_toes_lie_level_and_ahead(fingers: bool, rest: str) -> None:
    """So they stay above the floor though Blender draws a last bone as long as the one before it."""
    asset = aim_bones(body_asset(fingers, rest))
    names, joints = asset.skeleton.joint_names, asset.skeleton.joints
    for side in ("left", "right"):
        ankle, foot = names.index(f"{side}_ankle"), names.index(f"{side}_foot")
        along, before = asset.skeleton.T_world_joint[foot, :3, 1], joints[foot] - joints[ankle]
        tail = joints[foot] + along * np.linalg.norm(before)
        assert tail[1] > asset.vertices[:, 1].min()
        assert along @ (before * [1, 0, 1]) == pytest.approx(np.linalg.norm(before * [1, 0, 1]))


def test_arms_roll_as_mixamos_do() -> None:
    """In the T-pose +y lies along each bone; of a rig of Mixamo's, x points back on the left arm and forward
    on the right one, and legs and trunk are as by default."""
    asset = body_asset(rest="t")
    found, usual = aim_bones(asset, "mixamo").skeleton, aim_bones(asset).skeleton
    for joint, name in enumerate(found.joint_names):
        frame = found.T_world_joint[joint, :3, :3]
        assert frame @ frame.T == pytest.approx(np.eye(3), abs=1e-9) and np.linalg.det(frame) > 0
        np.testing.assert_allclose(frame[:, 1], usual.T_world_joint[joint, :3, 1], atol=1e-9)
        if name.endswith(("shoulder", "elbow", "wrist", "index1", "middle1")):
            side = 1.0 if name.startswith("left") else -1.0
            wanted = np.array([[0, side, 0], [0, 0, -1], [-side, 0, 0]])
            assert np.trace(wanted.T @ frame) > 1 + 2 * np.cos(np.radians(25)), name  # turned by less
        elif name in ("pelvis", "neck", "left_hip", "right_knee", "left_ankle", "right_foot", "head"):
            np.testing.assert_allclose(frame, usual.T_world_joint[joint, :3, :3], atol=1e-9)


def test_animations_move_the_skin_as_before() -> None:
    asset = body_asset()
    moved = animate(asset, [make_clip("range", figure_of(asset), fps=5.0)])
    before = moved.animations[0].T_posed_rest(moved.skeleton)
    after = aim_bones(add_ends(moved))  # turned with the animation
    first = animate(aim_bones(asset), [make_clip("range", figure_of(asset), fps=5.0)])  # animated when turned
    for each in (after, first):
        found = each.animations[0].T_posed_rest(each.skeleton)[:, : before.shape[1]]
        assert np.abs(found - before).max() < 1e-9


def test_ends_hang_on_every_last_bone_and_move_nothing() -> None:
    asset = body_asset()
    ended = add_ends(asset)
    names = ended.skeleton.joint_names
    fingers = [
        f"{side}_{f}3_end"
        for side in ("left", "right")
        for f in ("index", "middle", "pinky", "ring", "thumb")
    ]
    assert set(names[52:]) == {"head_end", "left_foot_end", "right_foot_end", *fingers}
    assert ended.joints.max() < 52 and np.array_equal(ended.vertices, asset.vertices)
    assert [names[parent] + "_end" for parent in ended.skeleton.parents[52:]] == list(names[52:])
    mixamo = rename_joints(ended, "mixamo").skeleton.joint_names
    assert {"mixamorig:HeadTop_End", "mixamorig:LeftToe_End", "mixamorig:RightHandThumb4"} <= set(mixamo)


def test_a_bone_without_flesh_or_length_still_has_a_direction() -> None:
    asset = tube(joint_count=3)
    there = np.tile(np.eye(4), (3, 1, 1))
    asset = replace(asset, skeleton=replace(asset.skeleton, T_world_joint=there))
    assert np.isfinite(aim_bones(add_ends(asset)).skeleton.T_world_joint).all()


@pytest.mark.parametrize("fingers", [True, False])
def test_blender_draws_bones_along_the_limbs(tmp_path: Path, fingers: bool) -> None:
    """With its usual settings a tail lies at the child's head, or on the way there if another is nearer."""
    asset = aim_bones(add_ends(body_asset(fingers)))
    poses = random_poses(asset, count=2, angle=0.3)
    verdict = blender_verdict(asset, poses, tmp_path)
    for found, transforms in zip(verdict.posed, poses, strict=True):
        assert np.abs(found - our_vertices(asset, transforms)).max() < AGREE
    heads = {name: np.array(place) for name, place in verdict.found["heads"].items()}
    tails = {name: np.array(place) for name, place in verdict.found["tails"].items()}
    skeleton, wanted = asset.skeleton, bone_tails(asset)
    to_blender = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    at_child = 0
    for joint, name in enumerate(skeleton.joint_names):
        whole, found = to_blender @ wanted[joint] - heads[name], tails[name] - heads[name]
        long = np.linalg.norm(found)
        assert found / long == pytest.approx(whole / np.linalg.norm(whole), abs=1e-4), name
        if not name.endswith("_end"):
            assert 0.004 < long <= np.linalg.norm(whole) + 1e-5, name
            at_child += long > np.linalg.norm(whole) - 1e-5
    assert at_child >= len(skeleton.joint_names) - (16 if fingers else 8)
