"""Labels of other projects, and how they become ours.

    rows --estimate()--> Estimate --to_ours()--> camera [25], pose [J 3], betas: see `avatargen.data.labels`

    eg3d        16 cam2world, 9 intrinsics, 3 orient, 69 body pose, 10 betas
    getavatar   16 world2cam, 3 orient, 69 body pose, 10 betas
    ag3d        16 cam2world, 9 intrinsics, scale, 3 translation, 3 orient, 69 body pose, 10 betas
    eva3d       9 and 3 of world2cam's rotation and place, 3 orient, 69 body pose, 10 betas

Matrices stand row by row; cameras have OpenCV's axes, but those of `getavatar`, which look along -z with y up
(OpenGL). Intrinsics are shares of the picture's width (first row) and height (second row); the focal length
that `getavatar` and `eva3d` do not tell is a share of the height. SMPL's body turns about its pelvis
where the pelvis rests; `ag3d` then places it at scale * (body + transl). In ours the pelvis is neither turned
nor moved: both go into the camera, so that the camera says from which side the person is seen.

Letters: J joints, b directions of shape. Metres, radians; float64.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float32, Float64

from avatargen.body.joints import SMPL_JOINT_NAMES
from avatargen.body.model import Body, shape
from avatargen.body.pose import axis_angle_to_matrix
from avatargen.errors import InputError

Convention = Literal["eg3d", "getavatar", "ag3d", "eva3d"]
CAMERA_NUMBERS = {"eg3d": 25, "getavatar": 16, "ag3d": 29, "eva3d": 12}
POSE, BETAS = 3 * len(SMPL_JOINT_NAMES), 10
# shares of the height: the renders of GETAvatar span 49.13 degrees; SMPLify-X's 5000 pixels on 1024
FOCAL = {"getavatar": 1.0939, "eva3d": 5000 / 1024}
OPENCV_FROM_OPENGL = np.diag([1.0, -1.0, -1.0, 1.0])
SKEWED = 1e-3  # largest departure of a rotation from one
LARGEST_ANGLE = 4 * np.pi
LARGEST_BETA = 20.0


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """What a label says of a picture: an OpenCV camera and SMPL's body at scale * (body + translation).

    Raises:
        InputError: numbers that can be no camera or no pose.
    """

    world2cam: Float64[np.ndarray, "4 4"]
    intrinsics: Float64[np.ndarray, "3 3"]
    scale: float
    translation: Float64[np.ndarray, "3"]
    pose: Float64[np.ndarray, "24 3"]  # axis-angle, in the order of SMPL_JOINT_NAMES
    betas: Float64[np.ndarray, " b"]

    def __post_init__(self) -> None:
        parts = (self.world2cam, self.intrinsics, self.translation, self.pose, self.betas)
        if not all(np.isfinite(part).all() for part in parts):
            raise InputError("label: NaN or infinity among its numbers; estimate it anew")
        turn = self.world2cam[:3, :3]
        skew = np.abs(turn @ turn.T - np.eye(3)).max()
        last = np.abs(self.world2cam[3] - [0, 0, 0, 1]).max()
        if not (skew < SKEWED and last < SKEWED and np.linalg.det(turn) > 0):
            raise InputError("label: the camera's matrix is no rotation and place; check the convention")
        if not (self.scale > 0 and np.isfinite(self.scale)):
            raise InputError(f"label: the scale is {self.scale:g}; it must be above 0")
        focal, last_row = np.diag(self.intrinsics)[:2], self.intrinsics[2]
        if not (focal > 0).all() or np.abs(last_row - [0, 0, 1]).max() > SKEWED:
            raise InputError("label: the intrinsics are none; check the convention")
        if not np.abs(self.pose).max() < LARGEST_ANGLE or not np.abs(self.betas).max() < LARGEST_BETA:
            raise InputError(
                "label: angles or betas are too large to be a pose and shape; check the convention"
            )


def estimate(
    convention: Convention, row: Float64[np.ndarray, " n"], aspect: float, focal: float | None = None
) -> Estimate:
    """The estimate in a row of numbers, for a picture `aspect` times as wide as high.

    `focal` is the focal length as a share of the height where the convention does not tell it.

    Raises:
        InputError: the row has another length, or is no camera and pose.
    """
    wanted = CAMERA_NUMBERS[convention] + POSE + BETAS
    if len(row) != wanted:
        raise InputError(f"label: {len(row)} numbers; {convention} has {wanted}; check the convention")
    camera, pose, betas = np.split(row, [CAMERA_NUMBERS[convention], wanted - BETAS])
    scale, translation = 1.0, np.zeros(3)
    if convention in ("eg3d", "ag3d"):
        world2cam, intrinsics = inverse_rigid(camera[:16].reshape(4, 4)), camera[16:25].reshape(3, 3)
        if convention == "ag3d":
            scale, translation = float(camera[25]), camera[26:29]
    else:
        world2cam = np.eye(4)
        if convention == "getavatar":
            world2cam = OPENCV_FROM_OPENGL @ camera.reshape(4, 4)
        else:
            world2cam[:3, :3], world2cam[:3, 3] = camera[:9].reshape(3, 3), camera[9:]
        f = focal or FOCAL[convention]
        intrinsics = np.array([[f / aspect, 0, 0.5], [0, f, 0.5], [0, 0, 1]])
    return Estimate(
        world2cam=world2cam,
        intrinsics=intrinsics,
        scale=scale,
        translation=translation,
        pose=pose.reshape(-1, 3),
        betas=betas,
    )


def inverse_rigid(matrix: Float64[np.ndarray, "4 4"]) -> Float64[np.ndarray, "4 4"]:
    """The inverse of a rotation and place; of anything else something that fails the checks later."""
    inverse = np.eye(4)
    inverse[:3, :3] = matrix[:3, :3].T
    inverse[:3, 3] = -matrix[:3, :3].T @ matrix[:3, 3]
    inverse[3] += matrix[3] - [0, 0, 0, 1]
    return inverse


@dataclass(frozen=True, kw_only=True)
class Label:
    """One picture in our convention, see `avatargen.data.labels`."""

    camera: Float32[np.ndarray, "25"]
    pose: Float32[np.ndarray, "J 3"]
    betas: Float32[np.ndarray, " b"]


def to_ours(found: Estimate, body: Body, *, keep_betas: bool) -> Label:
    """The same view of the same person, pelvis at rest; without `keep_betas` of mean shape.

    With W = [R T] the camera, O the pelvis' turn, p its place at rest, a point V of the body whose pelvis is
    at rest is seen at

        R s (O (V - p) + p + t) + T  =  s (R O V + R (p - O p + t) + T / s)

    and a camera sees no difference between a point and s times it.

    Raises:
        InputError: the body has fewer directions of shape than the label.
    """
    betas = found.betas if keep_betas else np.zeros(0)
    pelvis = shape(body, betas).joints[0]
    turn, place = found.world2cam[:3, :3], found.world2cam[:3, 3]
    orient = axis_angle_to_matrix(found.pose[0])
    world2cam = np.eye(4)
    world2cam[:3, :3] = turn @ orient
    world2cam[:3, 3] = turn @ (pelvis - orient @ pelvis + found.translation) + place / found.scale
    camera = np.concatenate([inverse_rigid(world2cam).ravel(), found.intrinsics.ravel()])
    pose = np.zeros((body.joint_count, 3), dtype=np.float32)
    for name, turns in zip(SMPL_JOINT_NAMES[1:], found.pose[1:], strict=True):
        if name in body.joint_names:
            pose[body.joint_names.index(name)] = turns
    all_betas = np.zeros(body.shapedirs.shape[2], dtype=np.float32)
    all_betas[: len(betas)] = betas
    return Label(camera=camera.astype(np.float32), pose=pose, betas=all_betas)
