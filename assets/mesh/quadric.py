"""Quadrics: the squared distance to planes, summed with weights, as a function of the place (Garland and
Heckbert 1997).

The plane with unit normal n through p is the row vector q = (n, -n . p). A place x, written as (x, 1), has
the squared distance (q . (x, 1))^2 from it. So a sum over planes is one symmetric 4 x 4 matrix Q = sum w q^T
q, and the error at x is (x, 1) Q (x, 1)^T: square metres times the unit of the weights w, here areas in
square metres.

Compiled loops keep the ten numbers of Q's upper triangle, row by row: xx xy xz xd yy yz yd zz zd dd.

Letters: V vertices, F faces, N planes or places.
"""

import numpy as np
from jaxtyping import Float64

from avatargen.compiled import compiled, inner

TERMS = 10  # of the upper triangle
TINY = 1e-300  # keeps divisions finite where there is no area


@inner(inline="always")
def cross(ax, ay, az, bx, by, bz):
    """The cross product a x b, and its square."""
    x, y, z = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    return x, y, z, x * x + y * y + z * z


@compiled
def face_quadrics(vertices, faces):
    """[V 10] the quadric of each vertex, over the planes of its faces, weighted by their whole areas.

    Vertices [V 3] in metres, faces [F 3].
    """
    quadric = np.zeros((len(vertices), TERMS))
    for face in range(len(faces)):
        a, b, c = faces[face]
        ax, ay, az = vertices[a]
        bx, by, bz = vertices[b, 0] - ax, vertices[b, 1] - ay, vertices[b, 2] - az
        cx, cy, cz = vertices[c, 0] - ax, vertices[c, 1] - ay, vertices[c, 2] - az
        x, y, z, square = cross(bx, by, bz, cx, cy, cz)
        weight = 0.5 / np.sqrt(max(square, TINY))  # of the normal, which is as long as twice the area
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
    """The place of least error for vertices u and v together (x, y, z in metres), and that error.

    Where the planes leave it open, the middle of u and v decides: it weighs `middle` times what the planes
    do.
    """
    xx, xy, xz = quadric[u, 0] + quadric[v, 0], quadric[u, 1] + quadric[v, 1], quadric[u, 2] + quadric[v, 2]
    yy, yz, zz = quadric[u, 4] + quadric[v, 4], quadric[u, 5] + quadric[v, 5], quadric[u, 7] + quadric[v, 7]
    xd, yd, zd = quadric[u, 3] + quadric[v, 3], quadric[u, 6] + quadric[v, 6], quadric[u, 8] + quadric[v, 8]
    weight = middle * (xx + yy + zz) + TINY
    bx = 0.5 * weight * (vertices[u, 0] + vertices[v, 0]) - xd
    by = 0.5 * weight * (vertices[u, 1] + vertices[v, 1]) - yd
    bz = 0.5 * weight * (vertices[u, 2] + vertices[v, 2]) - zd
    hx, hy, hz = xx + weight, yy + weight, zz + weight  # a positive definite matrix with xy, xz, yz
    cxx, cxy, cxz = hy * hz - yz * yz, xz * yz - xy * hz, xy * yz - xz * hy  # its cofactors
    cyy, cyz, czz = hx * hz - xz * xz, xy * xz - hx * yz, hx * hy - xy * xy
    scale = 1.0 / (hx * cxx + xy * cxy + xz * cxz)
    x = scale * (cxx * bx + cxy * by + cxz * bz)
    y = scale * (cxy * bx + cyy * by + cyz * bz)
    z = scale * (cxz * bx + cyz * by + czz * bz)
    error = quadric[u, 9] + quadric[v, 9] + xx * x * x + yy * y * y + zz * z * z
    return x, y, z, error + 2 * (xy * x * y + xz * x * z + yz * y * z + xd * x + yd * y + zd * z)


def plane_quadrics(
    points: Float64[np.ndarray, "N 3"],
    normals: Float64[np.ndarray, "N 3"],
    weights: Float64[np.ndarray, " N"],
) -> Float64[np.ndarray, "N 4 4"]:
    """The whole matrices of planes through points (metres) with unit normals."""
    planes = np.concatenate([normals, -np.einsum("nd,nd->n", points, normals)[:, None]], axis=1)
    return weights[:, None, None] * planes[:, :, None] * planes[:, None, :]


def errors_at(
    quadrics: Float64[np.ndarray, "N 4 4"], points: Float64[np.ndarray, "N 3"]
) -> Float64[np.ndarray, " N"]:
    """The error of each quadric at its point (metres)."""
    places = np.concatenate([points, np.ones((len(points), 1))], axis=1)
    return np.einsum("ni,nij,nj->n", places, quadrics, places)
