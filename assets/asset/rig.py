"""What moves an asset: its skeleton, animations of it and morphs of its mesh.

Letters: J joints, T frames of an animation, W vertices of the asset, M morphs of it. Metres, radians,
seconds; y up, facing +z. `T_world_joint` reads world <- joint. Quaternions are x y z w. A body's T-pose is
the pose in which all its rotations are zero; the asset's rest pose is the one its vertices stand in.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float32, Float64, Int64
from scipy.spatial.transform import Rotation

from assets.errors import GeometryError

UNIT_LIMIT = 1e-6  # a quaternion's length may be off 1 by this


@dataclass(frozen=True, kw_only=True)
class Skeleton:
    """Joints by name, their parents (-1 for the root, parents before children) and their rest transforms."""

    joint_names: tuple[str, ...]
    parents: Int64[np.ndarray, " J"]
    T_world_joint: Float64[np.ndarray, "J 4 4"]
    # rotation, in world axes, that took each joint from the T-pose to the rest pose; None: they are the same
    rest_rotations: Float64[np.ndarray, "J 3 3"] | None = None
    armature: bool = False  # files of nodes have one called Armature above joints and meshes

    def __post_init__(self) -> None:
        if not len(self.joint_names) == len(self.parents) == len(self.T_world_joint):
            raise GeometryError(
                f"skeleton: {len(self.joint_names)} names, {len(self.parents)} parents and "
                f"{len(self.T_world_joint)} transforms; one of each a joint is needed"
            )
        if not (self.parents < np.arange(len(self.parents))).all():
            raise GeometryError("skeleton: a joint comes before its parent; sort the joints")
        if not np.isfinite(self.T_world_joint).all():
            raise GeometryError("skeleton: transforms hold NaN or infinity; check the pose and the betas")
        if self.rest_rotations is not None and self.rest_rotations.shape != (len(self.parents), 3, 3):
            raise GeometryError(
                f"skeleton: rest rotations have shape {self.rest_rotations.shape}; "
                "one [3, 3] a joint is needed"
            )

    @property
    def joints(self) -> Float64[np.ndarray, "J 3"]:
        """Rest positions, metres."""
        return self.T_world_joint[:, :3, 3]

    @property
    def T_parent_joint(self) -> Float64[np.ndarray, "J 4 4"]:
        """Parent <- joint at rest; world <- joint for roots."""
        local = self.T_world_joint.copy()
        child = self.parents >= 0
        T_world_parent = self.T_world_joint[self.parents[child]]
        local[child] = np.linalg.inv(T_world_parent) @ local[child]
        return local


@dataclass(frozen=True, kw_only=True)
class Animation:
    """A skeleton over time: what the joint nodes of a file carry, frame by frame; and the asset's morphs.

    Joint j stands in its parent's frame at its rest translation, turned by `rotations[:, j]` instead of by
    its rest rotation. Joint 0, the root, stands at `root` instead; where that is a bone on the ground,
    joint 1 below it stands at `hips`. One of a face alone stands at rest.
    """

    name: str
    times: Float64[np.ndarray, " T"]  # seconds from 0, increasing
    rotations: Float64[np.ndarray, "T J 4"]  # neighbours in time lie in one half of the sphere
    root: Float64[np.ndarray, "T 3"]  # world place of joint 0, metres
    hips: Float64[np.ndarray, "T 3"] | None = None  # place of joint 1 in joint 0's frame; None: as at rest
    weights: Float64[np.ndarray, "T M"] | None = None  # of the asset's morphs, in their order; None: all 0

    def __post_init__(self) -> None:
        T = len(self.times)
        if not T == len(self.rotations) == len(self.root) or T == 0:
            raise GeometryError(
                f"animation {self.name}: {T} times, {len(self.rotations)} rotations and {len(self.root)} "
                "places; one of each a frame is needed"
            )
        if self.times[0] != 0 or not (np.diff(self.times) > 0).all():
            raise GeometryError(f"animation {self.name}: times must begin at 0 and increase")
        off = np.abs(np.linalg.norm(self.rotations, axis=2) - 1).max(initial=0)
        places = self.root if self.hips is None else np.stack([self.root, self.hips])
        if not off < UNIT_LIMIT or not np.isfinite(places).all():  # `not <` also catches NaN
            raise GeometryError(f"animation {self.name}: quaternions are off length 1 by {off:.1e}, or NaN")
        if self.weights is not None and not (len(self.weights) == T and np.isfinite(self.weights).all()):
            raise GeometryError(f"animation {self.name}: weights of morphs are NaN, or not one row a frame")

    @property
    def ways(self) -> dict[int, Float64[np.ndarray, "T 3"]]:
        """Places of the joints that leave their rest translation, in their parents' frames."""
        return {0: self.root} if self.hips is None else {0: self.root, 1: self.hips}

    def T_world_joint(self, skeleton: Skeleton) -> Float64[np.ndarray, "T J 4 4"]:
        """World <- joint of every frame."""
        T, J = self.rotations.shape[:2]
        local = np.tile(skeleton.T_parent_joint, (T, 1, 1, 1))
        local[:, :, :3, :3] = (
            Rotation.from_quat(self.rotations.reshape(-1, 4)).as_matrix().reshape(T, J, 3, 3)
        )
        for joint, way in self.ways.items():
            local[:, joint, :3, 3] = way
        for joint, parent in enumerate(skeleton.parents):
            if parent >= 0:
                local[:, joint] = local[:, parent] @ local[:, joint]
        return local

    def T_posed_rest(self, skeleton: Skeleton) -> Float64[np.ndarray, "T J 4 4"]:
        """Posed <- rest of every frame: what skinning blends."""
        return self.T_world_joint(skeleton) @ np.linalg.inv(skeleton.T_world_joint)


@dataclass(frozen=True, kw_only=True)
class Morph:
    """One slider: at weight 1 the vertices of the rest pose move by `vertices`.

    The joints ought to move by `joints`, which no morph target can do: a morphed mesh bends about the
    joints of the unmorphed one.
    """

    name: str
    vertices: Float32[np.ndarray, "W 3"]  # metres
    joints: Float64[np.ndarray, "J 3"]  # metres
    normals: Float32[np.ndarray, "W 3"] | None = None  # what normals gain; None: viewers keep those at rest

    def __post_init__(self) -> None:
        arrays = (self.vertices, self.joints, *(() if self.normals is None else (self.normals,)))
        if not all(np.isfinite(array).all() for array in arrays):
            raise GeometryError(f"morph {self.name}: it moves vertices or joints by NaN or infinity")
        if self.normals is not None and self.normals.shape != self.vertices.shape:
            raise GeometryError(
                f"morph {self.name}: {len(self.normals)} normals for {len(self.vertices)} vertices"
            )

    def of(self, rows: Int64[np.ndarray, " N"] | slice) -> "Morph":
        """The same slider of some of the vertices."""
        return replace(
            self, vertices=self.vertices[rows], normals=None if self.normals is None else self.normals[rows]
        )
