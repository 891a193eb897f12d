"""A bone on the ground above the pelvis, which carries a person's way through the world: what engines with
root motion read a character's travel off.

Letters: J joints, T frames.
"""

from dataclasses import replace

import numpy as np

from assets.asset.asset import Asset
from assets.asset.rig import Animation, Skeleton
from assets.errors import GeometryError

NAME = "root"
ON_GROUND = np.array([1.0, 0.0, 1.0])


def with_root(asset: Asset) -> Asset:
    """The asset with a joint `root` before all others, on the ground below the first one, and an Armature
    node above it. Of an animation's way it has that over the ground; up and down goes the pelvis. Nothing
    moves otherwise than before.

    Raises:
        GeometryError: the skeleton has several roots, or a joint of that name.
    """
    skeleton = asset.skeleton
    if NAME in skeleton.joint_names or (skeleton.parents < 0).sum() != 1:
        raise GeometryError(
            f"root bone: the skeleton has one called {NAME}, or several first joints; leave --root out"
        )
    T_world_root = np.eye(4)
    T_world_root[:3, 3] = skeleton.joints[0] * ON_GROUND
    turned = skeleton.rest_rotations
    return replace(
        asset,
        joints=np.where(asset.weights > 0, asset.joints + 1, 0),
        skeleton=Skeleton(
            joint_names=(NAME, *skeleton.joint_names),
            parents=np.concatenate([[-1], skeleton.parents + 1]),
            T_world_joint=np.concatenate([T_world_root[None], skeleton.T_world_joint]),
            rest_rotations=None if turned is None else np.concatenate([np.eye(3)[None], turned]),
            armature=True,
        ),
        animations=tuple(rooted(animation) for animation in asset.animations),
        springs=tuple(replace(s, joints=s.joints + 1, carriers=s.carriers + 1) for s in asset.springs),
        colliders=tuple(replace(each, joint=each.joint + 1) for each in asset.colliders),
        morphs=tuple(
            replace(m, joints=np.concatenate([m.joints[:1] * ON_GROUND, m.joints])) for m in asset.morphs
        ),
    )


def rooted(animation: Animation) -> Animation:
    """The animation with the pelvis' way over the ground on a root bone below it, which never turns."""
    still = np.tile([0.0, 0.0, 0.0, 1.0], (len(animation.times), 1, 1))
    return replace(
        animation,
        rotations=np.concatenate([still, animation.rotations], axis=1),
        root=animation.root * ON_GROUND,
        hips=animation.root * (1 - ON_GROUND),
    )


def on_hips(asset: Asset) -> Asset:
    """The asset with all of the way on the hips and the root bone where it rests, as players expect that know
    a person's own bones alone."""
    rest = asset.skeleton.joints[0]
    return replace(
        asset,
        animations=tuple(
            replace(a, root=np.tile(rest, (len(a.times), 1)), hips=a.hips + a.root - rest)
            for a in asset.animations
            if a.hips is not None
        ),
    )
