"""Fewer faces by edge collapses in the order of their quadric errors (Garland and Heckbert 1997), on a closed
manifold mesh, which stays one.

A vertex's quadric is the sum over its faces' planes of area times squared distance, so that what is least is
the squared distance over the area, however unevenly faces are spread. An edge shrinks to the point of least
error; the little weight of its middle decides where the error leaves that open.

Edges wait in buckets, eight to a doubling of the error, which sorts them nearly as a heap would. As quadrics
only grow, an edge's error does, so it is enough to look at it again when its turn comes. An edge whose
collapse leaves a thin face thinner waits longer, as if its error were greater. A collapse is refused where it
would change the topology (the edge's ends share more than two neighbours), turn a face by too much or leave
one without area; it gets another turn when something beside it has collapsed.

Letters: V vertices, F faces, E directed edges; edge i of a face runs from its corner i to the next one, and a
pair is an edge in both directions.
"""

from dataclasses import dataclass

import numpy as np

from assets.mesh.connectivity import end_of, previous
from assets.mesh.surface import Surface, compact, opposite_edges
from avatargen.compiled import compiled, inner

# heights over longest edges, under which a face has no area to speak of, and its normal says nothing
NO_AREA, FLAT = 1e-4, 0.02
BUCKETS, PER_DOUBLING = 768, 8
SMALLEST = -84  # power of two of the error under which all are alike, square metres times square metres


@dataclass(frozen=True, kw_only=True)
class DecimateConfig:
    """What a collapse may do."""

    middle: float = 1e-4  # weight of an edge's middle, of that of its planes
    largest_turn: float = 0.2  # cosine of the angle that a face may turn by
    thin: float = 0.13  # height over longest edge, about 8 degrees, under which a new face counts against it


def decimate(surface: Surface, target_faces: int, config: DecimateConfig | None = None) -> Surface:
    """The surface at the number of faces, or one more; at more than that where nothing else may go, and the
    surface itself where it is not closed and manifold."""
    config = config or DecimateConfig()
    twin = opposite_edges(surface.faces, len(surface.vertices))
    if (twin < 0).any():
        return surface
    vertices = surface.vertices.copy()
    quadric = quadrics(vertices, surface.faces)
    limits = (config.middle, config.largest_turn, config.thin)
    faces = collapse(vertices, quadric, surface.faces, twin.astype(np.int32), target_faces, limits)
    return compact(vertices, faces)


@compiled
def quadrics(vertices, faces):
    """[V 10] the upper triangle of each vertex's symmetric 4 x 4 matrix, row by row."""
    quadric = np.zeros((len(vertices), 10))
    for face in range(len(faces)):
        a, b, c = faces[face]
        ax, ay, az = vertices[a]
        bx, by, bz = vertices[b, 0] - ax, vertices[b, 1] - ay, vertices[b, 2] - az
        cx, cy, cz = vertices[c, 0] - ax, vertices[c, 1] - ay, vertices[c, 2] - az
        x, y, z, square = cross(bx, by, bz, cx, cy, cz)
        weight = 0.5 / np.sqrt(max(square, 1e-300))  # of the normal, that is as long as twice the area
        d = -(x * (ax + (bx + cx) / 3) + y * (ay + (by + cy) / 3) + z * (az + (bz + cz) / 3))
        for corner in (a, b, c):
            quadric[corner, 0] += weight * x * x
            quadric[corner, 1] += weight * x * y
            quadric[corner, 2] += weight * x * z
            quadric[corner, 3] += weight * x * d
            quadric[corner, 4] += weight * y * y
            quadric[corner, 5] += weight * y * z
            quadric[corner, 6] += weight * y * d
            quadric[corner, 7] += weight * z * z
            quadric[corner, 8] += weight * z * d
            quadric[corner, 9] += weight * d * d
    return quadric


@inner(forceinline=True)
def best_point(quadric, vertices, u, v, middle):
    """The point of least error for two vertices, and that error."""
    xx, xy, xz = quadric[u, 0] + quadric[v, 0], quadric[u, 1] + quadric[v, 1], quadric[u, 2] + quadric[v, 2]
    yy, yz, zz = quadric[u, 4] + quadric[v, 4], quadric[u, 5] + quadric[v, 5], quadric[u, 7] + quadric[v, 7]
    xd, yd, zd = quadric[u, 3] + quadric[v, 3], quadric[u, 6] + quadric[v, 6], quadric[u, 8] + quadric[v, 8]
    held = middle * (xx + yy + zz) + 1e-300
    bx = 0.5 * held * (vertices[u, 0] + vertices[v, 0]) - xd
    by = 0.5 * held * (vertices[u, 1] + vertices[v, 1]) - yd
    bz = 0.5 * held * (vertices[u, 2] + vertices[v, 2]) - zd
    hx, hy, hz = xx + held, yy + held, zz + held  # a positive definite matrix with xy, xz, yz
    cxx, cxy, cxz = hy * hz - yz * yz, xz * yz - xy * hz, xy * yz - xz * hy
    cyy, cyz, czz = hx * hz - xz * xz, xy * xz - hx * yz, hx * hy - xy * xy
    scale = 1.0 / (hx * cxx + xy * cxy + xz * cxz)
    x = scale * (cxx * bx + cxy * by + cxz * bz)
    y = scale * (cxy * bx + cyy * by + cyz * bz)
    z = scale * (cxz * bx + cyz * by + czz * bz)
    error = quadric[u, 9] + quadric[v, 9] + xx * x * x + yy * y * y + zz * z * z
    return x, y, z, error + 2 * (xy * x * y + xz * x * z + yz * y * z + xd * x + yd * y + zd * z)


@inner(forceinline=True)
def bucket_of(error):
    """Where an edge of this error waits."""
    if not error > 0.0:
        return 0
    return min(max(int(PER_DOUBLING * (np.log2(error) - SMALLEST)), 0), BUCKETS - 1)


@inner(forceinline=True)
def may_join(start, twin, out, mark, stamp, u, v):
    """Whether an edge's ends share its two opposite vertices alone, and are not part of a tetrahedron."""
    neighbours, edge = 0, out[u]
    while True:
        mark[end_of(start, edge)] = stamp
        neighbours += 1
        edge = twin[previous(edge)]
        if edge == out[u]:
            break
    shared, others, edge = 0, 0, out[v]
    while True:
        shared += mark[end_of(start, edge)] == stamp
        others += 1
        edge = twin[previous(edge)]
        if edge == out[v]:
            return shared == 2 and max(neighbours, others) > 3


@inner(inline="always")
def cross(ax, ay, az, bx, by, bz):
    """The cross product, and its square."""
    x, y, z = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    return x, y, z, x * x + y * y + z * z


@inner(forceinline=True)
def spoils(vertices, start, twin, out, moved, other, x, y, z, limits):
    """By what the error counts more for the shape of the faces at a vertex that moves to a point, but for
    those at `other` too; infinitely more where one turns too far or loses its area."""
    _, largest_turn, thin = limits
    edge, worst = out[moved], 1.0
    while True:
        a, b = end_of(start, edge), start[previous(edge)]
        if a != other and b != other:
            ax, ay, az = vertices[a]
            bx, by, bz = vertices[b, 0] - ax, vertices[b, 1] - ay, vertices[b, 2] - az
            ox, oy, oz = vertices[moved, 0] - ax, vertices[moved, 1] - ay, vertices[moved, 2] - az
            nx, ny, nz = x - ax, y - ay, z - az
            base = bx * bx + by * by + bz * bz
            px, py, pz, before = cross(bx, by, bz, ox, oy, oz)
            qx, qy, qz, after = cross(bx, by, bz, nx, ny, nz)
            old = max(base, ox * ox + oy * oy + oz * oz)
            old = max(old, (ox - bx) ** 2 + (oy - by) ** 2 + (oz - bz) ** 2)
            new = max(base, nx * nx + ny * ny + nz * nz)
            new = max(new, (nx - bx) ** 2 + (ny - by) ** 2 + (nz - bz) ** 2)
            turned = px * qx + py * qy + pz * qz < largest_turn * np.sqrt(before * after)
            if turned and before > (FLAT * old) ** 2:
                return np.inf
            if after < (thin * new) ** 2 and after * old * old <= before * new * new:  # thinner than it was
                if after <= (NO_AREA * new) ** 2:
                    return np.inf
                worst = max(worst, (thin * new) ** 2 / after)
        edge = twin[previous(edge)]
        if edge == out[moved]:
            return worst


@inner(forceinline=True)
def push(number, error, first, following):
    """Let a pair wait in its bucket, which is returned."""
    bucket = bucket_of(error)
    following[number] = first[bucket]
    first[bucket] = number
    return bucket


@inner
def link(start, twin, out, pair, half):
    """Fill in an edge that leaves each vertex, the pair of each directed edge, and an edge of each pair."""
    number = 0
    for edge in range(len(start)):
        out[start[edge]] = edge
        if twin[edge] > edge:
            pair[edge] = pair[twin[edge]] = number
            half[number] = edge
            number += 1


@inner(forceinline=True)
def shrink(edge, opposite, start, twin, out, pair, half, alive):
    """Take an edge's two faces away and give the faces around its end to its start."""
    around, stop = out[end_of(start, edge)], out[end_of(start, edge)]
    while True:
        start[around] = start[edge]
        around = twin[previous(around)]
        if around == stop:
            break
    half[pair[edge]] = -1
    for gone in (edge, opposite):
        a, b = twin[gone - 2 if gone % 3 == 2 else gone + 1], twin[previous(gone)]
        half[pair[b]] = -1
        pair[b] = pair[a]
        half[pair[a]] = a
        twin[a], twin[b] = b, a
        out[start[a]], out[start[b]] = a, b
        alive[gone // 3] = False


@inner(forceinline=True)
def wake(u, vertices, quadric, start, twin, out, pair, waits, first, following, middle):
    """Let the edges at a vertex that were refused wait again; returns the lowest of their buckets."""
    lowest, around = BUCKETS, out[u]
    while True:
        number = pair[around]
        if not waits[number]:
            error = best_point(quadric, vertices, u, end_of(start, around), middle)[3]
            lowest = min(lowest, push(number, error, first, following))
            waits[number] = True
        around = twin[previous(around)]
        if around == out[u]:
            return lowest


@compiled
def collapse(vertices, quadric, faces, twin, target, limits):
    """The faces that are left; moves vertices, and changes quadrics and twins on the way."""
    start = faces.astype(np.int32).ravel()
    out, mark = np.zeros(len(vertices), np.int32), np.zeros(len(vertices), np.int32)
    pair, half = np.empty(len(start), np.int32), np.empty(len(start) // 2, np.int32)
    link(start, twin, out, pair, half)
    first, following = np.full(BUCKETS, -1, np.int32), np.empty(len(half), np.int32)
    waits, alive = np.ones(len(half), np.bool_), np.ones(len(faces), np.bool_)
    for number in range(len(half)):
        u, v = start[half[number]], end_of(start, half[number])
        push(number, best_point(quadric, vertices, u, v, limits[0])[3], first, following)
    lowest, tries, count = 0, 0, len(faces)
    while count > target and lowest < BUCKETS:
        number = first[lowest]
        if number < 0:
            lowest += 1
            continue
        first[lowest] = following[number]
        edge = half[number]
        if edge < 0:
            continue
        u, v = start[edge], end_of(start, edge)
        x, y, z, error = best_point(quadric, vertices, u, v, limits[0])
        if bucket_of(error) > lowest:  # its ends have grown meanwhile, which never makes the error less
            push(number, error, first, following)
            continue
        waits[number] = False
        tries += 1
        if not may_join(start, twin, out, mark, tries, u, v):
            continue
        spoilt = spoils(vertices, start, twin, out, u, v, x, y, z, limits)
        spoilt = max(spoilt, spoils(vertices, start, twin, out, v, u, x, y, z, limits))
        if spoilt == np.inf:
            continue
        if bucket_of(error * spoilt) > lowest:
            waits[number] = True
            push(number, error * spoilt, first, following)
            continue
        shrink(edge, np.int32(twin[edge]), start, twin, out, pair, half, alive)
        count -= 2
        vertices[u, 0], vertices[u, 1], vertices[u, 2] = x, y, z
        for term in range(10):
            quadric[u, term] += quadric[v, term]
        woken = wake(u, vertices, quadric, start, twin, out, pair, waits, first, following, limits[0])
        lowest = min(lowest, woken)
    return left(start, alive, count)


@inner
def left(start, alive, count):
    """[count 3] the faces that are alive."""
    faces, kept = np.empty((count, 3), np.int64), 0
    for face in range(len(alive)):
        if alive[face]:
            for corner in range(3):
                faces[kept, corner] = start[3 * face + corner]
            kept += 1
    return faces
