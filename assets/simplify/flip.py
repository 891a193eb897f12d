"""Edge flips: an edge gives way to the other diagonal of its two faces where that lies nearer to the zero
level of the field, as along creases, or where it makes a thin face wider.

The vertices stay. A flip is refused where faces would turn by more than the limit, or get thinner than they
may. Letters: V vertices, F faces, N edges that may be flipped; an edge from a to b has c and d opposite.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int64

from assets.field import Field, ask
from assets.mesh.repair import next_edge
from assets.mesh.surface import Surface, opposite_edges, smallest_angle_of


@dataclass(frozen=True, kw_only=True)
class FlipConfig:
    """Up to two questions to the field an edge and round."""

    rounds: int = 1
    worth: float = 5e-5  # metres by which the diagonals must differ to be looked at
    better: float = 0.9  # of the old distance to the zero level, that the new one may be at most
    thin: float = 8.0  # degrees under which an angle is widened wherever that is harmless
    harmless: float = 3e-4  # metres from the zero level
    largest_turn: float = 0.3  # cosine of the angle that faces may turn by


@dataclass(frozen=True, kw_only=True)
class Diagonals:
    """Edges that can be turned, with what would come of it."""

    faces: Int64[np.ndarray, "N 2"]
    ends: Int64[np.ndarray, "N 4"]  # a b c d
    area: Float64[np.ndarray, " N"]  # of both faces, square metres
    height: Float64[np.ndarray, " N"]  # metres from the middle of c d to that of a b, outward
    angle: Float64[np.ndarray, " N"]  # the smallest of both faces, degrees
    turned_angle: Float64[np.ndarray, " N"]

    def at(self, chosen: np.ndarray) -> "Diagonals":
        return Diagonals(**{name: values[chosen] for name, values in vars(self).items()})


def flip(surface: Surface, sdf: Field, config: FlipConfig | None = None) -> Surface:
    """The same vertices with some edges flipped, nearer to the zero level of `sdf` (metres); closed and
    manifold as before.

    Raises:
        FieldError: the field is NaN or infinite.
    """
    config = config or FlipConfig()
    for _ in range(config.rounds):
        found = diagonals(surface, config.largest_turn)
        found, gain = worthwhile(surface, found, sdf, config)
        chosen = found.at(independent_set(found, gain))
        faces = surface.faces.copy()
        a, b, c, d = chosen.ends.T
        faces[chosen.faces[:, 0]] = np.stack([c, a, d], axis=1)
        faces[chosen.faces[:, 1]] = np.stack([d, b, c], axis=1)
        surface = Surface(vertices=surface.vertices, faces=faces)
    return surface


def diagonals(surface: Surface, largest_turn: float) -> Diagonals:
    """Every edge that can be turned without turning a face over or doubling an edge."""
    faces, points, count = surface.faces, surface.vertices, len(surface.vertices)
    twin = opposite_edges(faces, count)
    edge = np.flatnonzero(twin > np.arange(len(twin)))
    flat, other = faces.reshape(-1), twin[edge]
    a, b = flat[edge], flat[next_edge(edge)]
    c, d = flat[next_edge(next_edge(edge))], flat[next_edge(next_edge(other))]
    doubled = np.isin(names(c, d, count), names(a, b, count)) | (c == d)
    before = np.stack([double_areas(points, a, b, c), double_areas(points, b, a, d)])
    turned = np.stack([double_areas(points, c, a, d), double_areas(points, d, b, c)])
    mean = before.sum(axis=0)
    mean = mean / np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-300)
    facing = np.einsum("pnd,nd->pn", turned, mean) > largest_turn * np.linalg.norm(turned, axis=2)
    able = facing.all(axis=0) & ~doubled
    return Diagonals(
        faces=np.stack([edge // 3, other // 3], axis=1),
        ends=np.stack([a, b, c, d], axis=1),
        area=0.5 * np.linalg.norm(before, axis=2).sum(axis=0),
        height=np.einsum("nd,nd->n", 0.5 * (points[a] + points[b] - points[c] - points[d]), mean),
        angle=np.minimum(smallest(points, a, b, c), smallest(points, b, a, d)),
        turned_angle=np.minimum(smallest(points, c, a, d), smallest(points, d, b, c)),
    ).at(able)


def worthwhile(
    surface: Surface, found: Diagonals, sdf: Field, config: FlipConfig
) -> tuple[Diagonals, Float64[np.ndarray, " N"]]:
    """Those whose turning brings the surface nearer or mends a thin face, and how much each gains."""
    mends = (found.angle < config.thin) & (found.turned_angle > found.angle)
    sound = found.turned_angle > np.minimum(config.thin, found.angle)
    looked_at = mends | (sound & (np.abs(found.height) > config.worth))
    found, mends = found.at(looked_at), mends[looked_at]
    a, b, c, d = (surface.vertices[ends] for ends in found.ends.T)
    before = ask(sdf, 0.5 * (a + b))
    after_ = before - found.height  # to first order
    likely = mends | (np.abs(after_) < config.better * np.abs(before))
    after_[likely] = ask(sdf, 0.5 * (c + d)[likely])
    before, after_ = np.abs(before), np.abs(after_)
    nearer = likely & (after_ < config.better * before) & (before > config.worth)
    harmless = mends & (after_ < np.maximum(before, config.harmless))
    gain = found.area * (before**2 - after_**2)
    gain = np.where(harmless, np.maximum(gain, 10 * found.area * config.worth**2), gain)
    chosen = harmless | (nearer & (found.turned_angle > np.minimum(config.thin, found.angle)))
    return found.at(chosen), gain[chosen]


def independent_set(found: Diagonals, gain: Float64[np.ndarray, " N"]) -> Bool[np.ndarray, " N"]:
    """Edges that gain more than the others of their two faces, and of which no two make the same edge."""
    best = np.full(int(found.faces.max(initial=-1)) + 1, -1, dtype=np.int64)
    rank = np.empty(len(gain), dtype=np.int64)
    rank[np.argsort(gain, kind="stable")] = np.arange(len(gain))
    np.maximum.at(best, found.faces, rank[:, None])
    chosen = (best[found.faces] == rank[:, None]).all(axis=1)
    made = names(found.ends[:, 2], found.ends[:, 3], int(found.ends.max(initial=0)) + 1)
    first = np.zeros(len(gain), dtype=bool)
    first[np.flatnonzero(chosen)[np.unique(made[chosen], return_index=True)[1]]] = True
    return first


def names(a: Int64[np.ndarray, " N"], b: Int64[np.ndarray, " N"], count: int) -> Int64[np.ndarray, " N"]:
    """One number for each pair of vertices, whichever comes first."""
    return np.minimum(a, b) * count + np.maximum(a, b)


def double_areas(points: np.ndarray, *corners: np.ndarray) -> Float64[np.ndarray, "N 3"]:
    """Normals of triangles, as long as twice their area."""
    a, b, c = (points[corner] for corner in corners)
    return np.cross(b - a, c - a)


def smallest(points: np.ndarray, *corners: np.ndarray) -> Float64[np.ndarray, " N"]:
    """The smallest angle of triangles, degrees."""
    return smallest_angle_of(points[np.stack(corners, axis=1)])
