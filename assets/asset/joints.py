"""Which joints a skeleton has: all of the body's, SMPL's 24 without fingers, or those that move a vertex,
carry one that does, or belong to every person's skeleton.
"""

import dataclasses

import numpy as np
from jaxtyping import Bool, Int64

from assets.asset.asset import Asset
from assets.asset.names import PERSON_JOINTS
from assets.asset.rig import Skeleton
from assets.content import Joints
from avatargen.body.fingers import without_fingers
from avatargen.body.model import CanonicalBody, canonical_body


def body_on(body: CanonicalBody, joints: Joints) -> CanonicalBody:
    """The body on the joints that are wanted of it before anything is known of a mesh."""
    fewer = without_fingers(body.source) if joints == "24" else body.source
    return body if fewer is body.source else canonical_body(fewer)


def moving_joints(parents: Int64[np.ndarray, " J"], used: Bool[np.ndarray, " J"]) -> Bool[np.ndarray, " J"]:
    """Joints that are used or have a descendant that is; roots always are. Parents come before children."""
    moving = used | (parents < 0)
    for joint in range(len(parents) - 1, 0, -1):
        if moving[joint] and parents[joint] >= 0:
            moving[parents[joint]] = True
    return moving


def drop_idle_joints(asset: Asset) -> Asset:
    """The same asset on a skeleton without the joints that move nothing; every vertex moves as before.

    Joints that clips and rigs of people stand on stay: on a coarse mesh a wrist may be nearest to no vertex.
    """
    skeleton = asset.skeleton
    used = np.zeros(len(skeleton.parents), dtype=bool)
    used[asset.joints[asset.weights > 0]] = True
    used |= np.isin(skeleton.joint_names, PERSON_JOINTS)
    moving = moving_joints(skeleton.parents, used)
    place = np.cumsum(moving) - 1
    parents = skeleton.parents[moving]
    return dataclasses.replace(
        asset,
        joints=np.where(asset.weights > 0, place[asset.joints], 0),
        skeleton=Skeleton(
            joint_names=tuple(name for name, keep in zip(skeleton.joint_names, moving, strict=True) if keep),
            parents=np.where(parents < 0, -1, place[parents]),
            T_world_joint=skeleton.T_world_joint[moving],
            rest_rotations=None if skeleton.rest_rotations is None else skeleton.rest_rotations[moving],
        ),
        animations=tuple(
            dataclasses.replace(animation, rotations=animation.rotations[:, moving])
            for animation in asset.animations
        ),
        morphs=tuple(dataclasses.replace(morph, joints=morph.joints[moving]) for morph in asset.morphs),
    )
