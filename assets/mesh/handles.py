"""Take the handles off a closed surface, so that it is a ball to a rubber sheet.

Where layers of a person touch, a bridge between them or a slit through them makes a handle. A short loop goes
around the bridge, or along the slit's rim. The surface is cut open along it, and both rims are closed: the
bridge is severed, the slit has a wall.

    shortest paths from a root           make a tree of edges
    faces, joined over the other edges   make a tree of faces, edges far from the root first
    two edges a handle are in neither    and each closes a loop that parts nothing

(Erickson & Whittlesey 2005, Greedy optimal homotopy and homology generators.)

Letters: V vertices, F faces, N edges, L vertices of a loop, T triangles across it.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import dijkstra, minimum_spanning_tree

from assets.mesh.surface import (
    Surface,
    directed_edges,
    edge_lengths,
    euler_number,
    label_components,
    opposite_edges,
)

TURNS, ENOUGH = 6, 0.95  # times that the shortest loop is looked for from nearer by, until it gains less
ALIKE = 2.0  # loops longer than the shortest by this factor wait until they are looked for from nearer by

Loop = Int64[np.ndarray, " _"]


@dataclass(frozen=True, kw_only=True)
class Loops:
    """Loops of edges, shortest first; together they part nothing."""

    vertices: tuple[Loop, ...]
    lengths: tuple[float, ...]  # metres


def without_handles(surface: Surface, longest: float) -> tuple[Surface, int]:
    """The closed manifold surface with every handle cut that a loop of at most `longest` metres goes around,
    and how many these were. Vertices keep their places and their order; new ones follow them."""
    pieces, label = label_components(surface)
    roots = np.unique(label, return_index=True)[1]
    cut, left = 0, pieces - euler_number(surface) // 2
    while left > 0 and longest > 0:
        loops = nearest_loops(surface, roots, label)
        chosen = apart(loops, longest)
        for loop in chosen:
            surface = cut_along(surface, loop)
            label = np.concatenate([label, np.full(len(surface.vertices) - len(label), label[loop[0]])])
        cut, left = cut + len(chosen), left - len(chosen)
        if not chosen:
            break
    return surface, cut


def nearest_loops(surface: Surface, roots: Int64[np.ndarray, " N"], label: Int64[np.ndarray, " V"]) -> Loops:
    """From a root on a short loop itself that is the shortest there is; from afar it makes detours."""
    loops = find_loops(surface, roots)
    for _ in range(TURNS):
        middle = loops.vertices[0][len(loops.vertices[0]) // 2]
        nearer = find_loops(surface, with_root(roots, label, int(middle)))
        if nearer.lengths[0] > ENOUGH * loops.lengths[0]:
            break
        loops = nearer
    return min(loops, nearer, key=lambda found: found.lengths[0])


def with_root(
    roots: Int64[np.ndarray, " N"], label: Int64[np.ndarray, " V"], root: int
) -> Int64[np.ndarray, " N"]:
    """The roots with another one in the component of `root`."""
    return np.where(label[roots] == label[root], root, roots)


def apart(loops: Loops, longest: float) -> list[Loop]:
    """Of loops that are about as short as the shortest those that share no vertex."""
    taken: set[int] = set()
    chosen: list[Loop] = []
    for loop, length in zip(loops.vertices, loops.lengths, strict=True):
        if length <= min(longest, ALIKE * loops.lengths[0]) and taken.isdisjoint(loop.tolist()):
            chosen.append(loop)
            taken.update(loop.tolist())
    return chosen


def find_loops(surface: Surface, roots: Int64[np.ndarray, " N"]) -> Loops:
    """Two loops for each handle, those that are the shortest from the roots, of which each component has
    one."""
    faces, vertices = surface.faces, surface.vertices
    twin = opposite_edges(faces, len(vertices))
    edge, ends = np.arange(len(twin)), directed_edges(faces)
    start, end = ends.T
    length = np.maximum(edge_lengths(surface, ends), np.finfo(float).tiny)
    graph = csr_array((length, (start, end)), shape=(len(vertices), len(vertices)))
    distance, before, _ = dijkstra(graph, indices=roots, min_only=True, return_predecessors=True)
    other = np.flatnonzero((edge < twin) & (before[start] != end) & (before[end] != start))
    detour = distance[start[other]] + length[other] + distance[end[other]]
    closing = other[~in_tree(other // 3, twin[other] // 3, detour, len(faces))]
    found = [loop_of(before, int(start[edge]), int(end[edge])) for edge in closing]
    lengths = [around(vertices[loop]) for loop in found]
    order = np.argsort(lengths, kind="stable")
    return Loops(vertices=tuple(found[i] for i in order), lengths=tuple(lengths[i] for i in order))


def in_tree(
    left: Int64[np.ndarray, " N"],
    right: Int64[np.ndarray, " N"],
    weight: Float64[np.ndarray, " N"],
    count: int,
) -> np.ndarray:
    """[N] which edges between `count` faces are in the tree of greatest weight."""
    light = 2.0 * weight.max() - weight  # above zero, as scipy takes zeros for no edge
    graph = coo_array((light, (left, right)), shape=(count, count))
    tree = minimum_spanning_tree(graph.tocsr()).tocoo()
    return np.isin(left * count + right, tree.row.astype(np.int64) * count + tree.col)


def loop_of(before: np.ndarray, start: int, end: int) -> Loop:
    """Along the tree from where the ways to both ends part to `start`, over the edge and back from `end`."""
    ways = [[start], [end]]
    for way in ways:
        while before[way[-1]] >= 0:
            way.append(int(before[way[-1]]))
    one, two = ways
    while len(one) > 1 and len(two) > 1 and one[-2] == two[-2]:
        one.pop()
        two.pop()
    return np.array(one[::-1] + two[:-1], dtype=np.int64)


def around(points: Float64[np.ndarray, "L 3"]) -> float:
    """Length of a closed line, metres."""
    return float(np.linalg.norm(points - np.roll(points, 1, axis=0), axis=1).sum())


def cut_along(surface: Surface, loop: Loop) -> Surface:
    """Cut open along a simple loop of edges, and closed along both rims."""
    size, count = len(loop), len(surface.vertices)
    start, end = directed_edges(surface.faces).T
    at = np.flatnonzero(np.isin(start, loop) & np.isin(end, loop))
    edges = {(int(start[e]), int(end[e])): int(e) for e in at}
    twin = opposite_edges(surface.faces, count)
    corners = surface.faces.reshape(-1).copy()
    for i, vertex in enumerate(loop.tolist()):
        edge, last = edges[vertex, int(loop[(i + 1) % size])], edges[vertex, int(loop[i - 1])]
        while edge != last:
            corners[edge] = count + i
            edge = int(twin[edge + 2 if edge % 3 == 0 else edge - 1])  # of the face beside, at the vertex
    place = {vertex: i for i, vertex in enumerate(loop.tolist())}
    cap, middle = triangulate(surface.vertices[loop], {(place[a], place[b]) for a, b in edges})
    # the rims' vertices, then the middles of two fans where there are any
    here = np.concatenate([loop, count + size + np.arange(len(middle))])
    there = np.concatenate([count + np.arange(size), count + size + len(middle) + np.arange(len(middle))])
    faces = np.concatenate([corners.reshape(-1, 3), here[cap], there[cap[:, ::-1]]])
    vertices = np.concatenate([surface.vertices, surface.vertices[loop], middle, middle])
    return Surface(vertices=vertices, faces=faces)


def triangulate(
    points: Float64[np.ndarray, "L 3"], edges: set[tuple[int, int]]
) -> tuple[Int64[np.ndarray, "T 3"], Float64[np.ndarray, "M 3"]]:
    """Triangles across a closed line with the least sum of squared diagonals, none of which is one of
    `edges`, which the surface has already; a fan around a new point in the middle where there are none."""
    size = len(points)
    price = ((points[:, None] - points[None]) ** 2).sum(axis=2)
    for a, b in edges:
        price[a, b] = price[b, a] = np.inf
    rim = np.arange(size)
    price[rim, rim - 1] = price[rim - 1, rim] = 0.0
    best, choice = np.zeros((size, size)), np.zeros((size, size), dtype=np.int64)
    for span in range(2, size):
        for i in range(size - span):
            k = i + span
            sums = best[i, i + 1 : k] + best[i + 1 : k, k]
            choice[i, k] = i + 1 + int(np.argmin(sums))
            best[i, k] = sums.min() + price[i, k]
    if not np.isfinite(best[0, -1]):
        return np.stack([rim, np.roll(rim, -1), np.full(size, size)], axis=1), points.mean(axis=0)[None]
    triangles, spans = [], [(0, size - 1)]
    while spans:
        i, k = spans.pop()
        if k - i > 1:
            j = int(choice[i, k])
            triangles.append((i, j, k))
            spans += [(i, j), (j, k)]
    return np.array(triangles, dtype=np.int64), np.zeros((0, 3))
