"""The mesh of an asset while it loses faces: both welded and split at the texture's seams.

Half-edge collapses by quadrics (Garland and Heckbert 1997), many at once. A vertex on a seam of the texture
goes along the seam, both sides together, so that every level is closed once welded. Where several seams meet
and a chart does not reach the vertex that is kept, that chart's corner keeps its place in the texture and
gets a vertex of its own.

Letters: V welded vertices, W split ones, F faces, E directed edges (see `assets.mesh.connectivity`), N
candidates (edges that may collapse), K corners that they would move.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int64

from assets.asset.asset import PlainAsset, TexturedAsset
from assets.errors import GeometryError
from assets.mesh.quadric import TINY, errors_at, plane_quadrics
from assets.mesh.surface import directed_edges, normals_of, opposite_edges, spoilt
from assets.simplify.half_edge_collapse import (
    changed_corners,
    faces_with,
    independent_set,
    meets_link_condition,
    nondegenerate,
)

SEAM_WEIGHT = 0.5  # of a seam's own path against the surface, in the quadrics
SLIDE = 0.01  # cost of sliding the texture along an edge, against moving the surface as far
LARGEST_TURN = 0.2  # cosine of the angle a face may turn by
THINNEST = 1.0  # degrees that a changed face's smallest angle may fall to
EARLY = (
    0.15  # share of the candidates, cheapest first, that a round looks at; all, where none of these may go
)


@dataclass
class LevelMesh:
    """A mesh that loses faces: welded and split corners of the same faces."""

    points: Float64[np.ndarray, "V 3"]  # metres
    quadrics: Float64[np.ndarray, "V 4 4"]  # of the planes of faces and seams, weighted by thirds of areas
    faces: Int64[np.ndarray, "F 3"]  # welded vertices
    split: Int64[np.ndarray, "F 3"]  # split vertices of the same corners
    uv: Float64[np.ndarray, "_ 2"] | None  # of the asset's vertices
    source: Int64[np.ndarray, " W"]  # the asset's vertex that has this one's place, normal and weights
    uv_source: Int64[np.ndarray, " W"]  # and the one that has its place in the texture


def level_mesh(asset: PlainAsset) -> LevelMesh:
    """The finest level, ready to lose faces."""
    welded = np.arange(len(asset.vertices)) if asset.welded is None else asset.welded
    points = np.zeros((int(welded.max()) + 1, 3))
    points[welded] = asset.vertices
    mesh = LevelMesh(
        points=points,
        quadrics=np.zeros((len(points), 4, 4)),
        faces=welded[asset.faces],
        split=asset.faces.copy(),
        uv=asset.uv.astype(np.float64) if isinstance(asset, TexturedAsset) else None,
        source=np.arange(len(asset.vertices)),
        uv_source=np.arange(len(asset.vertices)),
    )
    if (opposite_edges(mesh.faces, len(points)) < 0).any():
        raise GeometryError("levels: the finest level is not closed once welded; export it again")
    add_quadrics(mesh)
    return mesh


def add_quadrics(mesh: LevelMesh) -> None:
    """Planes of the faces, weighted by area; and upright ones along seams, which hold the seams' path."""
    corners = mesh.points[mesh.faces]
    normal = normals_of(corners)
    area = np.linalg.norm(normal, axis=1)
    unit = normal / np.maximum(area, TINY)[:, None]
    for corner in range(3):
        np.add.at(mesh.quadrics, mesh.faces[:, corner], plane_quadrics(corners[:, 0], unit, area / 6))
    edges, split = directed_edges(mesh.faces), directed_edges(mesh.split)
    twin = opposite_edges(mesh.faces, len(mesh.points))
    seam = (split != split[twin][:, ::-1]).any(axis=1)
    along = mesh.points[edges[seam, 1]] - mesh.points[edges[seam, 0]]
    upright = np.cross(along, unit[np.flatnonzero(seam) // 3])
    length = np.linalg.norm(upright, axis=1)
    fins = plane_quadrics(
        mesh.points[edges[seam, 0]],
        upright / np.maximum(length, TINY)[:, None],
        SEAM_WEIGHT * length**2 / 6,
    )
    for end in range(2):
        np.add.at(mesh.quadrics, edges[seam, end], fins)


def collapse_round(mesh: LevelMesh, target: int) -> bool:
    """One round of collapses that do not touch one another, down to `target` faces at the least; False if
    none is possible."""
    twin = opposite_edges(mesh.faces, len(mesh.points))
    edges, split = directed_edges(mesh.faces), directed_edges(mesh.split)
    cost = collapse_costs(mesh, edges, split, twin)
    order = np.argsort(cost, kind="stable")
    order = order[np.isfinite(cost[order])]
    for looked_at in (order[: int(EARLY * len(order))], order):
        allowed = looked_at[permitted(mesh, edges[looked_at], split[looked_at], split[twin[looked_at]])]
        chosen = allowed[independent_set(mesh.faces, len(mesh.points), edges[allowed], cost[allowed])]
        chosen = chosen[: (len(mesh.faces) - target) // 2]
        if len(chosen):
            collapse_all(mesh, edges[chosen], split[chosen], split[twin[chosen]])
            return True
    return False


def collapse_costs(
    mesh: LevelMesh,
    edges: Int64[np.ndarray, "E 2"],
    split: Int64[np.ndarray, "E 2"],
    twin: Int64[np.ndarray, " E"],
) -> Float64[np.ndarray, " E"]:
    """How much each directed edge's collapse would change; infinite where its two sides disagree."""
    start, end = edges.T
    moved = errors_at(mesh.quadrics[start] + mesh.quadrics[end], mesh.points[end])
    pairs = np.unique(mesh.faces.reshape(-1) * len(mesh.source) + mesh.split.reshape(-1))
    corners = np.bincount(pairs // len(mesh.source), minlength=len(mesh.points))
    other = split[twin][:, ::-1]  # the same vertices, as the other side names them
    at_seam = split != other
    slid = corners[start] - 1 - at_seam[:, 0]
    length = ((mesh.points[end] - mesh.points[start]) ** 2).sum(axis=1)
    size = np.trace(mesh.quadrics[:, :3, :3], axis1=1, axis2=2)[start]
    cost = moved + SLIDE * slid * length * size
    return np.where(at_seam[:, 0] == at_seam[:, 1], np.maximum(cost, 0), np.inf)


def new_corners(
    mesh: LevelMesh,
    edges: Int64[np.ndarray, "N 2"],
    split: Int64[np.ndarray, "N 2"],
    other: Int64[np.ndarray, "N 2"],
) -> tuple[Int64[np.ndarray, " K"], Int64[np.ndarray, " K"], Int64[np.ndarray, " K"]]:
    """Candidate, corner and the split vertex it would get: -1 where its chart does not reach the kept vertex.

    `split` names an edge's ends on its own side, `other` those of the opposite edge.
    """
    candidate, corner = changed_corners(mesh.faces, edges)
    now = mesh.split.reshape(-1)[corner]
    here, there = split[candidate], other[candidate]
    becomes = np.where(now == here[:, 0], here[:, 1], np.where(now == there[:, 1], there[:, 0], -1))
    return candidate, corner, becomes


def permitted(
    mesh: LevelMesh,
    edges: Int64[np.ndarray, "N 2"],
    split: Int64[np.ndarray, "N 2"],
    other: Int64[np.ndarray, "N 2"],
) -> Bool[np.ndarray, " N"]:
    """Collapses after which the surface is closed and no face has turned over, in space or in the texture."""
    candidate, corner, becomes = new_corners(mesh, edges, split, other)
    before = mesh.points[mesh.faces[corner // 3]]
    after = mesh.points[faces_with(mesh.faces, corner, edges[candidate, 1])]
    bad = spoilt(before, after, LARGEST_TURN, THINNEST)
    if mesh.uv is not None:
        stays = np.where(becomes < 0, mesh.split.reshape(-1)[corner], becomes)
        old, new = (
            signed_areas(mesh.uv[mesh.uv_source[mesh.split[corner // 3]]]),
            signed_areas(mesh.uv[mesh.uv_source[faces_with(mesh.split, corner, stays)]]),
        )
        bad |= (old * new <= 0) & (old != 0)
    refused = np.bincount(candidate, bad, minlength=len(edges)) > 0
    return meets_link_condition(mesh.faces, len(mesh.points), edges) & ~refused


def signed_areas(uv: Float64[np.ndarray, "K 3 2"]) -> Float64[np.ndarray, " K"]:
    """Twice the area of triangles in the texture, negative where they are mirrored."""
    a, b = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def collapse_all(
    mesh: LevelMesh,
    edges: Int64[np.ndarray, "N 2"],
    split: Int64[np.ndarray, "N 2"],
    other: Int64[np.ndarray, "N 2"],
) -> None:
    """Collapse all candidates, which are an independent set."""
    candidate, corner, becomes = new_corners(mesh, edges, split, other)
    slides = np.flatnonzero(becomes < 0)
    slid, first, place = np.unique(
        mesh.split.reshape(-1)[corner[slides]], return_index=True, return_inverse=True
    )
    becomes[slides] = len(mesh.source) + place
    mesh.source = np.concatenate([mesh.source, mesh.source[split[candidate[slides[first]], 1]]])
    mesh.uv_source = np.concatenate([mesh.uv_source, mesh.uv_source[slid]])
    flat = mesh.split.reshape(-1).copy()
    flat[corner] = becomes
    np.add.at(mesh.quadrics, edges[:, 1], mesh.quadrics[edges[:, 0]])
    into = np.arange(len(mesh.points))
    into[edges[:, 0]] = edges[:, 1]
    faces = into[mesh.faces]
    left = nondegenerate(faces)
    mesh.faces, mesh.split = faces[left], flat.reshape(-1, 3)[left]
