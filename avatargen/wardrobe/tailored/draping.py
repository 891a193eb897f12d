"""Draping: cloth pulls itself taut and stays off the skin by its ease.

Rounds of averaging along the cloth, as a membrane does, each followed by moving what came too near the body
outward: so cloth lies at its ease on what bulges and spans what is hollow. Edges are averaged along
themselves.

Letters: V vertices, F faces. Metres.
"""

from dataclasses import replace
from functools import cache

import igl
import numpy as np
from jaxtyping import Float64, Int64
from scipy.sparse import csr_matrix, diags

from avatargen.body.model import CanonicalBody
from avatargen.smoothstep import smoothstep
from avatargen.wardrobe.makehuman.fit import straight_legs
from avatargen.wardrobe.makehuman.solid import boundary_loops
from avatargen.wardrobe.tailored.form import Sheet, default_body

EVEN = 10  # rounds of evening out the body
LEAST = 0.003  # m off the skin, whatever is even


def membrane(faces: Int64[np.ndarray, "F 3"], count: int, *, held: bool = False) -> csr_matrix:
    """One round of averaging: half a vertex's own place, half its neighbours' mean; on an edge of the cloth,
    the neighbours on that edge. With `held`, edges stay."""
    ends = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    both = np.concatenate([ends, ends[:, ::-1]])
    loops = boundary_loops(faces)
    on_edge = np.zeros(count, dtype=bool)
    for loop in loops:
        on_edge[loop] = True
    both = both[~on_edge[both[:, 0]]]
    for loop in loops if not held else []:
        both = np.concatenate(
            [both, np.stack([loop, np.roll(loop, 1)], 1), np.stack([loop, np.roll(loop, -1)], 1)]
        )
    near = csr_matrix((np.ones(len(both)), (both[:, 0], both[:, 1])), shape=(count, count))
    near.data[:] = 1.0
    degree = np.asarray(near.sum(axis=1)).ravel()
    mean = diags(1 / np.maximum(degree, 1)) @ near + diags((degree == 0).astype(float))
    return csr_matrix(0.5 * (diags(np.ones(count)) + mean))


@cache
def even_body() -> CanonicalBody:
    """The body without what is finer than cloth follows: smoothed without shrinking (Taubin 1995)."""
    body = default_body()
    average = membrane(body.faces.astype(np.int64), len(body.vertices))
    vertices = body.vertices.astype(np.float64)
    for _ in range(EVEN):
        vertices = average @ vertices
        vertices = vertices - 1.06 * (average @ vertices - vertices)
    return replace(body, vertices=vertices.astype(np.float32))


def skin_under(
    points: Float64[np.ndarray, "V 3"], body: CanonicalBody
) -> tuple[Float64[np.ndarray, " V"], Float64[np.ndarray, "V 3"]]:
    """Signed distance to the body, and the body's unit normal at the closest point."""
    hit = body.distance.query(points.astype(np.float32))
    normals = np.asarray(
        igl.per_vertex_normals(body.vertices.astype(np.float64), body.faces.astype(np.int64))
    )
    out = np.einsum("vk,vka->va", hit.barycentric, normals[body.faces[hit.face]])
    return hit.distance.astype(np.float64), out / np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-9)


def cleared(
    points: Float64[np.ndarray, "V 3"], ease: Float64[np.ndarray, " V"], body: CanonicalBody | None = None
) -> Float64[np.ndarray, "V 3"]:
    """Points moved outward until they are off the body, or the evened one, by their ease."""
    distance, out = skin_under(points, body or even_body())
    return points + np.maximum(ease - distance, 0)[:, None] * out


def draped(sheet: Sheet, ease: Float64[np.ndarray, " V"], rounds: int, *, held: bool = False) -> Sheet:
    """A sheet pulled taut over the body. With `held`, its edges only move off the skin."""
    average = membrane(sheet.faces, len(sheet.vertices), held=held)
    vertices = cleared(sheet.vertices, ease)
    for _ in range(rounds):
        vertices = cleared(average @ (average @ vertices), ease)
    vertices = cleared(cleared(vertices, ease), np.minimum(ease, LEAST), default_body())
    return shifted(sheet, vertices)


def shifted(sheet: Sheet, vertices: Float64[np.ndarray, "V 3"]) -> Sheet:
    """A sheet whose vertices moved; their places on the form move along, turned as the legs are."""
    moved, by = vertices - sheet.vertices, straight_legs()
    below = smoothstep((0.0 - sheet.at[:, 1]) / 0.15)[:, None]
    left, right = moved @ by[1][:3, :3], moved @ by[2][:3, :3]  # from the right: the inverse turn
    legs = np.where(sheet.at[:, :1] > 0, left, right)
    return replace(sheet, vertices=vertices, at=sheet.at + moved + below * (legs - moved))


def normals_of(sheet: Sheet) -> Float64[np.ndarray, "V 3"]:
    """Unit normals at a sheet's vertices."""
    return np.asarray(igl.per_vertex_normals(sheet.vertices, sheet.faces))


def moved_out(sheet: Sheet, by: Float64[np.ndarray, " V"]) -> Sheet:
    """A sheet moved along its normals by metres: ribs, bands, creases."""
    return replace(sheet, vertices=sheet.vertices + by[:, None] * normals_of(sheet))
