"""Small flat charts sewn onto charts beside them, as a facing is onto its hem: along the longest part of the
border that they share, or along one edge of it. Vertices around the new seam are moved until faces keep their
shapes; where one would lie over another, or would be pressed too much, nothing is sewn.

Letters: W vertices after the seams have split them, F faces, E directed edges, C charts, N faces, edges or
vertices of a few charts.
"""

import numpy as np
from jaxtyping import Int64

from assets.mesh.surface import Surface
from assets.texture.border import Sewing, best_neighbour, ends_of, faces_in, lists, shared_path
from assets.texture.clash import clash
from assets.texture.flat_cut import FlatCut
from assets.texture.flatten import local_frames
from assets.texture.relax import sweep
from assets.texture.seams import Cut
from avatargen.compiled import compiled, inner

MOST = 500  # faces of a chart that is sewn onto another
SOFTEST = 0.02  # of the denominator in a face's energy
PASSES = 2  # over all of them: what others have joined may have become a place to join
TRIES = 4  # neighbours of a chart,
WAYS = 2  # each along all of the border shared with it, and one edge
LEAST, LARGEST = 0.15, 5.0  # singular values that a face may come to have
WORSE = 0.9  # of the smaller one, of a face that had less
CLEAR = 5e-4  # metres between faces that were of two charts
TOUCHING = -1e-6  # metres between those that may share a vertex


def join_small(
    surface: Surface, flat: FlatCut, twin: Int64[np.ndarray, " E"], kind: Int64[np.ndarray, " C"]
) -> FlatCut:
    """Fewer charts: small ones are parts of larger ones of their kind, where these have room."""
    cut = flat.cut
    sewing = Sewing(
        faces=cut.faces.copy(),
        uv=np.stack([np.real(flat.z), np.imag(flat.z)], axis=1),
        local=local_frames(surface.vertices[cut.vertex_map], cut.faces),
        twin=twin,
        open=cut.open.copy(),
        chart=cut.chart.copy(),
        size=np.bincount(cut.chart),
        kind=kind,
    )
    small = np.flatnonzero(sewing.size <= MOST)
    order = small[np.argsort(sewing.size[small], kind="stable")]
    if not join_charts(sewing, np.tile(order, PASSES)):
        return flat
    named = np.unique(sewing.faces)
    number = np.zeros(len(cut.vertex_map), dtype=np.int64)
    number[named] = np.arange(len(named))
    whole = Cut(
        faces=number[sewing.faces],
        vertex_map=cut.vertex_map[named],
        chart=np.unique(sewing.chart, return_inverse=True)[1].astype(np.int64),
        open=sewing.open,
    )
    return FlatCut(cut=whole, z=sewing.uv[named] @ np.array([1, 1j]))


@compiled
def join_charts(sewing, order):
    """Sew each chart of `order` [N] that is still one of its own onto a neighbour; how many have been."""
    _, _, _, _, _, chart, size, _ = sewing
    head, tail, following = lists(chart, len(size))
    alias, number, count = np.arange(len(sewing.uv)), np.full(len(sewing.uv), -1, np.int64), 0
    for one in order:
        if size[one] == 0 or size[one] > MOST:
            continue
        mine, tried = faces_in(head[one], following, size[one]), np.full(TRIES, -1, np.int64)
        target, found, attempt = -1, False, 0
        while not found and attempt < WAYS * TRIES:
            if attempt % WAYS == 0:
                target = best_neighbour(sewing, mine, tried)
                if target < 0:
                    break
                tried[attempt // WAYS] = target
                others, path = (
                    faces_in(head[target], following, size[target]),
                    shared_path(sewing, mine, target),
                )
            length = len(path) if attempt % WAYS == 0 else 1
            attempt += 1
            middle = path[(len(path) - length) // 2 :][:length]
            found = sew_on(sewing, mine, others, middle, alias, number)
        if found:
            for face in mine:
                chart[face] = target
            following[tail[target]], tail[target] = head[one], tail[one]
            size[target], size[one] = size[target] + size[one], 0
            count += 1
    return count


@inner
def sew_on(sewing, mine, others, path, alias, number):
    """Lay faces [N] of a chart beside others [N] with the edges `path` [N] as one with those beyond, whose
    vertices take the place of their own; whether that could be done. `alias` and `number` [W] are working
    memory: each vertex's own number, and -1."""
    faces, before, _, twin, opened, _, _, _ = sewing
    near, far = ends_of(faces, twin, path)
    for n in range(len(near)):
        alias[near[n]] = far[n]
    around, named, rest = seam_faces(faces, mine, others, alias, far)
    vertices, corners, uv = placed(faces, before, len(mine), around, named, near, far, number)
    local = np.empty((len(around), 3))
    for n in range(len(around)):
        for k in range(3):
            local[n, k] = sewing.local[around[n], k]
    relax_around(local, corners, uv, len(mine))
    done = keeps_shape(faces, before, local, around, corners, uv) and is_clear(
        faces, before, corners, uv, len(mine), rest
    )
    if done:
        for n in range(len(vertices)):
            before[vertices[n], 0], before[vertices[n], 1] = uv[n, 0], uv[n, 1]
        for n in range(len(mine)):
            for k in range(3):
                faces[mine[n], k] = named[n, k]
        for n in range(len(near) - 1):
            opened[path[n]] = opened[twin[path[n]]] = False
    for vertex in near:
        alias[vertex] = vertex
    return done


@inner
def placed(faces, before, own, around, named, near, far, number):
    """Where faces around a seam lie, before any is relaxed: their vertices [N], which of these their corners
    [N 3] are, and the place of each [N 2]. The first ones, `own`, are moved as they are but for the seam."""
    ax, ay, bx, by, count = 0.0, 0.0, 0.0, 0.0, len(near)
    for n in range(count):
        ax, ay = ax + before[near[n], 0] / count, ay + before[near[n], 1] / count
        bx, by = bx + before[far[n], 0] / count, by + before[far[n], 1] / count
    c, s = 0.0, 0.0
    for n in range(count):
        ux, uy = before[near[n], 0] - ax, before[near[n], 1] - ay
        vx, vy = before[far[n], 0] - bx, before[far[n], 1] - by
        c, s = c + ux * vx + uy * vy, s + ux * vy - uy * vx
    length = max(np.sqrt(c * c + s * s), 1e-30)
    c, s = c / length, s / length
    vertices, uv = np.empty(3 * len(around), np.int64), np.empty((3 * len(around), 2))
    corners, count = np.empty((len(around), 3), np.int64), 0
    for n in range(len(around)):
        for k in range(3):
            vertex = named[n, k]
            if number[vertex] < 0:
                number[vertex], vertices[count] = count, vertex
                x, y = before[vertex, 0], before[vertex, 1]
                if n < own and faces[around[n], k] == vertex:
                    x, y = x - ax, y - ay
                    x, y = bx + c * x - s * y, by + s * x + c * y
                uv[count, 0], uv[count, 1] = x, y
                count += 1
            corners[n, k] = number[vertex]
    for n in range(count):
        number[vertices[n]] = -1
    return vertices[:count], corners, uv[:count]


@inner
def relax_around(local, corners, uv, own):
    """Move the vertices of the first `own` of faces [N] with frames [N 3] and corners [N 3] in `uv` [N 2] to
    where all these faces' energy is low."""
    chosen, first = np.zeros(len(uv), np.bool_), np.zeros(len(uv) + 1, np.int64)
    size = np.zeros(len(uv))
    for n in range(len(corners)):
        for k in range(3):
            v = corners[n, k]
            first[v + 1] += 1
            size[v] += 0.5 * local[n, 0] * local[n, 2]
            chosen[v] |= n < own
    moving, count = np.empty(len(uv), np.int64), 0
    for v in range(len(uv)):
        size[v] = np.sqrt(size[v] / max(first[v + 1], 1))
        first[v + 1] += first[v]
        if chosen[v]:
            moving[count] = v
            count += 1
    ring, filled = np.empty(3 * len(corners), np.int64), first[:-1].copy()
    for n in range(len(corners)):
        for k in range(3):
            ring[filled[corners[n, k]]] = 3 * n + k
            filled[corners[n, k]] += 1
    sweep(uv, moving[:count], corners, ring, first, local, size, SOFTEST)


@inner
def keeps_shape(faces, before, local, around, corners, uv):
    """Whether faces [N] with frames [N 3] and corners [N 3] are not pressed much more than before."""
    for n in range(len(around)):
        a, b, c = faces[around[n], 0], faces[around[n], 1], faces[around[n], 2]
        small, large = smaller_and_larger(local[n], uv, corners[n, 0], corners[n, 1], corners[n, 2])
        was, _ = smaller_and_larger(local[n], before, a, b, c)
        if small < min(LEAST, WORSE * was) or small <= 0 or large > LARGEST:
            return False
    return True


@inner
def is_clear(faces, before, corners, uv, own, rest):
    """Whether faces with corners [N 3] lie over no other of them or of `rest` [N], the first ones, `own`,
    with some room."""
    here, there = np.empty((len(corners), 3, 2)), np.empty((len(rest), 3, 2))
    for n in range(len(corners)):
        for k in range(3):
            here[n, k, 0], here[n, k, 1] = uv[corners[n, k], 0], uv[corners[n, k], 1]
    for n in range(len(rest)):
        for k in range(3):
            vertex = faces[rest[n], k]
            there[n, k, 0], there[n, k, 1] = before[vertex, 0], before[vertex, 1]
    return not clash(here, there, own, CLEAR, TOUCHING)


@inner
def smaller_and_larger(frame, uv, a, b, c):
    """Singular values of the map from a face with a frame [3] to its corners' places in the plane."""
    xx, yx = (uv[b, 0] - uv[a, 0]) / frame[0], (uv[b, 1] - uv[a, 1]) / frame[0]
    xy, yy = (
        (uv[c, 0] - uv[a, 0] - frame[1] * xx) / frame[2],
        (uv[c, 1] - uv[a, 1] - frame[1] * yx) / frame[2],
    )
    plus = np.sqrt((xx + yy) * (xx + yy) + (yx - xy) * (yx - xy))
    minus = np.sqrt((xx - yy) * (xx - yy) + (yx + xy) * (yx + xy))
    return 0.5 * (plus - minus), 0.5 * (plus + minus)


@inner
def seam_faces(faces, mine, others, alias, far):
    """Faces around a seam: all of a chart's [N], then those of others [N] with a vertex of `far` [N]; as
    indices, and their vertices under the names that `alias` [W] gives; and the rest of the others."""
    mark = np.zeros(len(alias), np.bool_)
    for vertex in far:
        mark[vertex] = True
    around, rest = np.empty(len(mine) + len(others), np.int64), np.empty(len(others), np.int64)
    count, left = len(mine), 0
    for n in range(count):
        around[n] = mine[n]
    for face in others:
        if mark[faces[face, 0]] or mark[faces[face, 1]] or mark[faces[face, 2]]:
            around[count] = face
            count += 1
        else:
            rest[left] = face
            left += 1
    named = np.empty((count, 3), np.int64)
    for n in range(count):
        for k in range(3):
            named[n, k] = alias[faces[around[n], k]]
    return around[:count], named, rest[:left]
