"""Hair as a closed volume: cards with an alpha texture, filled down to the scalp.

What is opaque of the cards is sampled, the samples fill a grid, a morphological closing joins them with each
other and with the head, and the grid's signed distance is smoothed a little. Colour comes from the nearest
samples, as a shade: how bright a strand is beside the mean of all.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float32, Float64
from scipy.ndimage import binary_fill_holes, distance_transform_edt, gaussian_filter, map_coordinates
from scipy.spatial import KDTree

from avatargen.body.distance import BodyDistance
from avatargen.wardrobe.makehuman.load import FittedGarment
from avatargen.wardrobe.makehuman.texture import sample_surface, texels

CELL = 0.002  # m
SPACING = 0.0012  # m between samples
OPAQUE = 0.4  # alpha from which a card counts
BRIDGE = 0.006  # m: gaps up to twice this are closed
MARGIN = 0.016  # m around the cards
SOFT = 0.8  # cells, of the smoothing
STRANDS = 8  # samples whose shades are averaged


@dataclass(frozen=True, kw_only=True, eq=False)
class Strands:
    """One hair style on the canonical body."""

    garment: FittedGarment
    body: BodyDistance

    @cached_property
    def samples(self) -> tuple[Float64[np.ndarray, "S 3"], Float64[np.ndarray, " S"]]:
        """Points on what is opaque of the cards, and their shades: 1 on average."""
        points, uv = sample_surface(self.garment.vertices, self.garment.faces, self.garment.uv, SPACING)
        colour = texels(self.garment.texture, uv)
        kept = colour[:, 3] > OPAQUE
        bright = colour[kept, :3] @ (0.3, 0.59, 0.11) + 0.02
        return points[kept], bright / bright.mean()

    @cached_property
    def tree(self) -> KDTree:
        return KDTree(self.samples[0])

    @cached_property
    def grid(self) -> tuple[Float64[np.ndarray, "3"], Float32[np.ndarray, "X Y Z"]]:
        """The lowest corner, m, and signed distances at the grid's points, m."""
        points, _ = self.samples
        low, high = points.min(axis=0) - MARGIN, points.max(axis=0) + MARGIN
        axes = [np.arange(low[i], high[i] + CELL, CELL) for i in range(3)]
        corners = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
        hair = np.zeros(corners.shape[:3], dtype=bool)
        hair[tuple(np.round((points - low) / CELL).astype(int).T)] = True
        inside = self.body.query(corners.reshape(-1, 3).astype(np.float32)).distance < 0
        whole = closing(hair | inside.reshape(hair.shape), hair)
        return low, signed(whole)

    def distance(self, points: Float32[np.ndarray, "N 3"]) -> Float32[np.ndarray, " N"]:
        """Signed distance to the hair's volume, which fills the head behind it too, m."""
        low, values = self.grid
        at = (np.asarray(points, dtype=np.float64) - low) / CELL
        within = np.clip(at, 0, np.array(values.shape) - 1.001)
        found = map_coordinates(values, within.T, order=1, mode="nearest")
        return (found + CELL * np.linalg.norm(at - within, axis=1)).astype(np.float32)

    def shade(self, points: Float32[np.ndarray, "N 3"]) -> Float32[np.ndarray, " N"]:
        """How bright the strands nearest to each point are, 1 on average."""
        _, shades = self.samples
        distance, index = self.tree.query(points, k=STRANDS)
        weight = 1 / (np.asarray(distance) + 5e-4)
        return ((weight * shades[index]).sum(axis=1) / weight.sum(axis=1)).astype(np.float32)


def cells_to(filled: Bool[np.ndarray, "X Y Z"]) -> Float64[np.ndarray, "X Y Z"]:
    """How far it is from each cell to the next filled one, in cells."""
    return np.asarray(distance_transform_edt(~filled))


def closing(filled: Bool[np.ndarray, "X Y Z"], hair: Bool[np.ndarray, "X Y Z"]) -> Bool[np.ndarray, "X Y Z"]:
    """The morphological closing by a ball of BRIDGE, and what it encloses, where that is near hair."""
    radius = BRIDGE / CELL
    pad = int(radius) + 2
    wide = np.pad(filled, pad)
    swollen = cells_to(wide) <= radius
    closed = cells_to(~swollen) > radius
    closed = np.asarray(binary_fill_holes(closed[pad:-pad, pad:-pad, pad:-pad] | filled))
    return closed & (cells_to(hair) <= 4 * radius)


def signed(filled: Bool[np.ndarray, "X Y Z"]) -> Float32[np.ndarray, "X Y Z"]:
    """Signed distance to a filled grid, m, smoothed; half a cell further out, which smoothing takes back."""
    outside, inside = cells_to(filled), cells_to(~filled)
    distance = np.where(filled, 0.5 - inside, outside - 0.5) - 0.5
    return (CELL * gaussian_filter(distance, SOFT)).astype(np.float32)
