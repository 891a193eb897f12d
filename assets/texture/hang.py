"""Small flat charts hung onto charts beside them: moved as they are until an edge of theirs lies on the same
edge of a neighbour, where that lays none over the other.

Letters: W vertices after the seams have split them, F faces, E directed edges, C charts, N some of them.
"""

import numpy as np
from jaxtyping import Int64

from assets.mesh.surface import Surface
from assets.texture.flat_cut import FlatCut, means_at
from assets.texture.seams import cut_open
from avatargen.compiled import compiled, inner

MOST = 12  # faces of a chart that is hung onto another
LONGER = 1.25  # times as long as the other may one of two edges be that become one
SMALLER = 0.5  # of its area that a face at such an edge keeps at least
CLEAR = 2e-3  # metres between it and what does not touch that edge
TOUCHING = -1e-5  # metres between it and what does


def hang_together(
    surface: Surface, flat: FlatCut, twin: Int64[np.ndarray, " E"], kind: Int64[np.ndarray, " C"]
) -> FlatCut:
    """Fewer charts: small ones are parts of larger ones of their kind, if any edge between these allows."""
    cut = flat.cut
    corners = np.stack([np.real(flat.z), np.imag(flat.z)], axis=1)[cut.faces]
    size = np.bincount(cut.chart)
    small = np.flatnonzero(size <= MOST)
    order = small[np.argsort(size[small], kind="stable")]
    hinges = np.empty(len(order), dtype=np.int64)
    count = hang(corners, twin, cut.open, cut.chart.copy(), size, kind, order, hinges)
    if not count:
        return flat
    opened = cut.open.copy()
    opened[hinges[:count]] = opened[twin[hinges[:count]]] = False
    whole = cut_open(surface.faces, twin, opened)
    z = means_at(whole.faces, corners[..., 0] + 1j * corners[..., 1], len(whole.vertex_map))
    return FlatCut(cut=whole, z=z)


@inner
def apart(one, other, least):
    """Whether a line along an edge of one of two triangles [3 2] parts them by at least so much."""
    for which in range(2):
        a, b = (one, other) if which == 0 else (other, one)
        for i in range(3):
            j = (i + 1) % 3
            nx, ny = a[j, 1] - a[i, 1], a[i, 0] - a[j, 0]  # outward, counter-clockwise as they are
            length = max(np.sqrt(nx * nx + ny * ny), 1e-30)
            gap = np.inf
            for k in range(3):
                gap = min(gap, (nx * (b[k, 0] - a[i, 0]) + ny * (b[k, 1] - a[i, 1])) / length)
            if gap >= least:
                return True
    return False


@inner
def touches(triangle, x, y):
    """Whether (x, y) is a corner of a triangle [3 2]."""
    found = False
    for i in range(3):
        found |= triangle[i, 0] == x and triangle[i, 1] == y
    return found


@inner
def doubled(triangle):
    """Twice the area of a triangle [3 2], negative where it is turned over."""
    ux, uy = triangle[1, 0] - triangle[0, 0], triangle[1, 1] - triangle[0, 1]
    return ux * (triangle[2, 1] - triangle[0, 1]) - uy * (triangle[2, 0] - triangle[0, 0])


@inner
def lay_beside(mine, corners, edge, other, moved):
    """Write faces [N] as they lie with one of their edges on another face's into `moved` [N 3 2]; whether
    that changes none of them much."""
    face, i, beyond, j = edge // 3, edge % 3, other // 3, other % 3
    sx, sy = corners[face, i]
    ex, ey = corners[face, (i + 1) % 3]
    ux, uy = ex - sx, ey - sy
    tx, ty = corners[beyond, (j + 1) % 3]
    fx, fy = corners[beyond, j]
    vx, vy = fx - tx, fy - ty
    was, now = np.sqrt(ux * ux + uy * uy), np.sqrt(vx * vx + vy * vy)
    if was * LONGER < now or now * LONGER < was or was == 0:
        return False
    c, s = (vx * ux + vy * uy) / (was * now), (vy * ux - vx * uy) / (was * now)
    for n in range(len(mine)):
        changed = False
        for k in range(3):
            x, y = corners[mine[n], k]
            if x == sx and y == sy:
                moved[n, k, 0], moved[n, k, 1], changed = tx, ty, True
            elif x == ex and y == ey:
                moved[n, k, 0], moved[n, k, 1], changed = fx, fy, True
            else:
                x, y = x - sx - 0.5 * ux, y - sy - 0.5 * uy
                moved[n, k, 0], moved[n, k, 1] = tx + 0.5 * vx + c * x - s * y, ty + 0.5 * vy + s * x + c * y
        if changed and doubled(moved[n]) < SMALLER * doubled(corners[mine[n]]):
            return False
    return True


@inner
def has_room(moved, corners, head, following, tx, ty, vx, vy):
    """Whether faces [N 3 2] lie clear of those of the list that begins at `head`, where the ends of the edge
    between them are at t and v."""
    left, right, low, high = np.inf, -np.inf, np.inf, -np.inf
    for n in range(len(moved)):
        for k in range(3):
            left, right = min(left, moved[n, k, 0] - CLEAR), max(right, moved[n, k, 0] + CLEAR)
            low, high = min(low, moved[n, k, 1] - CLEAR), max(high, moved[n, k, 1] + CLEAR)
    face = head
    while face >= 0:
        other = corners[face]
        if (
            max(other[0, 0], other[1, 0], other[2, 0]) > left
            and min(other[0, 0], other[1, 0], other[2, 0]) < right
            and max(other[0, 1], other[1, 1], other[2, 1]) > low
            and min(other[0, 1], other[1, 1], other[2, 1]) < high
        ):
            beside = touches(other, tx, ty) or touches(other, vx, vy)
            for n in range(len(moved)):
                near = beside and (touches(moved[n], tx, ty) or touches(moved[n], vx, vy))
                if not apart(moved[n], other, TOUCHING if near else CLEAR):
                    return False
        face = following[face]
    return True


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
def edges_of(mine, one, corners, twin, opened, chart):
    """The edges between faces [N] of one chart and others, the longest first."""
    edges, lengths, count = np.empty(3 * len(mine), np.int64), np.empty(3 * len(mine)), 0
    for face in mine:
        for i in range(3):
            edge = 3 * face + i
            if opened[edge] and twin[edge] >= 0 and chart[twin[edge] // 3] != one:
                x, y = corners[face, (i + 1) % 3] - corners[face, i]
                edges[count], lengths[count] = edge, -(x * x + y * y)
                count += 1
    return edges[np.argsort(lengths[:count])]


@compiled
def hang(corners, twin, opened, chart, size, kind, order, hinges):
    """Move the `corners` [F 3 2] of the charts in `order` [N], and give their faces' `chart` [F] the number
    of that onto which they are hung, one of no smaller `size` [C] and the same `kind` [C]; writes the edges
    between into `hinges` [N] and returns how many there are."""
    head, tail, following = lists(chart, len(size))
    count = 0
    for one in order:
        mine = np.empty(size[one], np.int64)
        n, face = 0, head[one]
        while face >= 0:
            mine[n] = face
            n, face = n + 1, following[face]
        moved = np.empty((n, 3, 2))
        for edge in edges_of(mine, one, corners, twin, opened, chart):
            other = twin[edge]
            target = chart[other // 3]
            if size[target] < size[one] or kind[target] != kind[one]:
                continue
            if not lay_beside(mine, corners, edge, other, moved):
                continue
            tx, ty = corners[other // 3, (other % 3 + 1) % 3]
            vx, vy = corners[other // 3, other % 3]
            if not has_room(moved, corners, head[target], following, tx, ty, vx, vy):
                continue
            for i in range(n):
                corners[mine[i]] = moved[i]
                chart[mine[i]] = target
            following[tail[target]], tail[target] = head[one], tail[one]
            size[target] += n
            hinges[count] = edge
            count += 1
            break
    return count
