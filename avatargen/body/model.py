"""The body: a mesh with shape directions, a skeleton and skinning weights, in SMPL's form with any number of
joints.

    Body --shape(betas)--> ShapedBody --pose(rotations)--> PosedBody
    Body --canonical_body()--> CanonicalBody      X-pose, betas 0: the space the generator's fields live in

Letters: V vertices, F faces, J joints, B shape directions. Metres, y up, facing +z, faces counter-clockwise
from outside; the template stands in the T-pose. `T_world_joint` reads world <- joint, `T_posed_rest` reads
posed <- rest.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Float32, Float64, Int64

from avatargen.body.distance import BodyDistance
from avatargen.body.pose import axis_angle_to_matrix, named_pose
from avatargen.body.skinning import skin
from avatargen.errors import InputError

WEIGHT_SUM_LIMIT = 1e-4


@dataclass(frozen=True, kw_only=True)
class Body:
    """Template, faces, skeleton, weights and blend shapes. Raises InputError where they disagree."""

    v_template: Float32[np.ndarray, "V 3"]
    faces: Int64[np.ndarray, "F 3"]
    weights: Float32[np.ndarray, "V J"]
    parents: Int64[np.ndarray, " J"]
    joint_names: tuple[str, ...]
    J_regressor: Float32[np.ndarray, "J V"]
    shapedirs: Float32[np.ndarray, "V 3 B"]
    posedirs: Float32[np.ndarray, "V 3 P"] | None = None

    def __post_init__(self) -> None:
        V, J = self.weights.shape
        require_shape("v_template", self.v_template, (V, 3))
        require_shape("parents", self.parents, (J,))
        require_shape("J_regressor", self.J_regressor, (J, V))
        require_shape("shapedirs", self.shapedirs, (V, 3, self.shapedirs.shape[-1]))
        if self.posedirs is not None:
            require_shape("posedirs", self.posedirs, (V, 3, 9 * (J - 1)))
        if len(self.joint_names) != J or len(set(self.joint_names)) != J:
            raise InputError(
                f"body: {len(self.joint_names)} joint names for {J} joints; give each joint its own name"
            )
        check_faces(self.faces, V)
        check_skeleton(self.parents, self.weights)
        for name in ("v_template", "J_regressor", "shapedirs", "posedirs"):
            array = getattr(self, name)
            if array is not None and not np.isfinite(array).all():
                raise InputError(f"body: {name} holds NaN or infinity; the file is damaged")

    @property
    def joint_count(self) -> int:
        return len(self.parents)


def require_shape(name: str, array: np.ndarray, shape: tuple[int | None, ...]) -> None:
    """Raise InputError unless the array has this shape; None stands for any length."""
    if len(array.shape) != len(shape) or any(
        w not in (None, h) for h, w in zip(array.shape, shape, strict=True)
    ):
        raise InputError(f"body: {name} has shape {array.shape}; the other arrays ask for {shape}")


def check_faces(faces: Int64[np.ndarray, "F 3"], vertex_count: int) -> None:
    if faces.ndim != 2 or faces.shape[1] != 3 or len(faces) == 0:
        raise InputError(f"body: faces have shape {faces.shape}; triangles [F, 3] are needed")
    if faces.min() < 0 or faces.max() >= vertex_count:
        raise InputError(f"body: faces name vertices {faces.min()}..{faces.max()}; there are {vertex_count}")


def check_skeleton(parents: Int64[np.ndarray, " J"], weights: Float[np.ndarray, "V J"]) -> None:
    if (
        len(parents) == 0
        or parents[0] != -1
        or not ((parents[1:] >= 0) & (parents[1:] < np.arange(1, len(parents)))).all()
    ):
        raise InputError(
            "body: parents must be -1 for joint 0 alone, and name an earlier joint for every other"
        )
    error = np.abs(weights.sum(axis=1, dtype=np.float64) - 1).max(initial=0)
    if not error < WEIGHT_SUM_LIMIT:  # also catches NaN
        raise InputError(f"body: weights must sum to 1 per vertex; sums are off by {error:.1e}")
    if weights.min() < 0:
        raise InputError(f"body: weights must be 0 or more; the least is {weights.min():.1e}")


@dataclass(frozen=True, kw_only=True)
class ShapedBody:
    """A body of one person's shape, in the T-pose."""

    body: Body
    vertices: Float64[np.ndarray, "V 3"]
    joints: Float64[np.ndarray, "J 3"]


@dataclass(frozen=True, kw_only=True)
class PosedBody:
    """A shaped body in a pose; `offsets` are the pose blend shapes, added before skinning."""

    shaped: ShapedBody
    vertices: Float64[np.ndarray, "V 3"]
    offsets: Float64[np.ndarray, "V 3"]
    T_world_joint: Float64[np.ndarray, "J 4 4"]
    T_posed_rest: Float64[np.ndarray, "J 4 4"]

    @property
    def joints(self) -> Float64[np.ndarray, "J 3"]:
        return self.T_world_joint[:, :3, 3]


@dataclass(frozen=True, kw_only=True)
class CanonicalBody:
    """The body of the canonical space: X-pose, betas 0. The same for every person."""

    vertices: Float32[np.ndarray, "V 3"]
    faces: Int64[np.ndarray, "F 3"]
    joints: Float32[np.ndarray, "J 3"]
    weights: Float32[np.ndarray, "V J"]
    parents: Int64[np.ndarray, " J"]
    joint_names: tuple[str, ...]
    source: Body

    @cached_property
    def distance(self) -> BodyDistance:
        """Signed distances to it: the tree is built when it is first asked."""
        return BodyDistance(self.vertices, self.faces)


def shape(body: Body, betas: Float[np.ndarray, " b"]) -> ShapedBody:
    """Add the shape directions and regress the joints. Fewer betas than directions: the rest are zero.

    Raises:
        InputError: more betas than the body has directions, or not finite.
    """
    betas = np.asarray(betas, dtype=np.float64)
    if betas.ndim != 1 or len(betas) > body.shapedirs.shape[2] or not np.isfinite(betas).all():
        raise InputError(
            f"body: betas have shape {betas.shape}; up to {body.shapedirs.shape[2]} finite numbers are taken"
        )
    directions = body.shapedirs[:, :, : len(betas)].astype(np.float64)
    vertices = body.v_template.astype(np.float64) + directions @ betas
    return ShapedBody(body=body, vertices=vertices, joints=body.J_regressor.astype(np.float64) @ vertices)


def pose(
    body: Body,
    shaped: ShapedBody,
    rotations: Float[np.ndarray, "J 3"],
    translation: Float[np.ndarray, "3"] | None = None,
) -> PosedBody:
    """Pose a shaped body: pose blend shapes where the file has them, forward kinematics, linear blend
    skinning.

    `rotations` are axis-angle radians relative to each joint's parent; `translation` is added at the end,
    metres.

    Raises:
        InputError: rotations of another shape, or not finite.
    """
    if np.shape(rotations) != (body.joint_count, 3) or not np.isfinite(rotations).all():
        raise InputError(
            f"body: rotations have shape {np.shape(rotations)}; finite [{body.joint_count}, 3] are needed"
        )
    matrices = axis_angle_to_matrix(rotations)
    offsets = pose_offsets(body, matrices)
    T_world_joint = forward_kinematics(shaped.joints, matrices, body.parents)
    if translation is not None:
        T_world_joint[:, :3, 3] += translation
    T_posed_rest = from_rest_joints(T_world_joint, shaped.joints)
    vertices = skin(shaped.vertices + offsets, body.weights, T_posed_rest)
    return PosedBody(
        shaped=shaped,
        vertices=vertices,
        offsets=offsets,
        T_world_joint=T_world_joint,
        T_posed_rest=T_posed_rest,
    )


def pose_offsets(body: Body, matrices: Float64[np.ndarray, "J 3 3"]) -> Float64[np.ndarray, "V 3"]:
    """SMPL's pose blend shapes: linear in (R - I) of every joint but the root; zero without `posedirs`."""
    if body.posedirs is None:
        return np.zeros(body.v_template.shape)
    feature = (matrices[1:] - np.eye(3)).reshape(-1)
    return body.posedirs @ feature


def forward_kinematics(
    joints: Float64[np.ndarray, "J 3"],
    matrices: Float64[np.ndarray, "J 3 3"],
    parents: Int64[np.ndarray, " J"],
) -> Float64[np.ndarray, "J 4 4"]:
    """World <- joint transforms of a skeleton whose rest joints stand unrotated at `joints`."""
    T_world_joint = np.tile(np.eye(4), (len(joints), 1, 1))
    T_world_joint[:, :3, :3] = matrices
    T_world_joint[0, :3, 3] = joints[0]
    for joint in range(1, len(joints)):
        T_world_joint[joint, :3, 3] = joints[joint] - joints[parents[joint]]
        T_world_joint[joint] = T_world_joint[parents[joint]] @ T_world_joint[joint]
    return T_world_joint


def from_rest_joints(
    T_world_joint: Float64[np.ndarray, "J 4 4"], joints: Float64[np.ndarray, "J 3"]
) -> Float64[np.ndarray, "J 4 4"]:
    """Posed <- rest: into the frame of the joint that rests at `joints`, then to its posed place."""
    T_posed_rest = T_world_joint.copy()
    T_posed_rest[:, :3, 3] -= np.einsum("jab,jb->ja", T_world_joint[:, :3, :3], joints)
    return T_posed_rest


def pose_canonically(body: Body) -> PosedBody:
    """The body in the canonical pose and shape, with its transforms from the T-pose."""
    shaped = shape(body, np.zeros(0))
    return pose(body, shaped, named_pose("x", body.joint_names))


def canonical_body(body: Body) -> CanonicalBody:
    """The body of the canonical space: X-pose, betas 0."""
    posed = pose_canonically(body)
    return CanonicalBody(
        vertices=posed.vertices.astype(np.float32),
        faces=body.faces,
        joints=posed.joints.astype(np.float32),
        weights=body.weights,
        parents=body.parents,
        joint_names=body.joint_names,
        source=body,
    )
