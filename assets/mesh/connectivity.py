"""What is connected to what in a triangle mesh: compiled loops behind `surface`, linear in the mesh.

Letters: V vertices, F faces, E directed edges; edge i of a face runs from its corner i to the next one.
"""

import numpy as np

from avatargen.compiled import compiled, inner


@inner(inline="always")
def end_of(flat, edge):
    """The vertex that a directed edge leads to."""
    return flat[edge - 2] if edge % 3 == 2 else flat[edge + 1]


@inner(inline="always")
def previous(edge):
    """The edge before this one around its face."""
    return edge + 2 if edge % 3 == 0 else edge - 1


@inner
def ordered(order, keys, count):
    """An order sorted by the keys of what it names, 0 to count - 1; equal keys keep theirs."""
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
    """[E] for each directed edge its one opposite; -1 where it has none or several or is itself repeated."""
    flat = faces.ravel()
    low, high = np.empty(len(flat), np.int32), np.empty(len(flat), np.int32)
    for edge in range(len(flat)):
        start, end = flat[edge], end_of(flat, edge)
        low[edge], high[edge] = min(start, end), max(start, end)
    order = ordered(ordered(np.arange(len(flat), dtype=np.int32), high, vertex_count), low, vertex_count)
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
    """Vertices without faces or with faces in several fans."""
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
            edge = twin[previous(edge)]  # to the next face of the fan
            if edge < 0 or edge == first[vertex]:
                break
        split += visited != degree[vertex] or visited == 0
    return split


@compiled
def label(faces, vertex_count):
    """The number of connected components, and [V] the component of each vertex, by their first vertices."""
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
