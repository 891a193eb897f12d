"""Half-edge collapses, many at once: a vertex slides along an edge onto its neighbour and takes its faces
with it.

A candidate is named by the directed edge (see `assets.mesh.connectivity`) from the vertex that goes to the
one that stays. Vertices that stay do not move, so whatever belongs to them stays true. Corner 3 f + i is
corner i of face f.

Letters: V vertices, F faces, N candidates, M of them, K pairs of a candidate and a corner that it would move.
"""

import numpy as np
from jaxtyping import Bool, Float64, Int64

from assets.mesh.surface import directed_edges, opposite_edges


def meets_link_condition(
    faces: Int64[np.ndarray, "F 3"], count: int, edges: Int64[np.ndarray, "N 2"]
) -> Bool[np.ndarray, " N"]:
    """Whether each collapse, alone, leaves a closed manifold mesh of `count` vertices one of the same
    topology: the edge's ends share its two opposite vertices only, and are not part of a tetrahedron."""
    from assets.mesh.connectivity import link_conditions

    return link_conditions(np.ascontiguousarray(faces), opposite_edges(faces, count), edges, count)


def changed_corners(
    faces: Int64[np.ndarray, "F 3"], edges: Int64[np.ndarray, "N 2"]
) -> tuple[Int64[np.ndarray, " K"], Int64[np.ndarray, " K"]]:
    """Pairs of a candidate and a corner that it would move: those at its start in faces that it keeps."""
    order = np.argsort(faces.reshape(-1), kind="stable")
    degree = np.bincount(faces.reshape(-1), minlength=int(edges.max(initial=0)) + 1)
    first = np.cumsum(degree) - degree
    number = degree[edges[:, 0]]
    candidate = np.repeat(np.arange(len(edges)), number)
    place = np.arange(number.sum()) - np.repeat(np.cumsum(number) - number, number)
    corner = order[first[edges[candidate, 0]] + place]
    kept = (faces[corner // 3] != edges[candidate, 1][:, None]).all(axis=1)
    return candidate[kept], corner[kept]


def faces_with(
    faces: Int64[np.ndarray, "F 3"], corner: Int64[np.ndarray, " K"], by: Int64[np.ndarray, " K"]
) -> Int64[np.ndarray, "K 3"]:
    """The faces of some corners, each with another vertex `by` there."""
    changed = faces[corner // 3].copy()
    changed[np.arange(len(corner)), corner % 3] = by
    return changed


def independent_set(
    faces: Int64[np.ndarray, "F 3"],
    count: int,
    edges: Int64[np.ndarray, "N 2"],
    cost: Float64[np.ndarray, " N"],
) -> Int64[np.ndarray, " M"]:
    """Candidates of low cost, cheapest first, whose starts share no neighbour: all can collapse at once.

    A vertex's cheapest candidate is chosen if none that is cheaper starts at it, beside it or two edges away.
    """
    best = np.full(count, len(edges), dtype=np.int64)  # rank of the candidate that takes each vertex away
    order = np.lexsort((edges[:, 1], edges[:, 0], cost))
    rank = np.empty(len(edges), dtype=np.int64)
    rank[order] = np.arange(len(edges))
    np.minimum.at(best, edges[:, 0], rank)
    around = directed_edges(faces)
    around = np.concatenate([around, np.arange(count)[:, None].repeat(2, axis=1)])
    claimed = np.full(count, len(edges), dtype=np.int64)  # best rank of a vertex and its neighbours
    np.minimum.at(claimed, around[:, 1], best[around[:, 0]])
    beaten = np.bincount(around[:, 0], claimed[around[:, 1]] < best[around[:, 0]], minlength=count) > 0
    won = best[~beaten & (best < len(edges))]
    return order[np.sort(won)]


def nondegenerate(faces: Int64[np.ndarray, "F 3"]) -> Bool[np.ndarray, " F"]:
    """Which faces have three different vertices."""
    return (faces != np.roll(faces, 1, axis=1)).all(axis=1)
