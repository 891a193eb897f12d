"""An avatar without a network, for stress: the default body, a little thicker, coloured by place; and bodies
with other numbers of joints."""

import functools
from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Float, Float32
from torch import Tensor

from assets.asset.asset import AssetInfo
from avatargen import __version__
from avatargen.avatar import shipped
from avatargen.body.distance import BodyDistance
from avatargen.body.load import load_body
from avatargen.body.model import Body, CanonicalBody, canonical_body

THICKNESS = 0.005  # metres


@dataclass(frozen=True, kw_only=True, eq=False)
class Figure:
    """What `assets.build` needs of an avatar."""

    body: CanonicalBody
    distance: BodyDistance
    betas: Float32[np.ndarray, " B"]
    info: AssetInfo
    bounds: Float[np.ndarray, "2 3"]

    def sdf(self, points: Float[Tensor, "N 3"]) -> Float[Tensor, " N"]:
        return torch.from_numpy(self.distance.query(points.numpy()).distance) - THICKNESS

    def color(self, points: Float[Tensor, "N 3"]) -> Float[Tensor, "N 3"]:
        return 0.5 + 0.3 * torch.sin(20 * points)


@functools.cache
def default_body() -> Body:
    return load_body(shipped("body.npz"))


@functools.cache
def default_figure() -> Figure:
    return figure(default_body())


def figure(body: Body, beta: float = 0.0) -> Figure:
    """A figure on a body, with all its betas at one value."""
    canonical = canonical_body(body)
    low, high = canonical.vertices.min(axis=0) - 0.05, canonical.vertices.max(axis=0) + 0.05
    return Figure(
        body=canonical,
        distance=canonical.distance,
        betas=np.full(body.shapedirs.shape[2], beta, dtype=np.float32),
        info=AssetInfo(seed=0, weights_hash="0" * 64, version=__version__, licence="CC0-1.0"),
        bounds=np.stack([low, high]),
    )


def with_joints(count: int) -> Body:
    """The default body on a chain of joints from the feet up, each moving what is near in height."""
    body = default_body()
    height = body.v_template[:, 1]
    place = (height - height.min()) / np.ptp(height) * (count - 1)
    lower = np.clip(np.floor(place).astype(np.int64), 0, max(count - 2, 0))
    share = np.clip(place - lower, 0, 1).astype(np.float32)
    weights = np.zeros((len(height), count), dtype=np.float32)
    rows = np.arange(len(height))
    weights[rows, lower] += 1 - share
    weights[rows, np.minimum(lower + 1, count - 1)] += share
    regressor = np.zeros((count, len(height)), dtype=np.float32)
    levels = np.linspace(height.min(), height.max(), count)
    nearest = np.abs(height[None] - levels[:, None]).argmin(axis=1)
    regressor[np.arange(count), nearest] = 1
    return replace(
        body,
        weights=weights,
        parents=np.arange(-1, count - 1),
        joint_names=tuple(f"joint_{i}" for i in range(count)),
        J_regressor=regressor,
        posedirs=None,
    )
