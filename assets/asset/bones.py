"""Bones from joints: which way each points and where it ends, for programs that draw and edit bones.

A file's joint is a frame, not a bone: Blender draws a bone along the frame's +y and as long as the way to the
nearest child. So frames are turned until +y lies along the bone, and end joints, which move nothing, are put
where the flesh of the last bones ends. What is left is the roll about a bone. It matters to who copies turns
from one rig's joints to another's as they are: Mixamo's animations, and pages for talking heads. Letters: J
joints, E ends, T frames, W vertices.
"""

from dataclasses import replace
from typing import Literal

import numpy as np
from jaxtyping import Float64
from scipy.spatial.transform import Rotation

from assets.asset.asset import Asset
from assets.asset.rig import Animation, Skeleton
from avatargen.body.joints import FINGERS
from avatargen.motion.motion import continuous

Bones = Literal["along", "mixamo", "world"]
SHORTEST = 1e-3  # metres of a bone that has a direction
FORWARD, UP = np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0])
ARMS = (
    "collar",
    "shoulder",
    "elbow",
    "wrist",
    "hand",
    *FINGERS,
)  # how their joints' names go on behind the side
ALONG_FORWARD = 0.85  # cosine: a bone that points forward more than this has its z axis up instead
HELD = 0.5  # weight from which a vertex is a bone's own
STANDING = 0.02  # metres above the lowest point within which flesh stands on the ground


def bone_tails(asset: Asset) -> Float64[np.ndarray, "J 3"]:
    """Where each joint's bone ends, metres: at the child that goes on straightest, or where its flesh ends.

    The root's bone goes to the child nearest to the middle of its children.
    """
    skeleton = asset.skeleton
    heads, tails = skeleton.joints, skeleton.joints.copy()
    for joint, parent in enumerate(skeleton.parents):
        children = np.flatnonzero(skeleton.parents == joint)
        ways = heads[children] - heads[joint]
        onward = heads[joint] - heads[parent] if parent >= 0 else ways.sum(axis=0)
        lengths = np.linalg.norm(ways, axis=1)
        if (lengths > SHORTEST).any():
            straight = np.where(lengths > SHORTEST, ways @ onward / np.maximum(lengths, SHORTEST), -np.inf)
            tails[joint] = heads[children[straight.argmax()]]
        else:
            tails[joint] = flesh_end(asset, joint, onward)
    return tails


def flesh_end(asset: Asset, joint: int, onward: Float64[np.ndarray, "3"]) -> Float64[np.ndarray, "3"]:
    """The point on the line through a last joint and the middle of its flesh's box where that flesh ends; as
    far on as the parent's bone is long where it holds none.

    What stands on the ground goes on level: programs that draw a last bone as long as the one before it would
    have toes end below the floor.
    """
    head = asset.skeleton.joints[joint]
    own = np.where(asset.joints == joint, asset.weights, 0).sum(axis=1) > HELD
    ways = asset.vertices[own].astype(np.float64) - head
    middle = (ways.min(axis=0) + ways.max(axis=0)) / 2 if own.any() else np.zeros(3)
    level = onward * (1 - UP)
    ground = asset.vertices[:, 1].min() + STANDING
    if own.any() and asset.vertices[own, 1].min() < ground and np.linalg.norm(level) > SHORTEST:
        middle = level
    length = np.linalg.norm(middle)
    if length < SHORTEST:
        return head + (onward if np.linalg.norm(onward) > SHORTEST else SHORTEST * UP)
    return head + middle / length * max(float((ways @ middle / length).max()), SHORTEST)


def frame_along(
    direction: Float64[np.ndarray, "3"], facing: Float64[np.ndarray, "3"] = FORWARD
) -> Float64[np.ndarray, "3 3"]:
    """The right-handed frame whose y axis has this direction and whose z axis faces as it is told, or up
    where the bone itself points there; where that is down, forward."""
    y = direction / np.linalg.norm(direction)
    if abs(y @ facing) > ALONG_FORWARD:
        facing = FORWARD if facing @ UP else UP
    z = facing - (facing @ y) * y
    z /= np.linalg.norm(z)
    return np.stack([np.cross(y, z), y, z], axis=1)


def aim_bones(asset: Asset, bones: Bones = "along") -> Asset:
    """The same asset with every joint's frame turned so that +y lies along its bone; nothing moves.

    The z axes face forward; with `mixamo` those of arms and hands face down, as they do on Mixamo's rigs.
    """
    skeleton = asset.skeleton
    T_world_joint = skeleton.T_world_joint.copy()
    for joint, way in enumerate(bone_tails(asset) - skeleton.joints):
        down = bones == "mixamo" and of_an_arm(skeleton.joint_names[joint])
        T_world_joint[joint, :3, :3] = frame_along(way, -UP if down else FORWARD)
    aimed = replace(skeleton, T_world_joint=T_world_joint)
    animations = tuple(reframed(animation, skeleton, aimed) for animation in asset.animations)
    return replace(asset, skeleton=aimed, animations=animations)


def of_an_arm(name: str) -> bool:
    """Whether a joint, by SMPL's name, is one of an arm or a hand."""
    side, _, part = name.partition("_")
    return side in ("left", "right") and part.startswith(ARMS)


def reframed(animation: Animation, old: Skeleton, new: Skeleton) -> Animation:
    """The same movement for a skeleton whose rest frames are turned otherwise."""
    turn = old.T_world_joint[:, :3, :3].transpose(0, 2, 1) @ new.T_world_joint[:, :3, :3]  # old <- new, J 3 3
    above = np.where((old.parents >= 0)[:, None, None], turn[old.parents].transpose(0, 2, 1), np.eye(3))
    T, J = animation.rotations.shape[:2]
    local = Rotation.from_quat(animation.rotations.reshape(-1, 4)).as_matrix().reshape(T, J, 3, 3)
    turned = Rotation.from_matrix((above @ local @ turn).reshape(-1, 3, 3)).as_quat()
    return replace(animation, rotations=continuous(turned.reshape(T, J, 4)))


def add_ends(asset: Asset) -> Asset:
    """The asset with a joint `NAME_end` at the end of every last bone; it moves no vertex and never turns."""
    skeleton = asset.skeleton
    J = len(skeleton.parents)
    last = np.setdiff1d(np.arange(J), skeleton.parents)
    T_world_end = skeleton.T_world_joint[last].copy()
    T_world_end[:, :3, 3] = bone_tails(asset)[last]
    still, turned = np.tile([0.0, 0.0, 0.0, 1.0], (len(last), 1)), skeleton.rest_rotations
    return replace(
        asset,
        skeleton=Skeleton(
            joint_names=(*skeleton.joint_names, *(f"{skeleton.joint_names[j]}_end" for j in last)),
            parents=np.concatenate([skeleton.parents, last]),
            T_world_joint=np.concatenate([skeleton.T_world_joint, T_world_end]),
            rest_rotations=None if turned is None else np.concatenate([turned, turned[last]]),
        ),
        animations=tuple(
            replace(a, rotations=np.concatenate([a.rotations, np.tile(still, (len(a.times), 1, 1))], axis=1))
            for a in asset.animations
        ),
        morphs=tuple(replace(m, joints=np.concatenate([m.joints, m.joints[last]])) for m in asset.morphs),
    )
