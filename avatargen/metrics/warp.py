"""Warp error: does a person look the same in two poses?

Every point of the first picture is carried to where the body takes it in the second, and the colours are
compared where the second camera sees that point.

Letters: r pixels a side, N points. Metres; colours 0..1.
"""

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


def warp_error(
    colors: Float[Tensor, "2 3 r r"],
    depth: Float[Tensor, "2 r r"],
    mask: Float[Tensor, "2 r r"],
    camera: Camera,
    maps: tuple[CanonicalMap, CanonicalMap],
) -> float:
    """Mean absolute colour difference; NaN where too few points are seen in both pictures."""
    size = colors.shape[-1]
    origin, direction = (part.double().cpu().numpy() for part in rays(camera, size))
    solid = (mask[0] > SOLID).flatten().cpu().numpy()
    far = depth[0].flatten().double().cpu().numpy()
    points = (origin[0] + far[:, None] * direction[0])[solid]
    carried = carry(points, *maps)
    place = project(carried, camera.vector[1].cpu().numpy())
    grid = torch.from_numpy(place * 2 - 1).float()[None, None].to(colors)
    there = F.grid_sample(colors[1:], grid, align_corners=False)[0, :, 0].T
    seen = visible(carried, grid, depth[1:], mask[1:], origin[1, 0])
    if seen.sum() < FEWEST:
        return float("nan")
    here = colors[0].flatten(1).T[torch.from_numpy(solid).to(colors.device)]
    return float((here - there)[seen].abs().mean())


def carry(
    points: Float64[np.ndarray, "N 3"], first: CanonicalMap, second: CanonicalMap
) -> Float64[np.ndarray, "N 3"]:
    """Points near the first posed body to where their nearest vertices are in the second."""
    index: Int64[np.ndarray, " N"] = first.tree.query(points)[1]
    into, out = first.T_canonical_posed[index].astype(np.float64), second.T_canonical_posed[index]
    canonical = np.einsum("nij,nj->ni", into[:, :, :3], points) + into[:, :, 3]
    return np.linalg.solve(out[:, :, :3].astype(np.float64), (canonical - out[:, :, 3])[..., None])[..., 0]


def visible(
    points: Float64[np.ndarray, "N 3"],
    grid: Float[Tensor, "1 1 N 2"],
    depth: Float[Tensor, "1 r r"],
    mask: Float[Tensor, "1 r r"],
    eye: Float64[np.ndarray, "3"],
) -> Bool[Tensor, " N"]:
    """Which points the second camera sees: solid there, and no farther than what it sees there."""
    far = F.grid_sample(depth[None], grid, mode="nearest", align_corners=False)[0, 0, 0]
    solid = F.grid_sample(mask[None], grid, mode="nearest", align_corners=False)[0, 0, 0]
    away = torch.from_numpy(np.linalg.norm(points - eye, axis=1)).to(far)
    return (solid > SOLID) & ((far - away).abs() < SAME_POINT)
