"""What is connected to what in a triangle mesh, by compiled loops that are linear in the mesh.

Directed edge 3 f + i of a mesh runs from corner i of face f to the next corner. So the flat list of the
faces' corners holds each edge's start, and no table of edges is needed. An edge's twin is the one that runs
the other way, in the face beyond.

Letters: V vertices, F faces, E directed edges (3 F), N edges asked about.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Int, Int32

from avatargen.compiled import compiled, inner


class HalfEdges(NamedTuple):
    """A closed manifold mesh, ready to walk around its vertices."""

    start: Int[np.ndarray, " E"]  # the vertex that each edge leaves: the faces' corners
    twin: Int[np.ndarray, " E"]
    out: Int32[np.ndarray, " V"]  # an edge that leaves each vertex


@inner(inline="always")
def end_of(start, edge):
    """The vertex that a directed edge leads to; `start` as in `HalfEdges`."""
    return start[edge - 2] if edge % 3 == 2 else start[edge + 1]


@inner(inline="always")
def previous_edge(edge):
    """The edge before this one around its face. Its twin leaves the same vertex, in the face beside."""
    return edge + 2 if edge % 3 == 0 else edge - 1


@inner(inline="always")
def next_edge(edge):
    """The edge after this one around its face."""
    return edge - 2 if edge % 3 == 2 else edge + 1


@inner(forceinline=True)
def meets_link_condition(mesh, mark, stamp, u, v):
    """Whether the edge from u to v may collapse in a closed surface that stays a manifold of the same
    topology: its ends have only its two opposite vertices as common neighbours (Dey et al. 1999), and are not
    part of a tetrahedron.

    `mark` [V] is working memory, and `stamp` a number that it does not hold.
    """
    start, twin, out = mesh
    neighbours, edge = 0, out[u]
    while True:
        mark[end_of(start, edge)] = stamp
        neighbours += 1
        edge = twin[previous_edge(edge)]
        if edge == out[u]:
            break
    shared, others, edge = 0, 0, out[v]
    while True:
        shared += mark[end_of(start, edge)] == stamp
        others += 1
        edge = twin[previous_edge(edge)]
        if edge == out[v]:
            return shared == 2 and max(neighbours, others) > 3


@compiled
def link_conditions(faces, twin, edges, vertex_count):
    """[N] `meets_link_condition` of each edge [N 2] of a closed manifold mesh, on its own."""
    start = faces.ravel()
    out, mark = np.zeros(vertex_count, np.int32), np.full(vertex_count, -1, np.int64)
    for edge in range(len(start)):
        out[start[edge]] = edge
    mesh = HalfEdges(start, twin, out)
    meets = np.empty(len(edges), np.bool_)
    for i in range(len(edges)):
        meets[i] = meets_link_condition(mesh, mark, i, edges[i, 0], edges[i, 1])
    return meets


@inner
def sorted_by(keys, order, count):
    """An order, sorted by the keys (0 to count - 1) of what it names; what has equal keys keeps its order."""
    place = np.zeros(count + 1, np.int64)
    for i in range(len(keys)):
        place[keys[i] + 1] += 1
    for key in range(count):
        place[key + 1] += place[key]
    result = np.empty_like(order)
    for i in range(len(order)):
        key = keys[order[i]]
        result[place[key]] = order[i]
        place[key] += 1
    return result


@compiled
def match_edges(faces, vertex_count):
    """[E] the twin of each directed edge; -1 where it has none or several or is itself repeated."""
    flat = faces.ravel()
    low, high = np.empty(len(flat), np.int32), np.empty(len(flat), np.int32)
    for edge in range(len(flat)):
        start, end = flat[edge], end_of(flat, edge)
        low[edge], high[edge] = min(start, end), max(start, end)
    order = sorted_by(high, np.arange(len(flat), dtype=np.int32), vertex_count)
    order = sorted_by(low, order, vertex_count)
    twin = np.full(len(flat), -1, np.int64)
    first = 0
    while first < len(order):
        a, last = order[first], first + 1
        while last < len(order) and low[order[last]] == low[a] and high[order[last]] == high[a]:
            last += 1
        if last == first + 2:
            b = order[first + 1]
            if flat[a] == end_of(flat, b) and flat[b] == end_of(flat, a):
                twin[a], twin[b] = b, a
        first = last
    return twin


@compiled
def count_split(faces, twin, vertex_count):
    """How many vertices have no face, or faces in several fans (a fan's faces follow each other by twins)."""
    flat = faces.ravel()
    degree, first = np.zeros(vertex_count, np.int64), np.zeros(vertex_count, np.int64)
    for edge in range(len(flat)):
        degree[flat[edge]] += 1
        first[flat[edge]] = edge
    split = 0
    for vertex in range(vertex_count):
        edge, visited = first[vertex], 0
        while visited < degree[vertex]:
            visited += 1
            edge = twin[previous_edge(edge)]  # to the next face of the fan
            if edge < 0 or edge == first[vertex]:
                break
        split += visited != degree[vertex] or visited == 0
    return split


@compiled
def label_fans(faces, twin):
    """[E] the fan of each corner of the faces, fans being faces around a vertex that follow each other by
    twins, numbered by their first corners; and those first corners."""
    fan, first = np.full(faces.size, -1, np.int64), np.empty(faces.size, np.int64)
    count = 0
    for corner in range(faces.size):
        if fan[corner] >= 0:
            continue
        edge = corner
        while edge >= 0 and fan[edge] < 0:
            fan[edge] = count
            edge = twin[previous_edge(edge)]
        edge = twin[corner]  # the other way, where the fan is not closed
        while edge >= 0 and fan[next_edge(edge)] < 0:
            edge = next_edge(edge)
            fan[edge] = count
            edge = twin[edge]
        first[count] = corner
        count += 1
    return fan, first[:count].copy()


@compiled
def label_vertices(faces, vertex_count):
    """How many connected components there are, and [V] the component of each vertex, numbered by their first
    vertices. By union-find with path halving."""
    parent = np.arange(vertex_count)
    for face in range(len(faces)):
        for corner in range(1, 3):
            a, b = faces[face, corner - 1], faces[face, corner]
            while parent[a] != a:
                parent[a] = parent[parent[a]]
                a = parent[a]
            while parent[b] != b:
                parent[b] = parent[parent[b]]
                b = parent[b]
            parent[max(a, b)] = min(a, b)
    count = 0
    for vertex in range(vertex_count):  # parents come first
        if parent[vertex] == vertex:
            parent[vertex] = count
            count += 1
        else:
            parent[vertex] = parent[parent[vertex]]
    return count, parent
