"""Where joints are in a picture: the truth of a label, and a built-in estimate from the picture alone.

The built-in estimate is kernel ridge regression from the picture's oriented edges, in 16 x 16 cells, to the
joints' places: fitted in closed form, in seconds, on labelled pictures and their mirror images. It is coarse;
its own error on real pictures is the floor that a generator's pose error is read against. A real pose network
can take its place, see `avatargen.metrics.pose_network`.

Letters: N pictures, J joints, S pixels a side. Places are in widths of the picture, 0..1 from the top left.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Float64, Int64
from torch import Tensor
from torch.nn import functional as F

from avatargen.body.model import Body
from avatargen.data.dataset import Pictures
from avatargen.data.joints import projected_joints
from avatargen.data.mirror import partners

RIDGE_POSE = "pose by ridge regression (% of the picture)"
CELLS = 16  # along a side
DIRECTIONS = 6  # of edges that are told apart
SHARPNESS = 4  # power of the cosine to a direction: an edge counts for two neighbours
RIDGE = 1e-2


@dataclass(frozen=True, kw_only=True, eq=False)
class JointJudge:
    """An estimator of some of the body's joints, and the name of the error that it measures.

    One that takes backs for fronts has a `partner` for each joint, on the other side: then a picture's error
    is that of the better of both readings.
    """

    name: str
    which: Int64[np.ndarray, " K"]
    estimate: Callable[[Float[Tensor, "N 3 S S"]], Float64[np.ndarray, "N K 2"]]
    partner: Int64[np.ndarray, " K"] | None = None

    def errors(
        self, images: Float[Tensor, "N 3 S S"], truth: Float64[np.ndarray, "N K 2"]
    ) -> Float64[np.ndarray, " N"]:
        """Mean distance of each picture's joints, in percent of the picture's width."""
        found = self.estimate(images)
        readings = [found] if self.partner is None else [found, found[:, self.partner]]
        away = [np.linalg.norm(reading - truth, axis=2).mean(axis=1) for reading in readings]
        return 100 * np.minimum.reduce(away)


def ridge_judge(reference: Pictures, body: Body, most: int) -> JointJudge:
    """The built-in estimator, fitted on at most so many pictures, evenly over the set."""
    chosen = spread_over(reference, most)
    partner = partners(body.joint_names)
    fitted = fit_joints(load_images(reference, chosen), true_joints(reference, body, chosen), partner)
    return JointJudge(name=RIDGE_POSE, which=np.arange(len(partner)), estimate=fitted)


def spread_over(pictures: Pictures, most: int) -> Int64[np.ndarray, " N"]:
    """Numbers of at most so many pictures, evenly over the set, which holds each person's in a row."""
    return torch.linspace(0, len(pictures) - 1, min(len(pictures), most)).long().numpy()


def load_images(pictures: Pictures, indices: Int64[np.ndarray, " N"]) -> Float[Tensor, "N 3 S S"]:
    return pictures.pixels(torch.as_tensor(indices)).float() / 255


def true_joints(pictures: Pictures, body: Body, indices: np.ndarray) -> Float64[np.ndarray, "N J 2"]:
    """Projections of the labels' joints."""
    labels = pictures.labels
    return np.stack(
        [projected_joints(body, labels.camera[i], labels.pose[i], labels.betas[i]) for i in indices]
    )


def edges(images: Float[Tensor, "N 3 S S"]) -> Float64[np.ndarray, "N k"]:
    """Square roots of the mean strength of edges in each cell, by the direction in which it gets brighter."""
    gray = images.clamp(0, 1).mean(dim=1, keepdim=True)
    right = F.pad(gray[..., 2:] - gray[..., :-2], (1, 1)) / 2  # the border is background
    down = F.pad(gray[..., 2:, :] - gray[..., :-2, :], (0, 0, 1, 1)) / 2
    strength, angle = torch.hypot(right, down), torch.atan2(down, right)
    turns = 2 * torch.pi / DIRECTIONS * torch.arange(DIRECTIONS, device=images.device)[:, None, None]
    oriented = strength * torch.cos(angle - turns).clamp_min(0) ** SHARPNESS
    cells = F.interpolate(oriented, size=(CELLS, CELLS), mode="area")
    return cells.sqrt().flatten(1).double().cpu().numpy()


@dataclass(frozen=True, kw_only=True, eq=False)
class RidgeEstimator:
    """Kernel ridge regression with a Gaussian kernel."""

    known: Float64[np.ndarray, "N k"]
    weights: Float64[np.ndarray, "N m"]
    mean: Float64[np.ndarray, "J 2"]
    width: float

    def __call__(self, images: Float[Tensor, "N 3 S S"]) -> Float64[np.ndarray, "N J 2"]:
        kernel = gaussian(edges(images), self.known, self.width)
        return (kernel @ self.weights).reshape(len(kernel), *self.mean.shape) + self.mean


def gaussian(
    a: Float64[np.ndarray, "N k"], b: Float64[np.ndarray, "M k"], width: float
) -> Float64[np.ndarray, "N M"]:
    square = (a**2).sum(1)[:, None] + (b**2).sum(1) - 2 * a @ b.T
    return np.exp(-np.maximum(square, 0) / (2 * width**2))


def fit_joints(
    images: Float[Tensor, "N 3 S S"], joints: Float64[np.ndarray, "N J 2"], partner: Int64[np.ndarray, " J"]
) -> RidgeEstimator:
    """The estimator that these labelled pictures and their mirror images give; the kernel is as wide as
    pictures are apart. `partner` names each joint's on the other side, see `avatargen.data.mirror`.
    """
    known = np.concatenate([edges(images), edges(images.flip(3))])
    joints = np.concatenate([joints, [1, 0] + [-1, 1] * joints[:, partner]])
    mean = joints.mean(axis=0)
    square = (known**2).sum(1)[:, None] + (known**2).sum(1) - 2 * known @ known.T
    width = float(np.sqrt(np.median(np.maximum(square, 0)))) or 1.0
    kernel = gaussian(known, known, width)
    target = (joints - mean).reshape(len(joints), -1)
    weights = np.linalg.solve(kernel + RIDGE * np.eye(len(kernel)), target)
    return RidgeEstimator(known=known, weights=weights, mean=mean, width=width)
