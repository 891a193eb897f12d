"""Twist bones: half of a hand's roll goes up the forearm, half of an upper arm's stays at the shoulder.

Linear blend skinning between two bones that are rolled against each other by an angle makes a tube thinner by
the cosine of half of it. A bone between the two, rolled by half, leaves the cosine of a quarter. Its share of
the limb's weight grows along the limb, so that skin rolls as evenly as over radius and ulna.

    forearm    twist rolls with the wrist by half;       its share is 0 at the elbow and 1 at the wrist
    upper arm  twist rolls back by half of the shoulder;  its share is 1 at the shoulder and 0 at the elbow

Where more joints than a vertex has room for share it, the limb's weight is on the heavier of the two alone:
that moves nothing in poses without a roll, and near a limb's ends, where so many meet, one has nearly all.

Letters: W vertices, J joints, T frames.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64
from scipy.spatial.transform import Rotation

from assets.asset.asset import Asset
from assets.asset.rig import Skeleton
from assets.skin.skin import INFLUENCES, limit_influences

UNTOLD = 1e-6  # length of a roll's quaternion below which it is rounding
HALF = 0.5  # of the roll that a twist bone has


@dataclass(frozen=True)
class Limb:
    """A bone that gets a twist bone, the joint at its far end, and whose roll is shared."""

    bone: str
    end: str
    rolls: str

    @property
    def twist(self) -> str:
        """The twist bone's name."""
        return f"{self.bone}_twist"

    @property
    def forward(self) -> bool:
        """Whether the twist bone follows a roll beyond the limb, or takes back some of the limb's own."""
        return self.rolls == self.end


LIMBS = tuple(
    Limb(f"{side}_{bone}", f"{side}_{end}", f"{side}_{rolls}")
    for side in ("left", "right")
    for bone, end, rolls in (("shoulder", "elbow", "shoulder"), ("elbow", "wrist", "wrist"))
)


def add_twists(asset: Asset) -> Asset:
    """The asset with a twist bone halfway along each upper arm and forearm, in the frame of the limb's bone.
    Poses that turn no twist bone look as before. Animations get none: they are made after."""
    for limb in LIMBS:
        if {limb.bone, limb.end} <= set(asset.skeleton.joint_names):
            asset = with_twist(asset, limb)
    return asset


def with_twist(asset: Asset, limb: Limb) -> Asset:
    """One twist bone more, after all other joints."""
    skeleton, names = asset.skeleton, asset.skeleton.joint_names
    J, bone, end = len(names), names.index(limb.bone), names.index(limb.end)
    T_world_twist = skeleton.T_world_joint[bone].copy()
    T_world_twist[:3, 3] = skeleton.joints[[bone, end]].mean(axis=0)
    turned = skeleton.rest_rotations
    if turned is not None:
        parent = skeleton.parents[bone] if limb.rolls == limb.bone else bone
        rolled = turned[parent].T @ turned[bone if limb.rolls == limb.bone else end]
        own = turned[bone] @ half_rolls(rolled[None], axis_of(skeleton, limb), limb.forward)[0]
        turned = np.concatenate([turned, own[None]])
    weights = np.zeros((len(asset.vertices), J + 1))
    np.add.at(weights, (np.arange(len(weights))[:, None], asset.joints), asset.weights)
    share = weights[:, bone] * share_along(asset, bone, end, limb.forward)
    weights[:, bone] -= share
    weights[:, J] = share
    crowded = np.flatnonzero((weights > 0).sum(axis=1) > INFLUENCES)
    both, pair = weights[crowded[:, None], [bone, J]], np.eye(2)
    weights[crowded[:, None], [bone, J]] = both.sum(axis=1, keepdims=True) * pair[both.argmax(axis=1)]
    changed, found = share > 0, limit_influences(weights)
    return replace(
        asset,
        joints=np.where(changed[:, None], found.joints, asset.joints),
        weights=np.where(changed[:, None], found.weights, asset.weights),
        skeleton=Skeleton(
            joint_names=(*names, limb.twist),
            parents=np.append(skeleton.parents, bone),
            T_world_joint=np.concatenate([skeleton.T_world_joint, T_world_twist[None]]),
            rest_rotations=turned,
        ),
        morphs=tuple(
            replace(m, joints=np.concatenate([m.joints, m.joints[[bone, end]].mean(axis=0)[None]]))
            for m in asset.morphs
        ),
    )


def share_along(asset: Asset, bone: int, end: int, forward: bool) -> Float64[np.ndarray, " W"]:
    """0..1 along the limb from its near to its far end, or the other way round."""
    near, far = asset.skeleton.joints[[bone, end]]
    way = far - near
    along = np.clip((asset.vertices - near) @ way / max(float(way @ way), 1e-12), 0, 1)
    return along if forward else 1 - along


def axis_of(skeleton: Skeleton, limb: Limb) -> Float64[np.ndarray, "3"]:
    """The limb's direction in the T-pose."""
    bone, end = (skeleton.joint_names.index(name) for name in (limb.bone, limb.end))
    way = skeleton.joints[end] - skeleton.joints[bone]
    if skeleton.rest_rotations is not None:
        way = skeleton.rest_rotations[bone].T @ way
    return way / max(float(np.linalg.norm(way)), 1e-12)


def drive_twists(turned: Float64[np.ndarray, "T J 3 3"], skeleton: Skeleton) -> None:
    """Set the twist bones' rotations of a motion, each against its parent from the T-pose, by those of the
    joints whose roll they share."""
    names = skeleton.joint_names
    for limb in LIMBS:
        if limb.twist in names:
            rolled = turned[:, names.index(limb.rolls)]
            turned[:, names.index(limb.twist)] = half_rolls(rolled, axis_of(skeleton, limb), limb.forward)


def half_rolls(
    rotations: Float64[np.ndarray, "T 3 3"], axis: Float64[np.ndarray, "3"], forward: bool
) -> Float64[np.ndarray, "T 3 3"]:
    """Half of each rotation's roll about the axis, or that backward.

    A rotation is a roll and then a swing of the axis; the roll's quaternion is what the whole one has along
    the axis. Rolls go on beyond 180 degrees where those of the frame before do, so that halves never jump by
    180; a swing by 180 degrees, whose roll nobody can tell, has none.
    """
    x, y, z, w = Rotation.from_matrix(rotations).as_quat().T
    along = np.stack([x, y, z], axis=1) @ axis
    told = np.hypot(along, w) > UNTOLD
    roll = np.unwrap(2 * np.arctan2(np.where(told, along, 0), np.where(told, w, 1)))
    roll -= 2 * np.pi * np.round(roll[0] / (2 * np.pi))  # the first frame's is the shorter one
    angle = HALF * roll if forward else -HALF * roll
    return Rotation.from_rotvec(angle[:, None] * axis).as_matrix()
