"""The bare body's colours: a photographic skin by MakeHuman's texture coordinates, eyes, brows and lashes.

SkinPaint.color(points) -> sRGB of the skin nearest to each point
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float32, Float64, UInt8
from scipy.ndimage import gaussian_filter

from avatargen.body.distance import BodyHit
from avatargen.body.model import CanonicalBody
from avatargen.mesh.closest import ClosestPoints
from avatargen.wardrobe.bare import LASH, UNDERWEAR, underwear
from avatargen.wardrobe.hair_paint import HairPaint
from avatargen.wardrobe.lips import smooth
from avatargen.wardrobe.makehuman.hm08 import Hm08
from avatargen.wardrobe.makehuman.load import FittedGarment
from avatargen.wardrobe.makehuman.texture import texels

# MakeHuman's eye texture: where the left iris lies on it, how large it is; as shares of its side
IRIS_AT = (0.293, 0.701)
IRIS_SIZE = 0.115
BALL_SIZE = 0.27
IRIS_ON_BALL = 0.37  # of the eyeball's radius
BROW_REACH = 0.006  # m between a brow's card and the skin under it
LASH_REACH = 0.0016
LASH_SHARE = 0.5
SOFT = 5.0  # texels of MakeHuman's 512 that a brow's hairs are blurred by: ours are wider than a hair
RAISED = 0.004  # m that a brow's end at the nose is drawn higher than its card lies: on our faces it frowns
BETWEEN, OUT = 0.010, 0.035  # m from the middle of the face, where that is in full and where it ends
BROWN = np.array([0.85, 0.52, 0.30])


@dataclass(frozen=True, kw_only=True, eq=False)
class SkinPaint:
    """One person's skin, eyes, brows and lashes."""

    hm08: Hm08
    body: CanonicalBody
    skin: UInt8[np.ndarray, "H W C"]
    iris: UInt8[np.ndarray, "h w c"]
    brows: FittedGarment | None
    lashes: FittedGarment | None
    brow_colour: Float64[np.ndarray, "3"]
    chest_covered: bool  # underwear is always on: briefs, and this adds a top
    hair: HairPaint | None = None  # on scalp and chin

    def relief(self, points: Float32[np.ndarray, "N 3"]) -> Float64[np.ndarray, " N"]:
        return np.zeros(len(points)) if self.hair is None else self.hair.relief(points)

    @cached_property
    def corners(self) -> Float64[np.ndarray, "F 3 2"]:
        """Texture coordinates of the body's face corners; those on the eyes take a lid's beside them."""
        rows = self.hm08.uv_corners.copy()
        eye = self.hm08.hm08_of_body[self.body.faces] < 0
        for column in range(3):
            lid = np.where(~eye[:, (column + 1) % 3], (column + 1) % 3, (column + 2) % 3)
            missing = eye[:, column] & ~eye.all(axis=1)
            rows[missing, column] = rows[missing, lid[missing]]
        return self.hm08.uv[rows] * (1, -1) + (0, 1)

    @cached_property
    def on_eye(self) -> Float64[np.ndarray, " W"]:
        """1 at the body's vertices on the eyes."""
        return (self.hm08.hm08_of_body < 0).astype(np.float64)

    def color(self, points: Float32[np.ndarray, "N 3"], hit: BodyHit) -> Float64[np.ndarray, "N 3"]:
        """sRGB at points whose closest point on the body is given."""
        uv = np.einsum("nk,nka->na", hit.barycentric, self.corners[hit.face])
        colour = texels(self.skin, uv)[:, :3]
        foot = np.einsum("nk,nka->na", hit.barycentric, self.body.vertices[self.body.faces[hit.face]]).astype(
            np.float64
        )
        colour += (UNDERWEAR - colour) * underwear(self.body, foot, self.chest_covered)[:, None]
        if self.hair is not None:
            colour = self.hair.painted(colour, foot)
        eye = (self.on_eye[self.body.faces[hit.face]] * hit.barycentric).sum(axis=1)
        face = np.flatnonzero((foot[:, 1] > self.hm08.eyes[0, 1] - 0.06) & (foot[:, 2] > 0.05))
        colour[face] = self.paint_brows(colour[face], foot[face])
        seen = np.flatnonzero(eye > 0.3)
        white = self.eye_color(foot[seen]) * (0.5 + 0.38 * smooth(eye[seen], 0.55, 1.0))[:, None]
        share = smooth(eye[seen], 0.4, 0.6)[:, None]
        colour[seen] = colour[seen] * (1 - share) + white * share
        colour[face] = self.paint_lashes(colour[face], foot[face])
        return colour.clip(0, 1)

    def eye_color(self, foot: Float64[np.ndarray, "N 3"]) -> Float64[np.ndarray, "N 3"]:
        """Iris, pupil and white of the nearer eye, looking ahead."""
        side = (foot[:, 0] < 0).astype(np.int64)
        centre, radius = self.hm08.eyes[side, :3], self.hm08.eyes[side, 3:]
        off = (foot - centre)[:, :2] / radius
        off[:, 0] *= np.where(side == 0, 1, -1)
        out = np.linalg.norm(off, axis=1, keepdims=True)
        scale = np.minimum(IRIS_SIZE / IRIS_ON_BALL, BALL_SIZE / np.maximum(out, 1e-6))
        uv = np.array(IRIS_AT) + off * (1, -1) * scale
        colour = texels(self.iris, uv)[:, :3]
        red = np.clip(
            (colour[:, :1] - 1.6 * colour[:, 1:2]) / 0.1, 0, 1
        )  # no iris is as red as the brown one
        return colour + (colour[:, :1] * BROWN - colour) * red

    def paint_brows(
        self, colour: Float64[np.ndarray, "N 3"], foot: Float64[np.ndarray, "N 3"]
    ) -> Float64[np.ndarray, "N 3"]:
        """Hair drawn on the skin under a brow's card."""
        if self.brows is None or len(foot) == 0:
            return colour
        lower = foot.copy()
        lower[:, 1] -= RAISED * (1 - smooth(np.abs(foot[:, 0]), BETWEEN, OUT))
        alpha, distance = card_alpha(self.brows, self.brow_alpha, self.brow_tree, lower)
        share = (0.9 * np.minimum(1.8 * alpha, 1) * (1 - smooth(distance, 0.6 * BROW_REACH, BROW_REACH)))[
            :, None
        ]
        return colour * (1 - share) + self.brow_colour * share

    def paint_lashes(
        self, colour: Float64[np.ndarray, "N 3"], foot: Float64[np.ndarray, "N 3"]
    ) -> Float64[np.ndarray, "N 3"]:
        """Lashes darken lids and eyes along their roots."""
        if self.lashes is None or len(foot) == 0:
            return colour
        alpha, distance = card_alpha(self.lashes, self.lash_alpha, self.lash_tree, foot)
        share = (LASH_SHARE * np.sqrt(alpha) * (1 - smooth(distance, 0.3 * LASH_REACH, LASH_REACH)))[:, None]
        return colour * (1 - share) + LASH * share

    @cached_property
    def brow_alpha(self) -> UInt8[np.ndarray, "H W 1"]:
        return soften(self.brows)

    @cached_property
    def lash_alpha(self) -> UInt8[np.ndarray, "H W 1"]:
        return soften(self.lashes)

    @cached_property
    def brow_tree(self) -> ClosestPoints | None:
        return tree_of(self.brows)

    @cached_property
    def lash_tree(self) -> ClosestPoints | None:
        return tree_of(self.lashes)


def tree_of(card: FittedGarment | None) -> ClosestPoints | None:
    """Closest points of a card."""
    return None if card is None else ClosestPoints(card.vertices.astype(np.float64), card.faces)


def soften(card: FittedGarment | None) -> UInt8[np.ndarray, "H W 1"]:
    """A card's alpha, blurred."""
    if card is None:
        return np.zeros((1, 1, 1), dtype=np.uint8)
    width = SOFT * card.texture.shape[1] / 512
    return gaussian_filter(card.texture[..., 3].astype(np.float32), width)[..., None].astype(np.uint8)


def card_alpha(
    card: FittedGarment,
    soft_alpha: UInt8[np.ndarray, "H W 1"],
    tree: ClosestPoints | None,
    points: Float64[np.ndarray, "N 3"],
) -> tuple[Float64[np.ndarray, " N"], Float64[np.ndarray, " N"]]:
    """Alpha of the card's texel nearest to each point, and how far that is, m."""
    assert tree is not None
    squared, face, barycentric = tree.query(np.ascontiguousarray(points))
    uv = np.einsum("nk,nka->na", barycentric, card.uv[face])
    return texels(soft_alpha, uv)[:, 0], np.sqrt(squared)
