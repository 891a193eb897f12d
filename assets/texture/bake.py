"""The base colour texture: ask the field for the colour at each texel's place on the surface, but where
`assets.texture.coarse_to_fine` finds that its neighbours tell it.

Beyond the charts' edges the faces go on flat for as far as bilinear filtering reaches; the rest takes the
nearest texel's colour, so that neither filtering nor smaller copies of the texture bring in anything else.

Letters: F faces, W split vertices, S texels along a side, T all texels, N, M and K some of them. uv origin
and row 0 at the top left, as in glTF.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int64, UInt8

from assets.field import Field, ask
from assets.mesh.surface import Surface
from assets.texture.atlas import Atlas
from assets.texture.coarse_to_fine import AskTexels, ask_coarse_to_fine
from assets.texture.nearest_texel import nearest_texels
from assets.texture.raster import coordinates, rasterise
from avatargen.errors import InputError

# texels from a covered texel's centre to the farthest one that bilinear filtering mixes in
FILTER_REACH = 1.5
MOST_TEXELS = 1 << 21  # whose places and values are held at once


@dataclass(frozen=True, kw_only=True)
class BakeConfig:
    """The texture's size, texels along a side."""

    texture_size: int = 1024

    def __post_init__(self) -> None:
        if not 16 <= self.texture_size <= 16384:
            raise InputError(f"bake: a texture of {self.texture_size} texels; choose 16 to 16384")


@dataclass(frozen=True, kw_only=True)
class Texture:
    """sRGB texels and the share of them that faces cover."""

    texels: UInt8[np.ndarray, "S S 3"]
    coverage: float


@dataclass(frozen=True, kw_only=True)
class TexelMap:
    """Where a square texture's texels lie on the faces; a texel's number is row * size + column."""

    size: int
    triangles: Float64[np.ndarray, "F 3 2"]  # of the faces in the texture, in texels
    face: Int64[np.ndarray, " T"]  # over each texel, or the nearest one
    asked: Int64[np.ndarray, " N"]  # texels that filtering on a face can read
    beyond: Int64[np.ndarray, " M"]  # the others
    nearest: Int64[np.ndarray, " M"]  # for each of these the nearest texel under a face
    coverage: float  # share of texels under a face

    def wanted(self) -> Bool[np.ndarray, "S S"]:
        """Whether filtering on a face can read a texel."""
        wanted = np.zeros(self.size * self.size, dtype=bool)
        wanted[self.asked] = True
        return wanted.reshape(self.size, self.size)

    def barycentric(self, texel: Int64[np.ndarray, " K"]) -> Float64[np.ndarray, "K 3"]:
        """Places of texels on their faces' planes; never farther beyond a face than its own size."""
        centres = np.stack([texel % self.size, texel // self.size], axis=1) + 0.5
        # a face without area: its middle
        from_middle = np.nan_to_num(coordinates(self.triangles, self.face[texel], centres) - 1 / 3)
        return 1 / 3 + from_middle / np.maximum(np.abs(from_middle).max(axis=1, keepdims=True), 1)

    def points(self, surface: Surface, texel: Int64[np.ndarray, " K"]) -> Float64[np.ndarray, "K 3"]:
        """Where texels lie on the surface, metres."""
        corners = surface.vertices[surface.faces[self.face[texel]]]
        return np.einsum("kc,kcd->kd", self.barycentric(texel), corners)

    def spread(self, texels: UInt8[np.ndarray, "S S C"]) -> UInt8[np.ndarray, "S S C"]:
        """The texture, with the nearest texel's value beyond those asked for."""
        values = texels.reshape(self.size * self.size, -1)
        values[self.beyond] = values[self.nearest]
        return texels


def bake_texture(surface: Surface, atlas: Atlas, color: Field, config: BakeConfig) -> Texture:
    """The texture of `color` (points -> sRGB in 0..1) over the surface.

    Raises:
        FieldError: a colour is NaN or infinite.
    """
    texel_map = map_texels(atlas, config.texture_size)

    def paint(texel: Int64[np.ndarray, " K"]) -> UInt8[np.ndarray, "K 3"]:
        colours = np.clip(ask(color, texel_map.points(surface, texel), 3), 0, 1)
        return np.rint(255 * colours).astype(np.uint8)

    texels = ask_coarse_to_fine(in_chunks(paint), texel_map.wanted(), 3)
    return Texture(texels=texel_map.spread(texels), coverage=texel_map.coverage)


def in_chunks(ask_texels: AskTexels) -> AskTexels:
    """The same, asked in pieces of bounded size."""

    def ask_all(texel: Int64[np.ndarray, " K"]) -> UInt8[np.ndarray, "K C"]:
        pieces = np.array_split(texel, len(texel) // MOST_TEXELS + 1)
        return np.concatenate([ask_texels(piece) for piece in pieces])

    return ask_all


def map_texels(atlas: Atlas, size: int) -> TexelMap:
    """Which face each texel of a texture belongs to, and how far filtering reaches beyond the faces."""
    triangles = atlas.uv[atlas.faces].astype(np.float64) * size
    face = cover_texels(triangles, size)
    covered = face >= 0
    nearest, squared = (found.reshape(-1) for found in nearest_texels(covered))
    near = squared <= FILTER_REACH**2
    return TexelMap(
        size=size,
        triangles=triangles,
        face=face.reshape(-1)[nearest],
        asked=np.flatnonzero(near),
        beyond=np.flatnonzero(~near),
        nearest=nearest[~near],
        coverage=float(covered.mean()),
    )


def cover_texels(triangles: Float64[np.ndarray, "F 3 2"], size: int) -> Int64[np.ndarray, "S S"]:
    """The face of each texel, -1 for none: the one over its centre, or one that is too small to be over any
    centre."""
    face = np.full(size * size, -1, dtype=np.int64)
    for fragments in rasterise(triangles, size, size):
        face[fragments.pixel] = fragments.triangle
    for places in (triangles.mean(axis=1), *triangles.transpose(1, 0, 2)):
        texel = np.clip(np.floor(places), 0, size - 1).astype(np.int64) @ [1, size]
        empty = face[texel] < 0
        face[texel[empty]] = np.flatnonzero(empty)
    return face.reshape(size, size)
