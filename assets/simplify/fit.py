"""Move the vertices of a simplified surface so that its faces, not only its corners, lie on the zero level
of the field, creases included.

A flat face cuts a curved surface's corner; vertices that sit exactly on the surface put every face on its
inner side. Here the vertices i move by d_i, in any direction, so as to minimise, over points s spread on the
faces and the field's tangent planes there (unit normal n_s, distance r_s),

    sum_s area_s (r_s + n_s . sum_i b_si d_i)^2 + damping sum_i weight_i |d_i|^2

with b the barycentric coordinates. Where the planes around a vertex differ, the sum is least on the crease
where they meet, as in dual contouring (Ju et al. 2002); where they nearly agree, the vertex slides to where
its faces serve best, and the damping keeps it from going far for nothing. The mesh keeps its faces; no face
may turn or become thin.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64
from scipy.sparse import bsr_array, csr_array, diags_array
from scipy.sparse.linalg import cg

from assets.field import Field, ask
from assets.mesh.surface import Surface, directed_edges, edge_lengths, face_normals, spoilt

PATTERN = np.array([(4, 1, 1), (1, 4, 1), (1, 1, 4)]) / 6  # barycentric coordinates on every face
INDICES = np.arange(3, dtype=np.int32)  # 32 bits hold a hundred million faces, in half the memory
PROBE = 1e-3  # metres along the normal, for the field's slope
STEP = 2.5e-4  # metres, of the finite differences on uneven faces
STEEPEST = 1.5  # slope along a face, of that across it, that is still believed
FLATTEST = 0.2  # slope of the field, of its median, under which it says nothing about distance
STRAY = 1e-3  # of a face's size that its three points may lie from a line
HALVINGS = 3  # of a move that spoils a face, before it is given up
SOLVE = {"rtol": 1e-3, "maxiter": 60}  # a thousandth of the moves is far below what they leave


@dataclass(frozen=True, kw_only=True)
class FitConfig:
    """Four questions to the field a face and round, nine more where a face is uneven."""

    rounds: int = 1
    damping: float = 1e-4  # enough to solve for; more holds vertices where sliding would serve
    damping_where_uneven: float = 0.01  # there the planes tell little of what a vertex would slide to
    largest_move: float = 0.3  # of the shortest edge at the vertex, or ...
    overshoot: float = 1.5  # ... of the largest residual there: an edge is farther than its faces
    uneven: float = (
        0.4  # slope along a face, of that across it, from which each of its points has its own plane
    )
    largest_turn: float = 0.5  # cosine of the angle a face may turn by
    thin: float = 6.0  # degrees under which no angle may shrink


@dataclass(frozen=True, kw_only=True)
class Planes:
    """The field's tangent planes at the pattern's points of each face."""

    normals: Float64[np.ndarray, "F 3 3"]
    residuals: Float64[np.ndarray, "F 3"]  # metres from the plane to the point
    uneven: Bool[np.ndarray, " F"]  # whether a face's planes differ


def fit(surface: Surface, sdf: Field, config: FitConfig | None = None) -> Surface:
    """The same faces on moved vertices, nearer to the zero level of `sdf` (metres) in the mean square over
    the area.

    Raises:
        FieldError: the field is NaN or infinite.
    """
    config = config or FitConfig()
    for _ in range(config.rounds):
        planes = tangent_planes(surface, sdf, config.uneven)
        damping = np.full(len(surface.vertices), config.damping)
        damping[surface.faces[planes.uneven]] = config.damping_where_uneven
        move = best_moves(surface, planes, damping)
        limit = np.maximum(
            config.largest_move * shortest_edges(surface),
            config.overshoot * largest_residuals(surface, planes),
        )
        length = np.linalg.norm(move, axis=1)
        move *= np.minimum(1.0, limit / np.maximum(length, 1e-12))[:, None]
        surface = move_safely(surface, move, config)
    return surface


def largest_residuals(surface: Surface, planes: Planes) -> Float64[np.ndarray, " V"]:
    """The largest distance from the planes on the faces at each vertex, metres."""
    largest = np.zeros(len(surface.vertices))
    np.maximum.at(largest, surface.faces, np.abs(planes.residuals).max(axis=1, keepdims=True))
    return largest


def tangent_planes(surface: Surface, sdf: Field, uneven: float) -> Planes:
    """One gradient a face, from its three points and a fourth above; one a point where that shows a bend."""
    corners = surface.vertices[surface.faces]
    points = np.einsum("sc,fcd->fsd", PATTERN, corners)
    value = ask(sdf, points.reshape(-1, 3)).reshape(points.shape[:2])
    normal = face_normals(surface)
    normal = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    across = (ask(sdf, points[:, 0] + PROBE * normal) - value[:, 0]) / PROBE
    along = in_plane_gradients(points, value)
    steep = np.linalg.norm(along, axis=1)
    along *= np.minimum(1.0, STEEPEST * np.abs(across) / np.maximum(steep, 1e-12))[:, None]
    gradient = np.repeat((along + across[:, None] * normal)[:, None], len(PATTERN), axis=1)
    bent = steep > uneven * np.abs(across)
    gradient[bent] = gradients(sdf, points[bent], value[bent])
    slope = np.linalg.norm(gradient, axis=2)
    flattest = max(FLATTEST * float(np.median(slope)), 1e-12)
    return Planes(
        normals=gradient / np.maximum(slope, 1e-12)[..., None],
        residuals=value / np.maximum(slope, flattest),
        uneven=bent,
    )


def in_plane_gradients(
    points: Float64[np.ndarray, "F 3 3"], value: Float64[np.ndarray, "F 3"]
) -> Float64[np.ndarray, "F 3"]:
    """The gradient within the plane of each three points; of a line, along it."""
    sides, change = points[:, 1:] - points[:, :1], value[:, 1:] - value[:, :1]
    square = np.einsum("fid,fjd->fij", sides, sides)
    size = np.maximum(np.trace(square, axis1=1, axis2=2), 1e-300)
    square = square / size[:, None, None] + STRAY * np.eye(2)
    share = np.linalg.solve(square, (change / size[:, None])[..., None])[..., 0]
    return np.einsum("fi,fid->fd", share, sides)


def gradients(
    sdf: Field, points: Float64[np.ndarray, "N S 3"], value: Float64[np.ndarray, "N S"]
) -> Float64[np.ndarray, "N S 3"]:
    """By forward differences."""
    ahead = ask(sdf, (points[..., None, :] + STEP * np.eye(3)).reshape(-1, 3))
    return (ahead.reshape(points.shape) - value[..., None]) / STEP


def best_moves(
    surface: Surface, planes: Planes, damping: Float64[np.ndarray, " V"]
) -> Float64[np.ndarray, "V 3"]:
    """The least-squares moves, metres, by conjugate gradients.

    A vertex on a flat part is held across it alone, so its three equations differ a hundredfold in weight:
    solved together for each vertex first (block Jacobi), the rest takes a tenth of the steps.
    """
    faces, size = surface.faces, 3 * len(surface.vertices)
    area = np.linalg.norm(face_normals(surface), axis=1)
    weight = np.repeat(area / max(area.mean(), 1e-300), len(PATTERN))
    entries = PATTERN[None, :, :, None] * planes.normals[:, :, None, :]  # F S 3 3
    columns = np.broadcast_to(3 * faces.astype(np.int32)[:, None, :, None] + INDICES, entries.shape)
    ends = np.arange(len(weight) + 1, dtype=np.int32) * entries[0, 0].size
    matrix = csr_array((entries.reshape(-1), columns.reshape(-1), ends), shape=(len(weight), size))
    square = csr_array(matrix.T @ diags_array(weight) @ matrix)
    held = np.repeat(square.diagonal().reshape(-1, 3).sum(axis=1) * damping, 3) / 3 + 1e-9
    system = (square + diags_array(held)).tobsr((3, 3))
    wanted = -(matrix.T @ (weight * planes.residuals.reshape(-1)))
    return cg(system, wanted, M=block_jacobi(system), **SOLVE)[0].reshape(-1, 3)


def block_jacobi(system: bsr_array) -> bsr_array:
    """The block Jacobi preconditioner: the inverse of each 3 x 3 block on the diagonal."""
    count = len(system.indptr) - 1
    row = np.repeat(np.arange(count), np.diff(system.indptr))
    blocks = np.linalg.inv(system.data[system.indices == row])
    return bsr_array((blocks, np.arange(count), np.arange(count + 1)), shape=system.shape)


def shortest_edges(surface: Surface) -> Float64[np.ndarray, " V"]:
    """Length of the shortest edge at each vertex, metres."""
    edges = directed_edges(surface.faces)
    length = edge_lengths(surface, edges)
    shortest = np.full(len(surface.vertices), np.inf)
    np.minimum.at(shortest, edges[:, 0], length)
    np.minimum.at(shortest, edges[:, 1], length)
    return np.where(np.isfinite(shortest), shortest, 0.0)


def move_safely(surface: Surface, move: Float64[np.ndarray, "V 3"], config: FitConfig) -> Surface:
    """Move vertices, but less, and in the end not at all, where faces would turn too far or get too thin."""
    move = move.copy()
    held = np.ones(len(move), dtype=bool)  # whose moves have changed since their faces were looked at
    for halving in range(len(move) + HALVINGS):
        near = surface.faces[held[surface.faces].any(axis=1)]
        before, after = surface.vertices[near], (surface.vertices + move)[near]
        wrong = spoilt(before, after, config.largest_turn, config.thin) & (move[near] != 0).any(axis=(1, 2))
        if not wrong.any():
            break
        held = np.zeros(len(move), dtype=bool)
        held[near[wrong]] = True
        move[held] *= 0.5 if halving < HALVINGS else 0.0
    return Surface(vertices=surface.vertices + move, faces=surface.faces)
