"""Where clips put chains along cloth: as cloth without bones of its own would hang.

Each bone of a chain, from the first on, is turned the shortest way towards the place that its tail has with
the weights of the cloth around it. Letters: T frames, J joints, N joints of a chain.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Float64
from scipy.spatial.transform import Rotation

from assets.asset.rig import Animation, Skeleton
from assets.asset.spring import Spring
from avatargen.motion.motion import continuous

SHORTEST = 1e-6  # m of a way that has a direction


def drape(animation: Animation, skeleton: Skeleton, springs: tuple[Spring, ...]) -> Animation:
    """The animation with the rotations of all springs' chains."""
    if not springs:
        return animation
    T_world_joint = animation.T_world_joint(skeleton)
    T_posed_rest = T_world_joint @ np.linalg.inv(skeleton.T_world_joint)
    rotations = animation.rotations.copy()
    for spring in springs:
        wanted = carried(spring, skeleton, T_posed_rest)
        for n, joint in enumerate(spring.joints[:-1]):
            above = T_world_joint[:, skeleton.parents[joint]]
            there = above @ skeleton.T_parent_joint[joint]
            tail = there @ skeleton.T_parent_joint[spring.joints[n + 1]]
            head = there[:, :3, 3]
            turn = swings(tail[:, :3, 3] - head, wanted[:, n + 1] - head)
            there[:, :3, :3] = turn @ there[:, :3, :3]
            T_world_joint[:, joint] = there
            local = above[:, :3, :3].transpose(0, 2, 1) @ there[:, :3, :3]
            rotations[:, joint] = Rotation.from_matrix(local).as_quat()
    return replace(animation, rotations=continuous(rotations))


def carried(
    spring: Spring, skeleton: Skeleton, T_posed_rest: Float64[np.ndarray, "T J 4 4"]
) -> Float64[np.ndarray, "T N 3"]:
    """Where cloth without a chain has each of the chain's joints."""
    places = np.concatenate([skeleton.joints[spring.joints], np.ones((len(spring.joints), 1))], axis=1)
    blended = np.einsum("nk,tnkab->tnab", spring.shares, T_posed_rest[:, spring.carriers])
    return np.einsum("tnab,nb->tna", blended, places)[:, :, :3]


def swings(old: Float64[np.ndarray, "T 3"], new: Float64[np.ndarray, "T 3"]) -> Float64[np.ndarray, "T 3 3"]:
    """The shortest rotation from each direction to another; none where one has no length, or they are
    opposite."""
    lengths = np.linalg.norm(old, axis=1) * np.linalg.norm(new, axis=1)
    scale = np.maximum(lengths, SHORTEST**2)[:, None]
    axis, cosine = np.cross(old, new) / scale, np.sum(old * new, axis=1, keepdims=True) / scale
    told = (lengths > SHORTEST**2)[:, None] & (1 + cosine > SHORTEST)
    return Rotation.from_quat(
        np.where(told, np.concatenate([axis, 1 + cosine], axis=1), [0, 0, 0, 1])
    ).as_matrix()
