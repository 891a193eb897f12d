"""Ambient occlusion: how open the surface is to light from all around at each texel, from distances alone.

Along the normal n of an open place p the distance to the surface grows as fast as the height: d(p + h n) = h.
What comes near from the side makes it grow less. Distance field occlusion (Evans 2006, "Fast approximations
for global illumination on dynamic scenes") adds up what is missing, h - d, with weights that halve as the
heights double; so each height's share counts alike:

    openness = 1 - STRENGTH * mean_i clamp(h_i - d_i, 0, h_i) / h_i

It is baked in the canonical pose, arms and legs apart: what limbs darken in a rest pose would move along with
them. Letters: V vertices, F faces, S texels along a side, N texels.
"""

import numpy as np
import torch
from jaxtyping import Float64, Int64, UInt8

from assets.field import Field, ask
from assets.mesh.surface import Surface, vertex_normals
from assets.texture.atlas import Atlas
from assets.texture.bake import BakeConfig, in_chunks, map_texels
from assets.texture.coarse_to_fine import ask_coarse_to_fine
from assets.texture.normal_map import unit
from avatargen.body.distance import BodyDistance

HEIGHTS = (0.01, 0.02, 0.04, 0.08, 0.16)  # metres above the surface
STRENGTH = 1.0  # light cast onto the mesh from all around gives .9 to 1.1
QUESTIONS = 1 + len(HEIGHTS)  # a texel


def distance_to(surface: Surface) -> Field:
    """The exact signed distance to a closed surface, metres.

    A trained field is right near its surface alone: some centimetres off, it dips where nothing is, and that
    would darken open places.
    """
    tree = BodyDistance(surface.vertices, surface.faces)
    return lambda points: torch.from_numpy(tree.query(points.numpy()).distance)


def bake_occlusion(
    surface: Surface, atlas: Atlas, sdf: Field, config: BakeConfig | None = None
) -> UInt8[np.ndarray, "S S"]:
    """The openness of a canonical surface among the distances `sdf`: 255 where nothing is near, 0 where no
    light comes.

    Raises:
        FieldError: the field is NaN or infinite.
    """
    config = config or BakeConfig()
    texel_map = map_texels(atlas, config.texture_size)
    normals = vertex_normals(surface)

    def shade(texel: Int64[np.ndarray, " N"]) -> UInt8[np.ndarray, "N 1"]:
        corners, share = surface.faces[texel_map.face[texel]], texel_map.barycentric(texel)
        places = np.einsum("nc,ncd->nd", share, surface.vertices[corners])
        facing = unit(np.einsum("nc,ncd->nd", share, normals[corners]))
        return np.rint(255 * openness(sdf, places, facing)).astype(np.uint8)[:, None]

    texels = ask_coarse_to_fine(in_chunks(shade), texel_map.wanted(), 1)
    return texel_map.spread(texels)[..., 0]


def openness(
    sdf: Field, points: Float64[np.ndarray, "N 3"], normals: Float64[np.ndarray, "N 3"]
) -> Float64[np.ndarray, " N"]:
    """Share of the light from all around that reaches points of a surface (metres) with unit normals, 0 to 1.

    Distances are counted from the points' own, so that a mesh a little off the field is not shaded by that.
    Raises FieldError where the field is NaN or infinite.
    """
    start = ask(sdf, points)
    missing = np.zeros(len(points))
    for height in HEIGHTS:
        growth = ask(sdf, points + height * normals) - start
        missing += np.clip(1 - growth / height, 0, 1)
    return np.clip(1 - STRENGTH * missing / len(HEIGHTS), 0, 1)
