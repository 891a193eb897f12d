"""Where joints are in a picture: the truth of a label, and a built-in estimate from the picture alone.

The estimate is kernel ridge regression from the picture's darkness against white, at 24 x 24 pixels, to the
joints' places: fitted in closed form on labelled pictures in a second. It is coarse; its own error on real
pictures is the floor that a generator's pose error is read against. Any other estimator can take its place.

Letters: N pictures, J joints, S pixels a side. Places are in widths of the picture, 0..1 from the top left.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float64
from torch import Tensor
from torch.nn import functional as F

from avatargen.body.model import Body
from avatargen.data.dataset import Pictures
from avatargen.data.joints import projected_joints

JointEstimator = Callable[[Float[Tensor, "N 3 S S"]], Float64[np.ndarray, "N J 2"]]

GRID = 24
RIDGE = 1e-2


def true_joints(pictures: Pictures, body: Body, indices: np.ndarray) -> Float64[np.ndarray, "N J 2"]:
    """Projections of the labels' joints."""
    labels = pictures.labels
    return np.stack(
        [projected_joints(body, labels.camera[i], labels.pose[i], labels.betas[i]) for i in indices]
    )


def darkness(images: Float[Tensor, "N 3 S S"]) -> Float64[np.ndarray, "N k"]:
    """How far pictures are from white, small and softened."""
    dark = (1 - images).clamp(0, 1).amax(dim=1, keepdim=True)
    small = F.interpolate(dark.sqrt(), size=(GRID, GRID), mode="area")
    return small.flatten(1).double().cpu().numpy()


@dataclass(frozen=True, kw_only=True, eq=False)
class RidgeEstimator:
    """Kernel ridge regression with a Gaussian kernel."""

    known: Float64[np.ndarray, "N k"]
    weights: Float64[np.ndarray, "N m"]
    mean: Float64[np.ndarray, "J 2"]
    width: float

    def __call__(self, images: Float[Tensor, "N 3 S S"]) -> Float64[np.ndarray, "N J 2"]:
        kernel = gaussian(darkness(images), self.known, self.width)
        return (kernel @ self.weights).reshape(len(kernel), *self.mean.shape) + self.mean


def gaussian(
    a: Float64[np.ndarray, "N k"], b: Float64[np.ndarray, "M k"], width: float
) -> Float64[np.ndarray, "N M"]:
    square = (a**2).sum(1)[:, None] + (b**2).sum(1) - 2 * a @ b.T
    return np.exp(-np.maximum(square, 0) / (2 * width**2))


def fit_joints(images: Float[Tensor, "N 3 S S"], joints: Float64[np.ndarray, "N J 2"]) -> RidgeEstimator:
    """The estimator that these labelled pictures give; the kernel is as wide as pictures are apart."""
    known, mean = darkness(images), joints.mean(axis=0)
    square = (known**2).sum(1)[:, None] + (known**2).sum(1) - 2 * known @ known.T
    width = float(np.sqrt(np.median(np.maximum(square, 0)))) or 1.0
    kernel = gaussian(known, known, width)
    target = (joints - mean).reshape(len(joints), -1)
    weights = np.linalg.solve(kernel + RIDGE * np.eye(len(kernel)), target)
    return RidgeEstimator(known=known, weights=weights, mean=mean, width=width)
