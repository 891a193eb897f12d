"""Levels of detail of a finished asset: ever fewer faces on the vertices that it has, so that all levels
share one texture and one skeleton.

Half-edge collapses by quadrics (Garland and Heckbert 1997), many at once (`collapse`). A vertex on a
seam of the texture goes along the seam, both sides together, so that every level is closed once welded. Where
several seams meet and a chart does not reach the vertex that is kept, that chart's corner keeps its place in
the texture and gets a vertex of its own.

Letters: V welded vertices, W vertices (seams split), F faces, E directed edges, N candidates, K corners that
they would move.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, TypeVar

import numpy as np
from jaxtyping import Bool, Float64, Int64

from assets.asset.asset import Asset, PlainAsset, TexturedAsset
from assets.asset.collapse import apart, changed_corners, links_hold, replaced, standing
from assets.errors import GeometryError
from assets.field import Field
from assets.mesh.measure import MeasureConfig, SurfaceError, surface_error
from assets.mesh.surface import compact, directed_edges, normals_of, opposite_edges, spoilt
from avatargen.errors import InputError

AnyAsset = TypeVar("AnyAsset", bound=PlainAsset)
FEWEST_FACES = 100
SEAM_WEIGHT = 0.5  # of a seam's own path against the surface, in the quadrics
SLIDE = 0.01  # cost of sliding the texture along an edge, against moving the surface as far
LARGEST_TURN = 0.2  # cosine of the angle a face may turn by
THINNEST = 1.0  # degrees that a changed face's smallest angle may fall to
MEASURE = MeasureConfig(samples=3_000)
EARLY = 0.15  # share of the candidates, cheapest first, that a round looks at


@dataclass
class Shrinking:
    """A mesh while it loses faces: welded and split corners of the same faces."""

    points: Float64[np.ndarray, "V 3"]
    quadrics: Float64[np.ndarray, "V 4 4"]  # summed squared distance to planes, square metres times area
    faces: Int64[np.ndarray, "F 3"]
    split: Int64[np.ndarray, "F 3"]
    uv: Float64[np.ndarray, "_ 2"] | None  # of the asset's vertices
    source: Int64[np.ndarray, " W"]  # the asset's vertex that has this one's place, normal and weights
    laid: Int64[np.ndarray, " W"]  # and the one that has its place in the texture


def with_levels(asset: AnyAsset, faces: Sequence[int]) -> AnyAsset:
    """The asset with coarser levels of the given numbers of faces; the asset's own faces are the finest.

    Where seams cross, vertices are added at the end that only coarser levels use.

    Raises:
        InputError: numbers that do not fall, or too few or more faces than there are.
        GeometryError: the surface cannot be kept closed with so few faces.
    """
    check_falling(len(asset.faces), faces)
    mesh = begin(asset)
    levels = []
    for target in faces:
        while len(mesh.faces) - target > 1:
            if not shrink(mesh, target):
                raise GeometryError(
                    f"levels: no collapse is left at {len(mesh.faces)} faces, wanted {target}; ask for more"
                )
        levels.append(mesh.split.copy())
    return extended(asset, mesh, tuple(levels))


def check_falling(finest: int, faces: Sequence[int]) -> None:
    """Raises InputError unless each level has fewer faces than the one before."""
    sizes = [finest, *faces]
    if sizes[-1] < FEWEST_FACES or any(a <= b for a, b in pairwise(sizes)):
        listed = ", ".join(map(str, faces))
        raise InputError(
            f"levels: found {listed} under a mesh of {finest} faces; "
            f"give falling numbers, {FEWEST_FACES} or more"
        )


def begin(asset: PlainAsset) -> Shrinking:
    """The finest level, ready to lose faces."""
    welded = np.arange(len(asset.vertices)) if asset.welded is None else asset.welded
    points = np.zeros((int(welded.max()) + 1, 3))
    points[welded] = asset.vertices
    mesh = Shrinking(
        points=points,
        quadrics=np.zeros((len(points), 4, 4)),
        faces=welded[asset.faces],
        split=asset.faces.copy(),
        uv=asset.uv.astype(np.float64) if isinstance(asset, TexturedAsset) else None,
        source=np.arange(len(asset.vertices)),
        laid=np.arange(len(asset.vertices)),
    )
    if (opposite_edges(mesh.faces, len(points)) < 0).any():
        raise GeometryError("levels: the finest level is not closed once welded; export it again")
    add_quadrics(mesh)
    return mesh


def add_quadrics(mesh: Shrinking) -> None:
    """Planes of the faces, weighted by area; and upright ones along seams, which hold the seams' path."""
    corners = mesh.points[mesh.faces]
    normal = normals_of(corners)
    area = np.linalg.norm(normal, axis=1)
    unit = normal / np.maximum(area, 1e-300)[:, None]
    for corner in range(3):
        np.add.at(mesh.quadrics, mesh.faces[:, corner], plane(corners[:, 0], unit, area / 6))
    edges, split = directed_edges(mesh.faces), directed_edges(mesh.split)
    twin = opposite_edges(mesh.faces, len(mesh.points))
    seam = (split != split[twin][:, ::-1]).any(axis=1)
    along = mesh.points[edges[seam, 1]] - mesh.points[edges[seam, 0]]
    upright = np.cross(along, unit[np.flatnonzero(seam) // 3])
    length = np.linalg.norm(upright, axis=1)
    fins = plane(
        mesh.points[edges[seam, 0]],
        upright / np.maximum(length, 1e-300)[:, None],
        SEAM_WEIGHT * length**2 / 6,
    )
    for end in range(2):
        np.add.at(mesh.quadrics, edges[seam, end], fins)


def plane(
    points: Float64[np.ndarray, "N 3"], normals: Float64[np.ndarray, "N 3"], weight: Float64[np.ndarray, " N"]
) -> Float64[np.ndarray, "N 4 4"]:
    """Quadrics of the squared distance to planes."""
    full = np.concatenate([normals, -np.einsum("nd,nd->n", points, normals)[:, None]], axis=1)
    return weight[:, None, None] * full[:, :, None] * full[:, None, :]


def shrink(mesh: Shrinking, target: int) -> bool:
    """One round of collapses that do not touch one another; False if none is possible."""
    twin = opposite_edges(mesh.faces, len(mesh.points))
    edges, split = directed_edges(mesh.faces), directed_edges(mesh.split)
    cost = collapse_costs(mesh, edges, split, twin)
    order = np.argsort(cost, kind="stable")
    order = order[np.isfinite(cost[order])]
    for looked_at in (order[: int(EARLY * len(order))], order):
        allowed = looked_at[permitted(mesh, edges[looked_at], split[looked_at], split[twin[looked_at]])]
        chosen = allowed[apart(mesh.faces, len(mesh.points), edges[allowed], cost[allowed])]
        chosen = chosen[: (len(mesh.faces) - target) // 2]
        if len(chosen):
            collapse(mesh, edges[chosen], split[chosen], split[twin[chosen]])
            return True
    return False


def collapse_costs(
    mesh: Shrinking,
    edges: Int64[np.ndarray, "E 2"],
    split: Int64[np.ndarray, "E 2"],
    twin: Int64[np.ndarray, " E"],
) -> Float64[np.ndarray, " E"]:
    """How much each directed edge's collapse would change; infinite where its two sides disagree."""
    start, end = edges.T
    place = np.concatenate([mesh.points[end], np.ones((len(end), 1))], axis=1)
    moved = np.einsum("ei,eij,ej->e", place, mesh.quadrics[start] + mesh.quadrics[end], place)
    pairs = np.unique(mesh.faces.reshape(-1) * len(mesh.source) + mesh.split.reshape(-1))
    corners = np.bincount(pairs // len(mesh.source), minlength=len(mesh.points))
    other = split[twin][:, ::-1]  # the same vertices, as the other side names them
    apart_at = split != other
    slid = corners[start] - 1 - apart_at[:, 0]
    length = ((mesh.points[end] - mesh.points[start]) ** 2).sum(axis=1)
    size = np.trace(mesh.quadrics[:, :3, :3], axis1=1, axis2=2)[start]
    cost = moved + SLIDE * slid * length * size
    return np.where(apart_at[:, 0] == apart_at[:, 1], np.maximum(cost, 0), np.inf)


def new_corners(
    mesh: Shrinking,
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
    mesh: Shrinking,
    edges: Int64[np.ndarray, "N 2"],
    split: Int64[np.ndarray, "N 2"],
    other: Int64[np.ndarray, "N 2"],
) -> Bool[np.ndarray, " N"]:
    """Collapses after which the surface is closed and no face has turned over, in space or in the texture."""
    candidate, corner, becomes = new_corners(mesh, edges, split, other)
    before = mesh.points[mesh.faces[corner // 3]]
    after = mesh.points[replaced(mesh.faces, corner, edges[candidate, 1])]
    bad = spoilt(before, after, LARGEST_TURN, THINNEST)
    if mesh.uv is not None:
        stays = np.where(becomes < 0, mesh.split.reshape(-1)[corner], becomes)
        old, new = (
            signed_areas(mesh.uv[mesh.laid[mesh.split[corner // 3]]]),
            signed_areas(mesh.uv[mesh.laid[replaced(mesh.split, corner, stays)]]),
        )
        bad |= (old * new <= 0) & (old != 0)
    refused = np.bincount(candidate, bad, minlength=len(edges)) > 0
    return links_hold(mesh.faces, len(mesh.points), edges) & ~refused


def signed_areas(uv: Float64[np.ndarray, "K 3 2"]) -> Float64[np.ndarray, " K"]:
    """Twice the area of triangles in the texture, negative where they are mirrored."""
    a, b = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def collapse(
    mesh: Shrinking,
    edges: Int64[np.ndarray, "N 2"],
    split: Int64[np.ndarray, "N 2"],
    other: Int64[np.ndarray, "N 2"],
) -> None:
    """Do all of them: they do not touch one another."""
    candidate, corner, becomes = new_corners(mesh, edges, split, other)
    slides = np.flatnonzero(becomes < 0)
    slid, first, place = np.unique(
        mesh.split.reshape(-1)[corner[slides]], return_index=True, return_inverse=True
    )
    becomes[slides] = len(mesh.source) + place
    mesh.source = np.concatenate([mesh.source, mesh.source[split[candidate[slides[first]], 1]]])
    mesh.laid = np.concatenate([mesh.laid, mesh.laid[slid]])
    flat = mesh.split.reshape(-1).copy()
    flat[corner] = becomes
    np.add.at(mesh.quadrics, edges[:, 1], mesh.quadrics[edges[:, 0]])
    into = np.arange(len(mesh.points))
    into[edges[:, 0]] = edges[:, 1]
    faces = into[mesh.faces]
    left = standing(faces)
    mesh.faces, mesh.split = faces[left], flat.reshape(-1, 3)[left]


def extended(asset: AnyAsset, mesh: Shrinking, levels: tuple[np.ndarray, ...]) -> AnyAsset:
    """The asset with its levels and the vertices that they add, as far as a level names them."""
    first = len(asset.vertices)
    named = np.unique(np.concatenate([level.reshape(-1) for level in levels]))
    added = named[named >= first]
    number = np.concatenate([np.arange(first), np.zeros(len(mesh.source) - first, dtype=np.int64)])
    number[added] = first + np.arange(len(added))
    kept = np.concatenate([np.arange(first), added])
    renumbered = tuple(number[level] for level in levels)
    return replace(asset, **of_vertices(asset, mesh.source[kept], mesh.laid[kept]), levels=renumbered)


def of_vertices(
    asset: PlainAsset, rows: Int64[np.ndarray, " N"], laid: Int64[np.ndarray, " N"]
) -> dict[str, Any]:
    """The asset's parts with a value a vertex, for vertices chosen from it; `laid` names those whose place in
    the texture, and so whose tangent, they take."""
    names = ("vertices", "normals", "welded", "canonical", "joints", "weights")
    parts: dict[str, Any] = {
        name: getattr(asset, name)[rows] for name in names if getattr(asset, name, None) is not None
    }
    if isinstance(asset, TexturedAsset):
        parts["uv"] = asset.uv[laid]
        if asset.normal_map is not None:
            parts["normal_map"] = replace(asset.normal_map, tangents=asset.normal_map.tangents[laid])
    if isinstance(asset, Asset):
        parts["morphs"] = tuple(replace(morph, vertices=morph.vertices[rows]) for morph in asset.morphs)
    return parts


def at_level(asset: AnyAsset, number: int) -> AnyAsset:
    """One level alone, with the vertices that it uses; 0 is the finest."""
    named, corner = np.unique((asset.faces, *asset.levels)[number], return_inverse=True)
    faces = corner.reshape(-1, 3).astype(np.int64)
    return replace(asset, **of_vertices(asset, named, named), faces=faces, levels=())


def level_error(asset: PlainAsset, faces: Int64[np.ndarray, "F 3"], sdf: Field) -> SurfaceError:
    """How far the faces of a level are from the field.

    Raises:
        GeometryError: the asset was not built from a field, so nobody knows where its vertices were.
        FieldError: the field is NaN or infinite.
    """
    if asset.welded is None or asset.canonical is None:
        raise GeometryError("levels: the asset was not built from a field; build it from an avatar")
    points = np.zeros((int(asset.welded.max()) + 1, 3))
    points[asset.welded] = asset.canonical
    return surface_error(compact(points, asset.welded[faces]), sdf, MEASURE)
