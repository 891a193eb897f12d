"""The normal map: which way the field's surface faces at each texel, in the frame that a viewer builds there.

A viewer interpolates a vertex's normal n and tangent t, makes b = cross(n, t) * w, and reads the texel (x, y,
z) in -1..1 as the direction x t + y b + z n. So the texel is the inverse of that frame times the gradient of
the field. The gradient lives in the canonical space and the frame in the rest pose: between them a face's
plane is stretched and turned while its thickness stays, and what is normal to a surface goes by the inverse
transpose of that.

Letters: V welded vertices, W split ones, F faces, S texels along a side, N texels.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Float64, Int64, UInt8

from assets.errors import GeometryError
from assets.field import Field, ask
from assets.mesh.surface import Surface
from assets.skin.rest import RestMesh
from assets.texture.atlas import Atlas
from assets.texture.bake import BakeConfig, in_chunks, map_texels
from assets.texture.tangents import find_tangents

# metres from a texel's place to the four points whose values give the gradient: folds stay; the facets of a
# field that is linear between nodes a centimetre apart, or of the body's mesh, do not show
STEP = 4e-3
TETRAHEDRON = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / np.sqrt(3)
QUESTIONS = len(TETRAHEDRON)  # to the field, a texel
STEEPEST = 0.1  # least part of a texel's direction that points along the mesh's own normal
TINY = 1e-30


@dataclass(frozen=True, kw_only=True)
class NormalMap:
    """Texels, 128 128 255 where the mesh's own normal is right, and the tangents they are relative to."""

    texels: UInt8[np.ndarray, "S S 3"]
    tangents: Float32[np.ndarray, "W 4"]

    def __post_init__(self) -> None:
        length = np.linalg.norm(self.tangents[:, :3].astype(np.float64), axis=1)
        if not np.abs(length - 1).max(initial=0) < 1e-4 or (np.abs(self.tangents[:, 3]) != 1).any():
            raise GeometryError("normal map: tangents must have length 1, and w must be 1 or -1")


def bake_normals(
    surface: Surface, rest: RestMesh, atlas: Atlas, sdf: Field, config: BakeConfig | None = None
) -> NormalMap:
    """The normal map of `sdf` for a canonical surface that is seen in its rest pose.

    Raises:
        FieldError: the field is NaN or infinite.
    """
    config = config or BakeConfig()
    stretched = Surface(vertices=rest.vertices, faces=surface.faces)
    split = Surface(vertices=rest.vertices[atlas.vertex_map], faces=atlas.faces)
    tangents = find_tangents(split, rest.normals[atlas.vertex_map], atlas.uv.astype(np.float64))
    texel_map = map_texels(atlas, config.texture_size)

    def draw(texel: Int64[np.ndarray, " N"]) -> UInt8[np.ndarray, "N 3"]:
        face, share = texel_map.face[texel], texel_map.barycentric(texel)
        corners = surface.faces[face]
        places = np.einsum("nc,ncd->nd", share, surface.vertices[corners])
        facing = to_rest(surface, stretched, face, scaled_gradients(sdf, places))
        normal = np.einsum("nc,ncd->nd", share, rest.normals[corners])
        tangent = np.einsum("nc,ncd->nd", share, tangents[atlas.faces[face]].astype(np.float64))
        return np.rint(127.5 * (in_frame(facing, normal, tangent) + 1)).astype(np.uint8)

    # every texel: the facets of a trained field leave no block uniform
    texels = np.zeros((config.texture_size, config.texture_size, 3), dtype=np.uint8)
    texels.reshape(-1, 3)[texel_map.asked] = in_chunks(draw)(texel_map.asked)
    return NormalMap(texels=texel_map.spread(texels), tangents=tangents)


def scaled_gradients(sdf: Field, points: Float64[np.ndarray, "N 3"]) -> Float64[np.ndarray, "N 3"]:
    """The field's gradient times 4/3 of the step, from four values around each point."""
    places = points[:, None] + STEP * TETRAHEDRON
    return ask(sdf, places.reshape(-1, 3)).reshape(-1, QUESTIONS) @ TETRAHEDRON


def to_rest(
    surface: Surface, rest: Surface, face: Int64[np.ndarray, " N"], facing: Float64[np.ndarray, "N 3"]
) -> Float64[np.ndarray, "N 3"]:
    """Directions normal to what lies on the faces, carried to the rest pose; zero where a face has no area
    there.

    With the edges e of a face and its unit normal m they go to e' and m', so that products with them stay:
    g' = (g . e1) f1 + (g . e2) f2 + (g . m) m', where f is the dual basis of e' across m'.
    """
    (first, second), unit, _ = face_frames(surface, face)
    (across, along), unit_there, area = face_frames(rest, face)
    dual = np.cross(along, unit_there), np.cross(unit_there, across)
    parts = [np.einsum("nd,nd->n", facing, edge)[:, None] for edge in (first, second, unit)]
    flat = (parts[0] * dual[0] + parts[1] * dual[1]) / np.maximum(area, TINY)
    return np.where(area > TINY, flat + parts[2] * unit_there, 0.0)


def face_frames(
    surface: Surface, face: Int64[np.ndarray, " N"]
) -> tuple[tuple[np.ndarray, np.ndarray], Float64[np.ndarray, "N 3"], Float64[np.ndarray, "N 1"]]:
    """Two edges of each face, its unit normal and twice its area."""
    corners = surface.vertices[surface.faces[face]]
    edges = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(*edges)
    area = np.linalg.norm(normal, axis=1, keepdims=True)
    return edges, normal / np.maximum(area, TINY), area


def in_frame(
    facing: Float64[np.ndarray, "N 3"],
    normal: Float64[np.ndarray, "N 3"],
    tangent: Float64[np.ndarray, "N 4"],
) -> Float64[np.ndarray, "N 3"]:
    """Directions as a viewer's x t + y b + z n, of length 1; straight along n where there is none."""
    n, t = unit(normal), unit(tangent[:, :3])
    b = unit(np.cross(n, t)) * np.where(tangent[:, 3:] < 0, -1.0, 1.0)
    volume = np.einsum("nd,nd->n", np.cross(t, b), n)[:, None]
    dual = [np.cross(b, n), np.cross(n, t), np.cross(t, b)]
    parts = [np.einsum("nd,nd->n", facing, one)[:, None] for one in dual]
    found = unit(np.sign(volume) * np.concatenate(parts, axis=1))
    found[:, 2] = np.maximum(found[:, 2], STEEPEST)
    return unit(found)


def unit(vectors: Float64[np.ndarray, "N 3"]) -> Float64[np.ndarray, "N 3"]:
    """Vectors of length 1; zero where there is none."""
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), TINY)
