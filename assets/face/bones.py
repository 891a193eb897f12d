"""Bones of a face: a jaw, which moves the chin, the lower teeth and the tongue, and an eye each, which turn
the balls. They are the head's children, named and placed as SMPL-X's.

Letters: W vertices of an asset, V welded ones, J joints. Metres.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Float64

from assets.asset.asset import Asset
from assets.asset.rig import Skeleton
from assets.face.motions import Motions
from assets.skin.skin import limit_influences

NAMES = ("jaw", "left_eye", "right_eye")
LOWER_TEETH = 2  # kind of vertices


def with_bones(
    asset: Asset, motions: Motions, rest: Float64[np.ndarray, "3 3"], share: Float64[np.ndarray, " V"]
) -> Asset:
    """The asset with the bones at their places at rest; `share` says how far the jaw moves each welded
    vertex that the head does."""
    assert asset.welded is not None, "built from a field"
    skeleton, J = asset.skeleton, len(asset.skeleton.parents)
    head = skeleton.joint_names.index("head")
    T_world_bone = np.tile(skeleton.T_world_joint[head], (len(NAMES), 1, 1))
    T_world_bone[:, :3, 3] = rest
    turned = skeleton.rest_rotations
    jaw = share[asset.welded]
    moved = np.flatnonzero(jaw > 0)
    dense = np.zeros((len(moved), J + len(NAMES)))
    np.add.at(dense, (np.arange(len(moved))[:, None], asset.joints[moved]), asset.weights[moved])
    dense[:, J] = jaw[moved] * dense[:, head]
    dense[:, head] -= dense[:, J]
    skin = limit_influences(dense)
    joints, weights = asset.joints.copy(), asset.weights.copy()
    joints[moved], weights[moved] = skin.joints, skin.weights
    for bone, sphere in enumerate(motions.eyes.spheres, start=J + 1):
        part = motions.of_eyes(sphere)
        ball = (asset.welded >= part.start) & (asset.welded < part.stop)
        joints[ball], weights[ball] = [bone, 0, 0, 0], [1, 0, 0, 0]
    return replace(
        asset,
        joints=joints,
        weights=weights,
        skeleton=Skeleton(
            joint_names=(*skeleton.joint_names, *NAMES),
            parents=np.append(skeleton.parents, [head] * len(NAMES)),
            T_world_joint=np.concatenate([skeleton.T_world_joint, T_world_bone]),
            rest_rotations=None if turned is None else np.concatenate([turned, turned[[head] * len(NAMES)]]),
        ),
        morphs=tuple(
            replace(morph, joints=np.concatenate([morph.joints, morph.joints[[head] * len(NAMES)]]))
            for morph in asset.morphs
        ),
    )


def jaw_motion(motions: Motions) -> tuple[Float64[np.ndarray, "3"], Float64[np.ndarray, " V"]]:
    """Where the jaw turns, canonically, and how much of its turn each vertex has.

    What the unit that opens the mouth does to the lower teeth is a turn about an axis from ear to ear, and
    other vertices have as much of it as they go along.
    """
    moved, at = motions.unit("mouth-open"), motions.at
    teeth = np.flatnonzero(motions.kind == LOWER_TEETH)
    before, after = at[teeth, 1:], at[teeth, 1:] + moved[teeth, 1:]
    a, b = before - before.mean(axis=0), after - after.mean(axis=0)
    angle = np.arctan2((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum(), (a * b).sum())
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    pivot = np.linalg.solve(np.eye(2) - turn, after.mean(axis=0) - turn @ before.mean(axis=0))
    whole = (at[:, 1:] - pivot) @ (turn - np.eye(2)).T
    share = (moved[:, 1:] * whole).sum(axis=1) / np.maximum((whole**2).sum(axis=1), 1e-6)
    share[np.abs(moved).max(axis=1) == 0] = 0
    return np.array([0.0, *pivot]), np.clip(share, 0, 1)
