"""Hair as a closed volume: cards with an alpha texture, filled down to the scalp.

What is opaque of the cards is sampled. The samples fill a grid, with all that lies between them and the skin
beneath, so that a hairline is where the cards' alpha ends; a morphological closing joins strands with each
other, and the grid's signed distance is smoothed a little. The head's inside is hair, too, but bare skin is
well off it. Colour comes from the nearest samples, as a shade: how bright a strand is beside the mean of all.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float32, Float64
from scipy.ndimage import (
    binary_fill_holes,
    distance_transform_edt,
    gaussian_filter,
    label,
    map_coordinates,
)
from scipy.spatial import KDTree

from avatargen.body.distance import BodyDistance
from avatargen.wardrobe.makehuman.load import FittedGarment
from avatargen.wardrobe.makehuman.texture import sample_surface, texels

CELL = 0.0025  # m
SPACING = 0.0012  # m between samples
OPAQUE = 0.4  # alpha from which a card counts
BRIDGE = 0.006  # m: gaps up to twice this are closed
ROOTED = 0.025  # m over the skin up to which hair is filled down to it
OVER_FACE = 0.07  # m, the same over a face and what is beside it, where hair is cut open later
FACE_Y, FACE_Z = 0.59, 0.0  # m: they are above this and before this
WIDE = 0.018  # m: pits in the hair on the head up to twice this are filled
HEAD_Y, ON_HEAD = 0.66, 0.035  # m: from where on that is so, and up to how far over the skin
SHEET = 0.014  # m that hair farther off is thick at least: meshes tear what is thinner
ROOTS = 0.008  # m under the skin that it is filled to
CORE = 0.006  # m under the skin from which the head counts as hair's inside
NEAR = 0.024  # m from the cards that anything is hair
MARGIN = 0.016  # m around the cards
SOFT = 1.5  # cells, of the smoothing
STRANDS = 16  # samples whose shades are averaged


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
        hair = np.zeros(1 + np.ceil((high - low) / CELL).astype(int), dtype=bool)
        hair[tuple(np.round((points - low) / CELL).astype(int).T)] = True
        depth = -self.over_skin(low, hair.shape)
        rooted = hair.copy()
        down = np.round((self.roots() - low) / CELL).astype(int)
        rooted[tuple(down[((down >= 0) & (down < hair.shape)).all(axis=1)].T)] = True
        closed = closing(rooted, BRIDGE)
        enclosed = np.asarray(binary_fill_holes(closed | (depth > 0))) & (depth <= 0)
        whole = closed | enclosed | (depth > CORE)
        head = np.s_[:, max(int((HEAD_Y - low[1]) / CELL), 0) :]
        whole[head] |= closing(whole[head], WIDE) & (np.abs(depth[head] + 0.5 * ON_HEAD) < 0.5 * ON_HEAD)
        return low, signed(largest(whole & (CELL * cells_to(rooted) <= NEAR)))

    def over_skin(
        self, low: Float64[np.ndarray, "3"], shape: tuple[int, ...]
    ) -> Float32[np.ndarray, "X Y Z"]:
        """Metres over the skin at the grid's points, between every other one of them."""
        axes = [low[i] + 2 * CELL * np.arange(shape[i] // 2 + 2) for i in range(3)]
        corners = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
        coarse = self.body.query(corners.reshape(-1, 3).astype(np.float32)).distance
        coarse = coarse.reshape(corners.shape[:3])
        for axis in range(3):
            doubled = np.repeat(coarse, 2, axis=axis)
            between = np.s_[(slice(None),) * axis + (slice(1, -1, 2),)]
            after = np.s_[(slice(None),) * axis + (slice(2, None, 2),)]
            doubled[between] = 0.5 * (doubled[between] + doubled[after])
            coarse = doubled
        return coarse[: shape[0], : shape[1], : shape[2]]

    def roots(self) -> Float64[np.ndarray, "R 3"]:
        """Points from the samples straight down to the skin and a little further; where that is far, down a
        sheet's thickness."""
        points, _ = self.samples
        _, first = np.unique(np.round(points / CELL).astype(np.int64), axis=0, return_index=True)
        hit = self.body.query(points[first].astype(np.float32))
        corners = self.body.corners[hit.face]
        foot = np.einsum("nk,nka->na", hit.barycentric.astype(np.float64), corners)
        up = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        far = np.abs(hit.distance) > 0.5 * CELL  # nearer by, the way to the skin has no direction
        up[far] = ((points[first] - foot) * np.sign(hit.distance)[:, None])[far]
        up /= np.maximum(np.linalg.norm(up, axis=1, keepdims=True), 1e-12)
        steps = np.arange(-ROOTS, max(OVER_FACE, float(hit.distance.max())), 0.5 * CELL)
        reach = np.where((foot[:, 1] > FACE_Y) & (foot[:, 2] > FACE_Z), OVER_FACE, ROOTED)
        down_to = np.where(hit.distance < reach, -ROOTS, hit.distance - SHEET)
        beneath = (steps < hit.distance[:, None]) & (steps >= down_to[:, None])
        row, step = np.nonzero(beneath)
        return foot[row] + steps[step, None] * up[row]

    def least(self, points: Float32[np.ndarray, "N 3"]) -> Float32[np.ndarray, " N"]:
        """Metres that the hair is away from each point at least: to a box around it."""
        low, high = self.samples[0].min(axis=0), self.samples[0].max(axis=0)
        off = np.linalg.norm(points - np.clip(points, low, high), axis=1)
        return (off - BRIDGE).clip(0).astype(np.float32)

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


def largest(filled: Bool[np.ndarray, "X Y Z"]) -> Bool[np.ndarray, "X Y Z"]:
    """The largest of the pieces that hang together."""
    pieces = np.empty(filled.shape, np.int32)
    count = int(label(filled, output=pieces))  # pyright: ignore[reportArgumentType]
    return pieces == 1 + np.bincount(pieces.ravel())[1:].argmax() if count > 1 else filled


def closing(filled: Bool[np.ndarray, "X Y Z"], reach: float) -> Bool[np.ndarray, "X Y Z"]:
    """The morphological closing by a ball of `reach` metres."""
    radius = reach / CELL
    pad = int(radius) + 2
    swollen = cells_to(np.pad(filled, pad)) <= radius
    closed = cells_to(~swollen) > radius
    return closed[pad:-pad, pad:-pad, pad:-pad] | filled


def signed(filled: Bool[np.ndarray, "X Y Z"]) -> Float32[np.ndarray, "X Y Z"]:
    """Signed distance to a filled grid, m, smoothed; half a cell further out, which smoothing takes back."""
    outside, inside = cells_to(filled), cells_to(~filled)
    distance = np.where(filled, 0.5 - inside, outside - 0.5) - 0.5
    return (CELL * gaussian_filter(distance, SOFT)).astype(np.float32)
