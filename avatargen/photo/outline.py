"""Bringing the outline of a dressed figure onto that of the person in a photograph.

Where the figure stands now, its outline is drawn; each of its points and the nearest point of the person's
outline that faces the same way should be at one place, both ways (iterated closest points). The pairs hold
for some steps; then the outline is drawn anew.

Letters: V points of the figure, F its faces, P pairs, E points of an outline.
"""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float, Float64, Int64
from scipy.ndimage import binary_erosion, gaussian_filter
from scipy.spatial import KDTree
from torch import Tensor

from avatargen.photo.camera import Pinhole
from avatargen.photo.figure import Cloud, tensor
from avatargen.photo.raster import look_at

TALL = 240  # pixels of a person in the pictures whose outlines are compared
MOST = 320  # pairs each way
FARTHEST = 0.07  # of the person's height: farther apart are other parts of the outline
ALIKE = 0.4  # cosine of the directions that outlines face
SOFT = 2.0  # pixels over which a direction is taken


@dataclass(frozen=True, kw_only=True, eq=False)
class Clothes:
    """A dressed figure's surface, which moves with the body."""

    cloud: Cloud
    faces: Int64[np.ndarray, "F 3"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Pairs:
    """Points of a figure and where in the picture they should be, pixels."""

    cloud: Cloud
    places: Float[Tensor, "P 2"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Edge:
    """An outline: pixels, and the directions out of it."""

    pixels: Int64[np.ndarray, "E 2"]  # column and row
    outward: Float64[np.ndarray, "E 2"]


class Outline:
    """The person's outline in a photograph of some size, looked at in a smaller one."""

    def __init__(self, mask: Float[np.ndarray, "H W"], camera: Pinhole) -> None:
        rows = np.flatnonzero((mask > 0.5).any(axis=1))
        self.tall = max(len(rows), 1)
        self.share = min(TALL / self.tall, 1.0)
        self.camera = camera.resized(self.share)
        row = np.clip(((np.arange(self.camera.height) + 0.5) / self.share).astype(int), 0, len(mask) - 1)
        column = np.clip(
            ((np.arange(self.camera.width) + 0.5) / self.share).astype(int), 0, mask.shape[1] - 1
        )
        soft = gaussian_filter(mask, 0.4 / self.share) if self.share < 0.7 else mask
        self.edge = edge_of(soft[np.ix_(row, column)] > 0.5)
        self.tree = KDTree(self.edge.pixels) if len(self.edge.pixels) else None

    def pairs(self, vertices: Float64[np.ndarray, "V 3"], clothes: Clothes) -> Pairs | None:
        """What of the figure, as it stands in the camera's space, should be where. None where its outline and
        the person's have nothing to do with each other."""
        seen = look_at(vertices, clothes.faces, self.camera)
        ours = edge_of(seen.mask)
        if self.tree is None or not len(ours.pixels):
            return None
        here, there = matched(ours, self.edge, self.tree, FARTHEST * self.tall * self.share)
        other, same = matched(self.edge, ours, KDTree(ours.pixels), FARTHEST * self.tall * self.share)
        rows, targets = np.concatenate([here, same]), np.concatenate([there, other])
        if not len(rows):
            return None
        x, y = ours.pixels[rows].T
        face, barycentric = seen.face[y, x], seen.barycentric[y, x]
        places = (self.edge.pixels[targets] + 0.5) / self.share
        return Pairs(cloud=on_faces(clothes, face, barycentric), places=tensor(places))


def edge_of(mask: Bool[np.ndarray, "H W"]) -> Edge:
    """The outermost pixels of a mask, but for those at the picture's rim."""
    inner = np.asarray(binary_erosion(mask, border_value=1), dtype=bool)
    row, column = np.nonzero(mask & ~inner)
    soft = np.asarray(gaussian_filter(mask.astype(np.float64), SOFT))
    down, right = np.gradient(soft, axis=0), np.gradient(soft, axis=1)
    outward = -np.stack([right[row, column], down[row, column]], axis=1)
    outward /= np.maximum(np.linalg.norm(outward, axis=1, keepdims=True), 1e-9)
    return Edge(pixels=np.stack([column, row], axis=1), outward=outward)


def matched(one: Edge, other: Edge, tree: KDTree, farthest: float) -> tuple[np.ndarray, np.ndarray]:
    """Rows of an outline, spread along it, and of their nearest in another that face the same way."""
    rows = np.arange(0, len(one.pixels), max(len(one.pixels) // MOST, 1))
    count = min(8, len(other.pixels))
    apart, near = tree.query(one.pixels[rows], k=count, distance_upper_bound=farthest)
    apart, near = apart.reshape(len(rows), -1), near.reshape(len(rows), -1)
    known = np.minimum(near, len(other.pixels) - 1)
    alike = np.einsum("nd,nkd->nk", one.outward[rows], other.outward[known]) > ALIKE
    fits = np.isfinite(apart) & alike
    first = fits.argmax(axis=1)
    found = fits.any(axis=1)
    return rows[found], near[np.arange(len(rows)), first][found]


def on_faces(
    clothes: Clothes, face: Int64[np.ndarray, " P"], barycentric: Float64[np.ndarray, "P 3"]
) -> Cloud:
    """Points of the surface."""
    corners, shares = torch.from_numpy(clothes.faces[face]), tensor(barycentric)
    cloud = clothes.cloud
    return Cloud(
        points=torch.einsum("pk,pkd->pd", shares, cloud.points[corners]),
        directions=torch.einsum("pk,pkdb->pdb", shares, cloud.directions[corners]),
        weights=torch.einsum("pk,pkj->pj", shares, cloud.weights[corners]),
    )
