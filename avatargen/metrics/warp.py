"""Warp error: does a person look the same from two sides, and in two poses?

Every point of the first picture is carried to the second, and the colours are compared where the second
camera sees that point. From another side a point stays where it is (the paper's Warp, which any model with
depth can be asked); in another pose it goes where the body takes it.

Letters: r pixels a side, N points. Metres; colours 0..1.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float, Float64, Int64
from torch import Tensor
from torch.nn import functional as F

from avatargen.data.joints import project
from avatargen.generator.camera import Camera, rays
from avatargen.generator.canonical import CanonicalMap

SOLID = 0.9  # coverage of a pixel that counts
SAME_POINT = 0.04  # metres between a carried point and what the camera sees there
FEWEST = 12  # points for an error to mean something

Points = Float64[np.ndarray, "N 3"]


@dataclass(frozen=True, kw_only=True)
class Pair:
    """Two pictures of a person."""

    colors: Float[Tensor, "2 3 r r"]
    depth: Float[Tensor, "2 r r"]
    mask: Float[Tensor, "2 r r"]
    camera: Camera


def side_error(pair: Pair) -> float:
    """Mean absolute colour difference between two sides of a person who stands still; NaN where too few
    points are seen.

    A point counts unless it lies outside the second picture or on an outline there, or something stands
    before it: a surface that is elsewhere or gone when the camera moves is an error, too.
    """

    def seen(away: Tensor, far: Tensor, cover: Tensor) -> Tensor:
        return (cover < 1 - SOLID) | ((cover > SOLID) & (far > away - SAME_POINT))

    return warp_error(pair, lambda points: points, seen)


def pose_error(pair: Pair, maps: tuple[CanonicalMap, CanonicalMap]) -> float:
    """The same between two poses, whose bodies' maps are given. Bodies carry points not quite to where they
    are, so only those count that the second picture shows at about that depth."""

    def seen(away: Tensor, far: Tensor, cover: Tensor) -> Tensor:
        return (cover > SOLID) & ((far - away).abs() < SAME_POINT)

    return warp_error(pair, lambda points: carry(points, *maps), seen)


def warp_error(
    pair: Pair, move: Callable[[Points], Points], seen: Callable[[Tensor, Tensor, Tensor], Tensor]
) -> float:
    """Mean absolute colour difference between points of the first picture, moved, and the second picture.

    `seen` tells which count, from their distances to the second camera, the depth that it sees there, and
    how much somebody covers the place.
    """
    size = pair.colors.shape[-1]
    origin, direction = (part.double().cpu().numpy() for part in rays(pair.camera, size))
    solid = (pair.mask[0] > SOLID).flatten().cpu().numpy()
    far = pair.depth[0].flatten().double().cpu().numpy()
    moved = move((origin[0] + far[:, None] * direction[0])[solid])
    place = project(moved, pair.camera.vector[1].cpu().numpy())
    grid = torch.from_numpy(place * 2 - 1).float()[None, None].to(pair.colors)
    there = F.grid_sample(pair.colors[1:], grid, align_corners=False)[0, :, 0].T
    inside: Bool[Tensor, " N"] = (grid[0, 0].abs() < 1).all(dim=1)
    away = torch.from_numpy(np.linalg.norm(moved - origin[1, 0], axis=1)).to(pair.depth)
    counts = inside & seen(away, at(pair.depth[1], grid, "nearest"), at(pair.mask[1], grid, "bilinear"))
    if counts.sum() < FEWEST:
        return float("nan")
    here = pair.colors[0].flatten(1).T[torch.from_numpy(solid).to(pair.colors.device)]
    return float((here - there)[counts].abs().mean())


def at(values: Float[Tensor, "r r"], grid: Float[Tensor, "1 1 N 2"], mode: str) -> Float[Tensor, " N"]:
    """What stands at each place."""
    return F.grid_sample(values[None, None], grid, mode=mode, align_corners=False)[0, 0, 0]


def carry(points: Points, first: CanonicalMap, second: CanonicalMap) -> Points:
    """Points near the first posed body to where their nearest vertices are in the second."""
    index: Int64[np.ndarray, " N"] = first.tree.query(points)[1]
    into, out = first.T_canonical_posed[index].astype(np.float64), second.T_canonical_posed[index]
    canonical = np.einsum("nij,nj->ni", into[:, :, :3], points) + into[:, :, 3]
    return np.linalg.solve(out[:, :, :3].astype(np.float64), (canonical - out[:, :, 3])[..., None])[..., 0]
