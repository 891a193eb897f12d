"""Skeletons and motions built in code, for tests of what moves an asset."""

import functools

import numpy as np
from scipy.spatial.transform import Rotation

from assets.asset.rig import Skeleton
from avatargen.body.joints import SMPL_JOINT_NAMES
from avatargen.body.model import Body, PosedBody, pose, shape
from avatargen.motion.figure import Figure
from avatargen.motion.motion import Motion, continuous
from tests.bodies import capsule_body

BETAS = np.array([1.0, -0.5, 0.25])


def figure(body: Body) -> Figure:
    """A body in the T-pose, on ground that its lowest vertex touches."""
    shaped = shape(body, np.zeros(0))
    return Figure(
        joint_names=body.joint_names, joints=shaped.joints, ground=float(shaped.vertices[:, 1].min())
    )


@functools.cache
def symmetric_figure() -> Figure:
    """The capsule's joints, mirrored to the last bit."""
    found = figure(capsule_body())
    joints = found.joints.copy()
    for left in (j for j, name in enumerate(found.joint_names) if name.startswith("left_")):
        right = found.joint_names.index(found.joint_names[left].replace("left_", "right_"))
        joints[right] = joints[left] * [-1, 1, 1]
    middle = [j for j, name in enumerate(found.joint_names) if "_" not in name]
    joints[middle, 0] = 0
    return Figure(joint_names=found.joint_names, joints=joints, ground=found.ground)


def random_motion(
    frames: int = 5, names: tuple[str, ...] = SMPL_JOINT_NAMES, angle: float = 0.6, seed: int = 0
) -> Motion:
    rng = np.random.default_rng(seed)
    turns = Rotation.from_rotvec(rng.uniform(-angle, angle, (frames * len(names), 3))).as_quat()
    return Motion(
        name="random",
        joint_names=names,
        times=np.arange(frames) / 30,
        rotations=continuous(turns.reshape(frames, len(names), 4)),
        translation=rng.normal(size=(frames, 3)),
    )


def posed_by(motion: Motion, frame: int) -> PosedBody:
    """The capsule body in a motion's frame, by the body model itself."""
    body = capsule_body()
    angles = Rotation.from_quat(motion.rotations[frame]).as_rotvec()
    return pose(body, shape(body, BETAS), angles, motion.translation[frame])


def skeleton_at(rotations: np.ndarray, turned: bool = False) -> Skeleton:
    """The capsule body's skeleton, resting in a pose; `turned`: with joint frames that point anywhere."""
    body = capsule_body()
    rest = pose(body, shape(body, BETAS), rotations)
    T_world_joint = np.tile(np.eye(4), (len(body.parents), 1, 1))
    T_world_joint[:, :3, 3] = rest.joints
    if turned:
        T_world_joint[:, :3, :3] = Rotation.random(
            len(body.parents), rng=np.random.default_rng(3)
        ).as_matrix()
    return Skeleton(
        joint_names=body.joint_names,
        parents=body.parents,
        T_world_joint=T_world_joint,
        rest_rotations=rest.T_world_joint[:, :3, :3],
    )
