"""Where a label's joints lie in its picture.

Letters: J joints, N points. Places are in widths and heights of the picture, 0..1 from the top left.
"""

import numpy as np
import torch
from jaxtyping import Float, Float64

from avatargen.body.model import Body, forward_kinematics, shape
from avatargen.body.pose import axis_angle_to_matrix
from avatargen.generator.camera import camera_of_vector


def projected_joints(
    body: Body,
    camera: Float[np.ndarray, "25"],
    pose: Float[np.ndarray, "J 3"],
    betas: Float[np.ndarray, " b"],
) -> Float64[np.ndarray, "J 2"]:
    """Every joint of the posed body as the camera sees it."""
    rest = shape(body, betas).joints
    return project(forward_kinematics(rest, axis_angle_to_matrix(pose), body.parents)[:, :3, 3], camera)


def project(points: Float[np.ndarray, "N 3"], camera: Float[np.ndarray, "25"]) -> Float64[np.ndarray, "N 2"]:
    """World points to places in the picture."""
    one = camera_of_vector(torch.from_numpy(camera)[None].double())
    cam2world, intrinsics = one.cam2world[0].numpy(), one.intrinsics[0].numpy()
    local = (points - cam2world[:3, 3]) @ cam2world[:3, :3]
    pixels = local @ intrinsics.T
    return pixels[:, :2] / np.maximum(pixels[:, 2:], 1e-6)
