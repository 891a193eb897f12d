"""The bare body's colours: a photographic skin and eyes by MakeHuman's texture coordinates, and the face.

SkinPaint.color(points) -> sRGB of the skin nearest to each point
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float32, Float64, UInt8

from avatargen.body.distance import BodyHit
from avatargen.body.model import CanonicalBody
from avatargen.wardrobe.bare import UNDERWEAR, underwear
from avatargen.wardrobe.face_paint import IRIS_EDGE, FaceLines, paint_face
from avatargen.wardrobe.hair_paint import HairPaint
from avatargen.wardrobe.makehuman.hm08 import Hm08
from avatargen.wardrobe.makehuman.texture import texels

# MakeHuman's eye texture: where the left iris lies on it, how large it is; as shares of its side
IRIS_AT = (0.293, 0.701)
IRIS_SIZE = 0.115
BALL_SIZE = 0.27
BROWN = np.array([0.85, 0.52, 0.30])


@dataclass(frozen=True, kw_only=True, eq=False)
class SkinPaint:
    """One person's skin and face."""

    hm08: Hm08
    body: CanonicalBody
    skin: UInt8[np.ndarray, "H W C"]
    iris: UInt8[np.ndarray, "h w c"]
    lines: FaceLines
    hair_colour: tuple[float, float, float]
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
        on_eye = (self.on_eye[self.body.faces[hit.face]] * hit.barycentric).sum(axis=1)
        eyes, lines = self.hm08.eyes, self.lines
        return paint_face(colour, foot, on_eye, eyes, lines, self.hair_colour, self.own_iris).clip(0, 1)

    def own_iris(self, off: Float64[np.ndarray, "N 2"]) -> Float64[np.ndarray, "N 3"]:
        """Iris, pupil and white of the left eye seen from the front, in radii from its middle."""
        out = np.linalg.norm(off, axis=1, keepdims=True)
        scale = np.minimum(IRIS_SIZE / IRIS_EDGE, BALL_SIZE / np.maximum(out, 1e-6))
        colour = texels(self.iris, np.array(IRIS_AT) + off * (1, -1) * scale)[:, :3]
        # no iris is as red as the brown one
        red = np.clip((colour[:, :1] - 1.6 * colour[:, 1:2]) / 0.1, 0, 1)
        return colour + (colour[:, :1] * BROWN - colour) * red
