"""Half-edge collapses, many at once: a vertex slides along an edge onto its neighbour and takes its faces
with it.

A collapse is named by the directed edge from the vertex that goes to the one that stays; edge 3 f + i runs
from corner i of face f to the next one. Vertices that stay do not move, so whatever belongs to them stays
true. Letters: V vertices, F faces, N candidates, K pairs of a candidate and a face that it would change.
"""

import numpy as np
from jaxtyping import Bool, Float64, Int64
from scipy.sparse import coo_array, csr_array

from assets.mesh.surface import directed_edges


def links_hold(
    faces: Int64[np.ndarray, "F 3"], count: int, edges: Int64[np.ndarray, "N 2"]
) -> Bool[np.ndarray, " N"]:
    """Whether a collapse leaves a closed surface closed: the ends share exactly the two neighbours opposite
    the edge, and more than a tetrahedron is there."""
    around = directed_edges(faces)
    ones = np.ones(len(around), dtype=np.int32)
    graph = csr_array(coo_array((ones, (around[:, 0], around[:, 1])), shape=(count, count)))
    shared = np.asarray(graph[edges[:, 0]].multiply(graph[edges[:, 1]]).sum(axis=1)).reshape(-1)
    return (shared == 2) & (count > 4)


def changed_corners(
    faces: Int64[np.ndarray, "F 3"], edges: Int64[np.ndarray, "N 2"]
) -> tuple[Int64[np.ndarray, " K"], Int64[np.ndarray, " K"]]:
    """Pairs of a candidate and a corner (3 f + i) that would move: those at its start in faces that it leaves
    standing."""
    order = np.argsort(faces.reshape(-1), kind="stable")
    degree = np.bincount(faces.reshape(-1), minlength=int(edges.max(initial=0)) + 1)
    first = np.cumsum(degree) - degree
    number = degree[edges[:, 0]]
    candidate = np.repeat(np.arange(len(edges)), number)
    place = np.arange(number.sum()) - np.repeat(np.cumsum(number) - number, number)
    corner = order[first[edges[candidate, 0]] + place]
    stands = (faces[corner // 3] != edges[candidate, 1][:, None]).all(axis=1)
    return candidate[stands], corner[stands]


def replaced(
    faces: Int64[np.ndarray, "F 3"], corner: Int64[np.ndarray, " K"], by: Int64[np.ndarray, " K"]
) -> Int64[np.ndarray, "K 3"]:
    """The faces of some corners with another vertex there."""
    changed = faces[corner // 3].copy()
    changed[np.arange(len(corner)), corner % 3] = by
    return changed


def apart(
    faces: Int64[np.ndarray, "F 3"],
    count: int,
    edges: Int64[np.ndarray, "N 2"],
    cost: Float64[np.ndarray, " N"],
) -> Int64[np.ndarray, " M"]:
    """Candidates of low cost whose starts share no neighbour, so that all can be done at once."""
    best = np.full(count, len(edges), dtype=np.int64)  # rank of the candidate that takes each vertex away
    order = np.lexsort((edges[:, 1], edges[:, 0], cost))
    rank = np.empty(len(edges), dtype=np.int64)
    rank[order] = np.arange(len(edges))
    np.minimum.at(best, edges[:, 0], rank)
    around = directed_edges(faces)
    around = np.concatenate([around, np.arange(count)[:, None].repeat(2, axis=1)])
    claimed = np.full(count, len(edges), dtype=np.int64)
    np.minimum.at(claimed, around[:, 1], best[around[:, 0]])
    beaten = np.bincount(around[:, 0], claimed[around[:, 1]] < best[around[:, 0]], minlength=count) > 0
    won = best[~beaten & (best < len(edges))]
    return order[np.sort(won)]


def standing(faces: Int64[np.ndarray, "F 3"]) -> Bool[np.ndarray, " F"]:
    """Faces of three different vertices."""
    return (faces != np.roll(faces, 1, axis=1)).all(axis=1)
