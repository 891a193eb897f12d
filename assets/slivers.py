"""Widen faces too thin, such as needles and caps: slide a vertex onto a neighbour where that hardly moves the
surface, and others towards the middle of their neighbours, along the surface.

What it moves off the field, `assets.fit` puts back. Letters: V vertices, F faces, N candidates, K faces that
they would change.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int64

from assets.collapse import apart, changed_corners, links_hold, replaced, standing
from assets.surface import (
    Surface,
    compact,
    directed_edges,
    face_normals,
    normals_of,
    smallest_angle_of,
    smallest_angles,
    vertex_normals,
)


@dataclass(frozen=True, kw_only=True)
class SliverConfig:
    """What is too thin, and what its removal may cost."""

    thin: float = 6.0  # degrees of the smallest angle
    rounds: int = 4
    largest_share: float = 0.01  # of all faces, that may go
    largest_rise: float = 8e-4  # metres that a vertex may leave the planes of its faces by
    largest_turn: float = 0.8  # cosine of the angle a face may turn by
    step: float = 0.5  # of the way to the middle of the neighbours


def remove_slivers(surface: Surface, config: SliverConfig | None = None) -> Surface:
    """The surface with fewer thin faces: at most `largest_share` of all faces go, closed as before."""
    config = config or SliverConfig()
    return relax(collapse_thin(surface, config), config)


def collapse_thin(surface: Surface, config: SliverConfig) -> Surface:
    """Slide vertices of thin faces onto neighbours."""
    fewest = len(surface.faces) * (1 - config.largest_share)
    for _ in range(config.rounds):
        room = int((len(surface.faces) - fewest) // 2)
        edges = edges_of_thin(surface, config.thin)
        allowed, rise = judge(surface, edges, config)
        edges, rise = edges[allowed], rise[allowed]
        chosen = edges[apart(surface.faces, len(surface.vertices), edges, rise)[:room]]
        if len(chosen) == 0:
            break
        into = np.arange(len(surface.vertices))
        into[chosen[:, 0]] = chosen[:, 1]
        faces = into[surface.faces]
        surface = compact(surface.vertices, faces[standing(faces)])
    return surface


def edges_of_thin(surface: Surface, thin: float) -> Int64[np.ndarray, "N 2"]:
    """The edges of thin faces, in both directions."""
    edges = directed_edges(surface.faces[smallest_angles(surface) < thin])
    return np.unique(np.concatenate([edges, edges[:, ::-1]]), axis=0)


def judge(
    surface: Surface, edges: Int64[np.ndarray, "N 2"], config: SliverConfig
) -> tuple[Bool[np.ndarray, " N"], Float64[np.ndarray, " N"]]:
    """Which collapses are harmless, and how far each moves the surface, metres."""
    candidate, corner = changed_corners(surface.faces, edges)
    old = surface.vertices[surface.faces[corner // 3]]
    new = surface.vertices[replaced(surface.faces, corner, edges[candidate, 1])]
    was, normal = normals_of(old), normals_of(new)
    size = np.linalg.norm(was, axis=1), np.linalg.norm(normal, axis=1)
    cosine = np.einsum("kd,kd->k", was, normal) / np.maximum(size[0] * size[1], 1e-300)
    angle = smallest_angle_of(new)
    unit = normal / np.maximum(size[1], 1e-300)[:, None]
    gone = (surface.vertices[edges[:, 0]] - surface.vertices[edges[:, 1]])[candidate]
    rise = np.zeros(len(edges))
    np.maximum.at(rise, candidate, np.abs(np.einsum("kd,kd->k", gone, unit)))
    bad = (cosine < config.largest_turn) | (angle < config.thin)
    spoilt = np.bincount(candidate, bad, minlength=len(edges)) > 0
    holds = links_hold(surface.faces, len(surface.vertices), edges)
    return holds & ~spoilt & (rise < config.largest_rise), rise


def relax(surface: Surface, config: SliverConfig) -> Surface:
    """Move vertices of thin faces towards the middle of their neighbours, as far as they stay near the planes
    of their faces and no face gets thinner than the thinnest there was."""
    for _ in range(config.rounds):
        worst = worst_angles(surface)
        normals = vertex_normals(surface)
        move = config.step * (middles(surface) - surface.vertices)
        move -= np.einsum("vd,vd->v", move, normals)[:, None] * normals
        move[worst >= config.thin] = 0.0
        move *= np.minimum(1.0, config.largest_rise / np.maximum(rises(surface, move), 1e-12))[:, None]
        surface = accept(surface, move, worst, config.largest_turn)
    return surface


def rises(surface: Surface, move: Float64[np.ndarray, "V 3"]) -> Float64[np.ndarray, " V"]:
    """How far each move leads from the planes of the faces at its vertex, metres."""
    flat = face_normals(surface)
    flat = flat / np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-300)
    rise = np.zeros(len(surface.vertices))
    np.maximum.at(rise, surface.faces, np.abs(np.einsum("fcd,fd->fc", move[surface.faces], flat)))
    return rise


def middles(surface: Surface) -> Float64[np.ndarray, "V 3"]:
    """The mean of each vertex's neighbours, metres."""
    edges, count = directed_edges(surface.faces), len(surface.vertices)
    ends = surface.vertices[edges[:, 1]]
    total = np.stack([np.bincount(edges[:, 0], column, minlength=count) for column in ends.T], axis=1)
    return total / np.maximum(np.bincount(edges[:, 0], minlength=count), 1)[:, None]


def worst_angles(surface: Surface) -> Float64[np.ndarray, " V"]:
    """The smallest angle of the faces at each vertex, degrees."""
    worst = np.full(len(surface.vertices), 180.0)
    np.minimum.at(worst, surface.faces, smallest_angles(surface)[:, None])
    return worst


def accept(
    surface: Surface,
    move: Float64[np.ndarray, "V 3"],
    worst: Float64[np.ndarray, " V"],
    largest_turn: float,
) -> Surface:
    """Take back moves until each that is left widens the thinnest face at its vertex and turns none far."""
    before = face_normals(surface)
    while True:
        moved = Surface(vertices=surface.vertices + move, faces=surface.faces)
        after = face_normals(moved)
        length = np.linalg.norm(before, axis=1) * np.linalg.norm(after, axis=1)
        turned = np.zeros(len(move), dtype=bool)
        turned[surface.faces[np.einsum("fd,fd->f", before, after) < largest_turn * length]] = True
        wrong = (turned | (worst_angles(moved) <= worst)) & (move != 0).any(axis=1)
        if not wrong.any():
            return moved
        move = np.where(wrong[:, None], 0.0, move)
