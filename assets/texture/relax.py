"""Vertices of flat charts moved one by one until no face is turned over, by compiled loops.

Each face has the symmetric Dirichlet energy: a quarter of its area times |J|^2 + |J^-1|^2, where J maps it to
the plane; 1 a unit of area for a rigid map, and without bound as the face is pressed flat. With the bounded
denominator of Garanzha et al. 2021 ("Foldover-free maps in 50 lines of code") a face that is turned over has
an energy, too, and a way back.

Letters: W vertices, F faces, K corners of chosen vertices' faces, N chosen vertices.
"""

import numpy as np
from jaxtyping import Bool, Complex128

from assets.texture.flatten import Sheets
from avatargen.compiled import compiled, inner

SOFTNESS = (0.3, 0.1, 0.02)  # of the denominator, one after the other
SWEEPS = 15  # over the chosen vertices at most, for each of these
STILL = 0.01  # of a vertex's surroundings: a shorter step wakes no neighbour
HALVINGS = 6  # of a step that would gain nothing


def relax(
    sheets: Sheets, z: Complex128[np.ndarray, " W"], chosen: Bool[np.ndarray, " W"]
) -> Complex128[np.ndarray, " W"]:
    """The plane with the chosen vertices where their faces' energy is low, the others where they were."""
    mine = chosen[sheets.faces].any(axis=1)
    faces = sheets.faces[mine]
    if not len(faces):
        return z
    uv = np.stack([np.real(z), np.imag(z)], axis=1)
    corner = faces.reshape(-1)
    ring = np.argsort(corner, kind="stable")
    first = np.searchsorted(corner[ring], np.arange(len(z) + 1))
    local = sheets.local[mine]
    area = np.bincount(corner, np.repeat(sheets.areas[mine], 3), minlength=len(z))
    size = np.sqrt(area / np.maximum(np.diff(first), 1))
    for softness in SOFTNESS:
        sweep(uv, np.flatnonzero(chosen), faces, ring, first, local, size, softness)
    return uv @ np.array([1, 1j])


@inner
def energy(xx, yx, xy, yy, softness):
    """A unit of area of a face whose map has these entries, columns first; and its denominator, and the root
    in that."""
    area = xx * yy - xy * yx
    root = np.sqrt(area * area + softness * softness)
    bounded = 0.5 * (area + root)
    return 0.25 * (xx * xx + yx * yx + xy * xy + yy * yy) * (1 + 1 / (bounded * bounded)), bounded, root


@inner
def map_of(face, vertex, x, y, uv, faces, local):
    """Entries of a face's map, columns first, if one vertex were at (x, y); and the rates at which that
    vertex's moving moves the first column and the second."""
    a, b, c = faces[face, 0], faces[face, 1], faces[face, 2]
    length, place, height = local[face, 0], local[face, 1], local[face, 2]
    ax, ay = (x, y) if a == vertex else (uv[a, 0], uv[a, 1])
    bx, by = (x, y) if b == vertex else (uv[b, 0], uv[b, 1])
    cx, cy = (x, y) if c == vertex else (uv[c, 0], uv[c, 1])
    xx, yx = (bx - ax) / length, (by - ay) / length
    xy, yy = (cx - ax - place * xx) / height, (cy - ay - place * yx) / height
    if a == vertex:
        p, q = -1 / length, (place / length - 1) / height
    elif b == vertex:
        p, q = 1 / length, -place / (length * height)
    else:
        p, q = 0.0, 1 / height
    return xx, yx, xy, yy, p, q


@inner
def energy_at(vertex, x, y, uv, faces, ring, first, local, softness):
    """Of the faces around a vertex, if it were at (x, y)."""
    total = 0.0
    for k in range(first[vertex], first[vertex + 1]):
        face = ring[k] // 3
        xx, yx, xy, yy, _, _ = map_of(face, vertex, x, y, uv, faces, local)
        total += 0.5 * local[face, 0] * local[face, 2] * energy(xx, yx, xy, yy, softness)[0]
    return total


@inner
def newton_step(vertex, uv, faces, ring, first, local, softness, most):
    """The energy of the faces around a vertex, and the step towards the least value of the parabola that
    touches it, or downhill where it has none; at most so far."""
    total, gx, gy, hxx, hyy, hxy = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(first[vertex], first[vertex + 1]):
        face = ring[k] // 3
        xx, yx, xy, yy, p, q = map_of(face, vertex, uv[vertex, 0], uv[vertex, 1], uv, faces, local)
        value, bounded, root = energy(xx, yx, xy, yy, softness)
        weight = 0.125 * local[face, 0] * local[face, 2]
        squares = xx * xx + yx * yx + xy * xy + yy * yy
        sx, sy, ss = 2 * (p * xx + q * xy), 2 * (p * yx + q * yy), 2 * (p * p + q * q)
        dx, dy = p * yy - q * yx, q * xx - p * xy  # of the area, which is linear in the vertex
        slope, bend = bounded / root, 0.5 * softness * softness / (root * root * root)
        cube = bounded * bounded * bounded
        inverse = 1 + 1 / (bounded * bounded)
        first_order = -2 * slope / cube
        second = 6 * slope * slope / (cube * bounded) - 2 * bend / cube
        total += 4 * weight * value
        gx += weight * (sx * inverse + squares * first_order * dx)
        gy += weight * (sy * inverse + squares * first_order * dy)
        hxx += weight * (ss * inverse + 2 * sx * first_order * dx + squares * second * dx * dx)
        hyy += weight * (ss * inverse + 2 * sy * first_order * dy + squares * second * dy * dy)
        hxy += weight * ((sx * dy + sy * dx) * first_order + squares * second * dx * dy)
    area = hxx * hyy - hxy * hxy
    if hxx > 0 and hyy > 0 and area > 1e-6 * hxx * hyy:
        dx, dy = (hxy * gy - hyy * gx) / area, (hxy * gx - hxx * gy) / area
    else:
        dx, dy = -gx, -gy
    scale = min(1.0, most / max(np.sqrt(dx * dx + dy * dy), 1e-30))
    return total, dx * scale, dy * scale


@compiled
def sweep(uv, chosen, faces, ring, first, local, size, softness):
    """Move the chosen vertices [N] in `uv` [W 2], each to less energy of its own faces, again and again while
    it or a vertex beside it has moved.

    `ring` [K] are the corners of the faces [K / 3, 3], sorted by vertex, and `first` [W + 1] where each
    vertex's begin; `local` [K / 3, 3] are lengths of the faces' first edges, and along and across these where
    their third corners lie; `size` [W] the square roots of the mean areas around the vertices.
    """
    awake = np.ones(len(uv), np.bool_)
    for _ in range(SWEEPS):
        moved = False
        for vertex in chosen:
            if not awake[vertex]:
                continue
            awake[vertex] = False
            x, y = uv[vertex, 0], uv[vertex, 1]
            here, dx, dy = newton_step(vertex, uv, faces, ring, first, local, softness, size[vertex])
            for _ in range(HALVINGS):
                if energy_at(vertex, x + dx, y + dy, uv, faces, ring, first, local, softness) < here:
                    uv[vertex, 0], uv[vertex, 1] = x + dx, y + dy
                    if dx * dx + dy * dy > (STILL * size[vertex]) ** 2:
                        moved = True
                        for k in range(first[vertex], first[vertex + 1]):
                            for i in range(3):
                                awake[faces[ring[k] // 3, i]] = True
                    break
                dx, dy = 0.4 * dx, 0.4 * dy
        if not moved:
            break
