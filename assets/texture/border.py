"""The border that two flat charts share, by compiled loops.

Letters: W vertices after the seams have split them, F faces, E directed edges, C charts, N faces, edges or
vertices of a few charts.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float64, Int64

from avatargen.compiled import inner


class Sewing(NamedTuple):
    """Charts in the plane, changed in place."""

    faces: Int64[np.ndarray, "F 3"]
    uv: Float64[np.ndarray, "W 2"]
    local: Float64[np.ndarray, "F 3"]
    twin: Int64[np.ndarray, " E"]
    open: Bool[np.ndarray, " E"]
    chart: Int64[np.ndarray, " F"]
    size: Int64[np.ndarray, " C"]
    kind: Int64[np.ndarray, " C"]


@inner
def lists(chart, count):
    """Each chart's faces as a list: the first, the last, and the one that follows each, or -1."""
    head, tail = np.full(count, -1, np.int64), np.full(count, -1, np.int64)
    following = np.full(len(chart), -1, np.int64)
    for face in range(len(chart)):
        if head[chart[face]] < 0:
            head[chart[face]] = face
        else:
            following[tail[chart[face]]] = face
        tail[chart[face]] = face
    return head, tail, following


@inner
def faces_in(first, following, size):
    """[N] the faces of a list of so many."""
    found, face = np.empty(size, np.int64), first
    for n in range(size):
        found[n] = face
        face = following[face]
    return found


@inner
def length_of(faces, uv, edge):
    """Of an edge in the plane."""
    face, i = edge // 3, edge % 3
    a, b = faces[face, i], faces[face, (i + 1) % 3]
    x, y = uv[b, 0] - uv[a, 0], uv[b, 1] - uv[a, 1]
    return np.sqrt(x * x + y * y)


@inner
def best_neighbour(sewing, mine, tried):
    """The chart no smaller and of one kind with that of faces [N] that shares the longest border with it, of
    those not tried [N]; -1 for none."""
    faces, uv, _, twin, opened, chart, size, kind = sewing
    own = chart[mine[0]]
    names, lengths, count = np.empty(3 * len(mine), np.int64), np.zeros(3 * len(mine)), 0
    for face in mine:
        for edge in range(3 * face, 3 * face + 3):
            if not opened[edge] or twin[edge] < 0:
                continue
            other = chart[twin[edge] // 3]
            if other == own or size[other] < size[own] or kind[other] != kind[own]:
                continue
            at = 0
            while at < count and names[at] != other:
                at += 1
            if at == count:
                names[at] = other
                count += 1
            lengths[at] += length_of(faces, uv, edge)
    best, longest = -1, 0.0
    for at in range(count):
        fresh = lengths[at] > longest
        for other in tried:
            fresh &= other != names[at]
        if fresh:
            best, longest = names[at], lengths[at]
    return best


@inner
def shared_edges(sewing, mine, target):
    """[N] edges of faces [N] of one chart with another one beyond."""
    _, _, _, twin, opened, chart, _, _ = sewing
    edges, count = np.empty(3 * len(mine), np.int64), 0
    for face in mine:
        for edge in range(3 * face, 3 * face + 3):
            if opened[edge] and twin[edge] >= 0 and chart[twin[edge] // 3] == target:
                edges[count] = edge
                count += 1
    return edges[:count]


@inner
def followers(faces, twin, edges):
    """[N] which of edges [N] begins where each ends, on both of its sides, -1 for none; and whether it is one
    that does."""
    following, led = np.full(len(edges), -1, np.int64), np.zeros(len(edges), np.bool_)
    for n in range(len(edges)):
        end, far = faces[edges[n] // 3, (edges[n] % 3 + 1) % 3], twin[edges[n]]
        for m in range(len(edges)):
            beyond = twin[edges[m]]
            ahead = m != n and faces[edges[m] // 3, edges[m] % 3] == end
            if ahead and faces[beyond // 3, (beyond % 3 + 1) % 3] == faces[far // 3, far % 3]:
                following[n], led[m] = m, True
    return following, led


@inner
def shared_path(sewing, mine, target):
    """[N] the edges of the longest way along which faces [N] of a chart and another one lie side by side, one
    after the other."""
    faces, uv, _, twin, _, _, _, _ = sewing
    edges = shared_edges(sewing, mine, target)
    following, led = followers(faces, twin, edges)
    best, longest = edges[:0], -1.0
    for first in range(2 * len(edges)):  # ways with a beginning, then rings
        n = first % len(edges)
        if led[n] != (first >= len(edges)):
            continue
        path, size, length, at = np.empty(len(edges), np.int64), 0, 0.0, n
        while at >= 0 and size < len(edges):
            path[size] = edges[at]
            size, length, at = size + 1, length + length_of(faces, uv, edges[at]), following[at]
            if at == n:
                break
        if length > longest:
            best, longest = path[:size], length
    return best


@inner
def ends_of(faces, twin, path):
    """Vertices [N] along a path on its own side and on the other; a ring begins and ends with the same. A
    path that meets itself on one side alone loses its last edge."""
    near, far = np.empty(len(path) + 1, np.int64), np.empty(len(path) + 1, np.int64)
    for n in range(len(path)):
        edge, other = path[n], twin[path[n]]
        near[n], far[n] = faces[edge // 3, edge % 3], faces[other // 3, (other % 3 + 1) % 3]
        near[n + 1], far[n + 1] = faces[edge // 3, (edge % 3 + 1) % 3], faces[other // 3, other % 3]
    size = len(near)
    while size > 2 and (near[0] == near[size - 1]) != (far[0] == far[size - 1]):
        size -= 1
    return near[:size], far[:size]
