"""Move the vertices of a simplified surface so that its faces, not only its corners, lie on the zero level
of the field.

A flat face cuts a curved surface's corner; vertices that sit exactly on the surface put every face on its
inner side. Here each vertex i moves d_i along its normal so as to minimise, over points s spread on the
faces,

    sum_s area_s (f_s / slope + sum_i b_si (n_s . n_i) d_i)^2 + damping sum_i area_i d_i^2

with b the barycentric coordinates: a sparse positive system. The mesh keeps its faces; no face may turn.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64
from scipy.sparse import coo_array, csc_array, csr_array, diags_array
from scipy.sparse.linalg import splu

from assets.field import Field, ask
from assets.surface import Surface, directed_edges, edge_lengths, face_normals, vertex_normals

PATTERN = np.array([(4, 1, 1), (1, 4, 1), (1, 1, 4)]) / 6  # barycentric coordinates on every face
PROBE = 1e-3  # metres along the normal, for the field's slope
SLOPE_SAMPLES = 500
LARGEST_TURN = 0.5  # cosine of the angle a face may turn by


@dataclass(frozen=True, kw_only=True)
class FitConfig:
    """Three questions to the field a face and round."""

    rounds: int = 1
    damping: float = 0.2
    largest_move: float = 0.2  # of the shortest edge at the vertex


def fit(surface: Surface, sdf: Field, config: FitConfig | None = None) -> Surface:
    """The same faces on moved vertices, nearer to the zero level of `sdf` in the mean square over the area.

    Raises:
        FieldError: the field is NaN or infinite.
    """
    config = config or FitConfig()
    for _ in range(config.rounds):
        normals = vertex_normals(surface)
        residual = residuals(surface, sdf)
        move = best_moves(surface, normals, residual, config.damping)
        limit = np.minimum(config.largest_move * shortest_edges(surface), largest_residual(surface, residual))
        surface = move_safely(surface, normals * np.clip(move, -limit, limit)[:, None])
    return surface


def residuals(surface: Surface, sdf: Field) -> Float64[np.ndarray, "F S"]:
    """Distance from the zero level at the pattern's points of each face, to first order, metres."""
    flat = face_normals(surface)
    unit = flat / np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-300)
    points = np.einsum("sc,fcd->fsd", PATTERN, surface.vertices[surface.faces])
    value = ask(sdf, points.reshape(-1, 3)).reshape(points.shape[:2])
    return value / mean_slope(sdf, points[:, 0], unit, value[:, 0])


def largest_residual(surface: Surface, residual: Float64[np.ndarray, "F S"]) -> Float64[np.ndarray, " V"]:
    """The largest residual on the faces at each vertex, metres."""
    largest = np.zeros(len(surface.vertices))
    np.maximum.at(largest, surface.faces, np.abs(residual).max(axis=1, keepdims=True))
    return largest


def best_moves(
    surface: Surface,
    normals: Float64[np.ndarray, "V 3"],
    residual: Float64[np.ndarray, "F S"],
    damping: float,
) -> Float64[np.ndarray, " V"]:
    """The least-squares distances along the normals, metres."""
    F, S = residual.shape
    flat = face_normals(surface)
    area = np.linalg.norm(flat, axis=1)
    unit = flat / np.maximum(area, 1e-300)[:, None]
    facing = np.einsum("fcd,fd->fc", normals[surface.faces], unit)  # n_s . n_i
    entries = PATTERN[None] * facing[:, None]  # F S 3
    rows = np.broadcast_to(np.arange(F * S).reshape(F, S, 1), entries.shape)
    columns = np.broadcast_to(surface.faces[:, None], entries.shape)
    weight = diags_array(np.repeat(area / area.mean(), S))
    shape = (F * S, len(surface.vertices))
    matrix = csr_array(coo_array((entries.reshape(-1), (rows.reshape(-1), columns.reshape(-1))), shape=shape))
    normal_matrix = csr_array(matrix.T @ weight @ matrix)
    damped = normal_matrix + diags_array(damping * normal_matrix.diagonal() + 1e-9)
    factor = splu(csc_array(damped), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
    return -factor.solve(matrix.T @ (weight @ residual.reshape(-1)))


def mean_slope(
    sdf: Field,
    points: Float64[np.ndarray, "N 3"],
    normals: Float64[np.ndarray, "N 3"],
    value: Float64[np.ndarray, " N"],
) -> float:
    """Median rise of the field per metre along the normals, from a few evenly chosen points."""
    chosen = np.linspace(0, len(points) - 1, min(SLOPE_SAMPLES, len(points))).astype(np.int64)
    ahead = ask(sdf, points[chosen] + PROBE * normals[chosen])
    return max(float(np.median(ahead - value[chosen])) / PROBE, 1e-3)


def shortest_edges(surface: Surface) -> Float64[np.ndarray, " V"]:
    """Length of the shortest edge at each vertex, metres."""
    edges = directed_edges(surface.faces)
    length = edge_lengths(surface, edges)
    shortest = np.full(len(surface.vertices), np.inf)
    np.minimum.at(shortest, edges[:, 0], length)
    np.minimum.at(shortest, edges[:, 1], length)
    return np.where(np.isfinite(shortest), shortest, 0.0)


def move_safely(surface: Surface, move: Float64[np.ndarray, "V 3"]) -> Surface:
    """Move vertices, but leave in place those whose faces would turn too far."""
    before = face_normals(surface)
    move = move.copy()
    while True:
        moved = Surface(vertices=surface.vertices + move, faces=surface.faces)
        after = face_normals(moved)
        lengths = np.linalg.norm(before, axis=1) * np.linalg.norm(after, axis=1)
        turned = np.einsum("fd,fd->f", before, after) <= LARGEST_TURN * lengths
        turned &= np.abs(move[surface.faces]).max(axis=(1, 2)) > 0
        if not turned.any():
            return moved
        move[surface.faces[turned]] = 0.0
