"""Labels of mirrored pictures: the person's left and right change places.

The mirror is the plane x = 0 of the person: a turn (x, y, z) of a joint becomes (x, -y, -z) of the joint on
the other side, the camera moves to the other side, and what lay at u in the picture lies at 1 - u. Bodies are
taken to be symmetric; where one is not quite, joints are off by its asymmetry.
"""

import numpy as np
from jaxtyping import Float, Float32, Int64

from avatargen.body.joints import mirrored_name
from avatargen.data.conventions import Label
from avatargen.data.poses import MIRRORED

SIDE = np.diag([-1.0, 1.0, 1.0, 1.0])


def mirrored(label: Label, joint_names: tuple[str, ...]) -> Label:
    """The label of the picture turned left to right."""
    return Label(
        camera=mirrored_camera(label.camera),
        pose=mirrored_pose(label.pose, joint_names),
        betas=label.betas,
    )


def mirrored_pose(pose: Float[np.ndarray, "J 3"], joint_names: tuple[str, ...]) -> Float32[np.ndarray, "J 3"]:
    """Each joint's turn seen in the mirror; a joint without a partner is its own."""
    return (pose[partners(joint_names)] * MIRRORED).astype(np.float32)


def partners(joint_names: tuple[str, ...]) -> Int64[np.ndarray, " J"]:
    """The number of each joint's partner on the other side; one without is its own."""
    return np.array(
        [
            joint_names.index(name) if (name := mirrored_name(joint)) in joint_names else i
            for i, joint in enumerate(joint_names)
        ]
    )


def mirrored_camera(camera: Float[np.ndarray, "25"]) -> Float32[np.ndarray, "25"]:
    """The camera on the other side of the person; its picture is the mirrored one."""
    cam2world = SIDE @ camera[:16].reshape(4, 4) @ SIDE
    intrinsics = camera[16:].reshape(3, 3).astype(np.float64)
    intrinsics[0, 1:] = -intrinsics[0, 1], 1 - intrinsics[0, 2]
    return np.concatenate([cam2world.ravel(), intrinsics.ravel()]).astype(np.float32)
