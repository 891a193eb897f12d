"""Fewer faces by edge collapses in the order of their quadric errors (Garland and Heckbert 1997), on a closed
manifold mesh, which stays one.

A vertex's quadric (`assets.mesh.quadric`) sums its faces' planes, weighted by their areas. So what is least
is the squared distance over the area, however unevenly faces are spread. An edge collapses to the point of
least error. The little weight of its middle decides where the error leaves that open.

Edges wait in a bucket queue, eight buckets to a doubling of the error, which sorts them nearly as a heap
would. Quadrics only grow, and so does an edge's error: it is enough to look at it again when its turn comes.
An edge whose collapse makes a thin face thinner waits longer, as if its error were greater. A collapse is
refused where the link condition does not hold, and where a face would turn by too much or lose its area. A
refused edge waits again once something beside it has collapsed.

Letters: V vertices, F faces, E directed edges (see `assets.mesh.connectivity`), P pairs of a directed edge
and its twin, which are the edges that wait.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Int32

from assets.mesh.connectivity import HalfEdges, end_of, meets_link_condition, previous_edge
from assets.mesh.importance import Importance, evenly
from assets.mesh.quadric import TERMS, best_point, cross, face_quadrics
from assets.mesh.surface import Surface, compact, opposite_edges
from avatargen.compiled import compiled, inner

NO_AREA = 1e-4  # height over longest edge, under which a face has no area to speak of
FLAT = 0.02  # the same, under which a face's normal says nothing, so that it may turn
BUCKETS, PER_DOUBLING = 768, 8  # of the queue: 96 doublings, from 2^-84 to 2^12
SMALLEST = -84  # power of two of the error under which all are alike, square metres times square metres


@dataclass(frozen=True, kw_only=True)
class DecimateConfig:
    """What a collapse may do."""

    middle: float = 1e-4  # weight of an edge's middle, of that of its planes
    largest_turn: float = 0.2  # cosine of the angle that a face may turn by
    thin: float = 0.13  # height over longest edge, about 8 degrees, under which a new face counts against it


class Limits(NamedTuple):
    """`DecimateConfig` for compiled loops."""

    middle: float
    largest_turn: float
    thin: float


class Pairs(NamedTuple):
    """The edges that wait, each with its twin."""

    number: Int32[np.ndarray, " E"]  # the pair of each directed edge
    edge: Int32[np.ndarray, " P"]  # one edge of each pair; -1 once it is gone


class Queue(NamedTuple):
    """Pairs by error. Each bucket is a chain of pairs, -1 at its end; the last one in is the first out."""

    first: Int32[np.ndarray, "768"]  # of each bucket
    next_pair: Int32[np.ndarray, " P"]  # in the same bucket
    waits: Bool[np.ndarray, " P"]  # False for pairs that were refused


def decimate(
    surface: Surface,
    target_faces: int,
    config: DecimateConfig | None = None,
    importance: Importance = evenly,
) -> Surface:
    """The surface with `target_faces` faces or one more; errors weigh as `importance` says.

    With more than that where no other edge may collapse. A surface that is not closed and manifold comes back
    as it is.
    """
    config = config or DecimateConfig()
    twin = opposite_edges(surface.faces, len(surface.vertices))
    if (twin < 0).any():
        return surface
    vertices = surface.vertices.copy()
    quadric = face_quadrics(vertices, surface.faces) * importance(vertices)[:, None]
    limits = Limits(config.middle, config.largest_turn, config.thin)
    faces = collapse_edges(vertices, quadric, surface.faces, twin.astype(np.int32), target_faces, limits)
    return compact(vertices, faces)


@inner(forceinline=True)
def bucket_of(error):
    """The bucket of an edge of this error."""
    if not error > 0.0:
        return 0
    return min(max(int(PER_DOUBLING * (np.log2(error) - SMALLEST)), 0), BUCKETS - 1)


@inner(forceinline=True)
def push(queue, number, error):
    """Put a pair into its bucket, which is returned."""
    first, next_pair, _ = queue
    bucket = bucket_of(error)
    next_pair[number] = first[bucket]
    first[bucket] = number
    return bucket


@inner(forceinline=True)
def shape_penalty(vertices, half_edges, moved, other, x, y, z, limits):
    """What the error is multiplied by for the shape of the faces at vertex `moved`, if that goes to x, y, z;
    infinite where one turns too far or loses its area. Faces at `other` do not count: the collapse takes
    them.
    """
    start, twin, out = half_edges
    edge, worst = out[moved], 1.0
    while True:
        a, b = end_of(start, edge), start[previous_edge(edge)]
        if a != other and b != other:
            ax, ay, az = vertices[a]
            bx, by, bz = vertices[b, 0] - ax, vertices[b, 1] - ay, vertices[b, 2] - az
            ox, oy, oz = vertices[moved, 0] - ax, vertices[moved, 1] - ay, vertices[moved, 2] - az
            nx, ny, nz = x - ax, y - ay, z - az
            base = bx * bx + by * by + bz * bz
            px, py, pz, before = cross(bx, by, bz, ox, oy, oz)
            qx, qy, qz, after = cross(bx, by, bz, nx, ny, nz)
            old = max(base, ox * ox + oy * oy + oz * oz)  # the longest edges' squares
            old = max(old, (ox - bx) ** 2 + (oy - by) ** 2 + (oz - bz) ** 2)
            new = max(base, nx * nx + ny * ny + nz * nz)
            new = max(new, (nx - bx) ** 2 + (ny - by) ** 2 + (nz - bz) ** 2)
            turned = px * qx + py * qy + pz * qz < limits.largest_turn * np.sqrt(before * after)
            if turned and before > (FLAT * old) ** 2:
                return np.inf
            thinner = after * old * old <= before * new * new
            if after < (limits.thin * new) ** 2 and thinner:
                if after <= (NO_AREA * new) ** 2:
                    return np.inf
                worst = max(worst, (limits.thin * new) ** 2 / after)
        edge = twin[previous_edge(edge)]
        if edge == out[moved]:
            return worst


@inner
def number_pairs(half_edges, pairs):
    """Fill in an edge that leaves each vertex, the pair of each directed edge, and an edge of each pair."""
    (start, twin, out), (pair, edge_of) = half_edges, pairs
    number = 0
    for edge in range(len(start)):
        out[start[edge]] = edge
        if twin[edge] > edge:
            pair[edge] = pair[twin[edge]] = number
            edge_of[number] = edge
            number += 1


@inner(forceinline=True)
def remove_edge(edge, opposite, half_edges, pairs, alive):
    """Take away an edge's two faces, and give the faces around its end to its start."""
    (start, twin, out), (pair, edge_of) = half_edges, pairs
    around, stop = out[end_of(start, edge)], out[end_of(start, edge)]
    while True:
        start[around] = start[edge]
        around = twin[previous_edge(around)]
        if around == stop:
            break
    edge_of[pair[edge]] = -1
    for gone in (edge, opposite):
        a, b = twin[gone - 2 if gone % 3 == 2 else gone + 1], twin[previous_edge(gone)]
        edge_of[pair[b]] = -1
        pair[b] = pair[a]
        edge_of[pair[a]] = a
        twin[a], twin[b] = b, a
        out[start[a]], out[start[b]] = a, b
        alive[gone // 3] = False


@inner(forceinline=True)
def requeue_around(u, vertices, quadric, half_edges, pairs, queue, middle):
    """Let the edges at vertex u that were refused wait again; returns the lowest of their buckets."""
    start, twin, out = half_edges
    lowest, around = BUCKETS, out[u]
    while True:
        number = pairs.number[around]
        if not queue.waits[number]:
            error = best_point(quadric, vertices, u, end_of(start, around), middle)[3]
            lowest = min(lowest, push(queue, number, error))
            queue.waits[number] = True
        around = twin[previous_edge(around)]
        if around == out[u]:
            return lowest


@compiled
def collapse_edges(vertices, quadric, faces, twin, target, limits):
    """[N 3] the faces that are left, `target` or one more where that can be reached.

    Moves vertices [V 3] (metres), and changes quadrics [V 10] and twins [E] on the way.
    """
    start = faces.astype(np.int32).ravel()
    half_edges = HalfEdges(start, twin, np.zeros(len(vertices), np.int32))
    pairs = Pairs(np.empty(len(start), np.int32), np.empty(len(start) // 2, np.int32))
    number_pairs(half_edges, pairs)
    edge_of = pairs.edge
    count = len(edge_of)
    queue = Queue(np.full(BUCKETS, -1, np.int32), np.empty(count, np.int32), np.ones(count, np.bool_))
    first, next_pair, waits = queue
    mark, alive = np.zeros(len(vertices), np.int32), np.ones(len(faces), np.bool_)
    for number in range(count):
        u, v = start[edge_of[number]], end_of(start, edge_of[number])
        push(queue, number, best_point(quadric, vertices, u, v, limits.middle)[3])
    lowest, tries, left = 0, 0, len(faces)
    while left > target and lowest < BUCKETS:
        number = first[lowest]
        if number < 0:
            lowest += 1
            continue
        first[lowest] = next_pair[number]
        edge = edge_of[number]
        if edge < 0:
            continue
        u, v = start[edge], end_of(start, edge)
        x, y, z, error = best_point(quadric, vertices, u, v, limits.middle)
        if bucket_of(error) > lowest:  # its ends have grown meanwhile, which never makes the error less
            push(queue, number, error)
            continue
        waits[number] = False
        tries += 1
        if not meets_link_condition(half_edges, mark, tries, u, v):
            continue
        penalty = shape_penalty(vertices, half_edges, u, v, x, y, z, limits)
        penalty = max(penalty, shape_penalty(vertices, half_edges, v, u, x, y, z, limits))
        if penalty == np.inf:
            continue
        if bucket_of(error * penalty) > lowest:
            waits[number] = True
            push(queue, number, error * penalty)
            continue
        remove_edge(edge, np.int32(twin[edge]), half_edges, pairs, alive)
        left -= 2
        vertices[u, 0], vertices[u, 1], vertices[u, 2] = x, y, z
        for term in range(TERMS):
            quadric[u, term] += quadric[v, term]
        lowest = min(lowest, requeue_around(u, vertices, quadric, half_edges, pairs, queue, limits.middle))
    return faces_left(start, alive, left)


@inner
def faces_left(start, alive, count):
    """[count 3] the faces that are alive, of the starts [E] of all directed edges."""
    faces, kept = np.empty((count, 3), np.int64), 0
    for face in range(len(alive)):
        if alive[face]:
            for corner in range(3):
                faces[kept, corner] = start[3 * face + corner]
            kept += 1
    return faces
