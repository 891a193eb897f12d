"""Fewer faces by quadric edge collapses, with the result checked and still in one closed piece: our own
collapses (`assets.simplify.decimate`) or, where these get stuck, fast-simplification's, or pymeshlab's."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from assets.errors import GeometryError
from assets.mesh.clean import clean, from_pymeshlab, to_pymeshlab
from assets.mesh.surface import Surface, find_defects, volume
from assets.simplify.decimate import decimate
from avatargen.errors import InputError

FEWEST_FACES = 4  # a tetrahedron
# of fast-simplification, in the order tried: the lower, the more exact and the less it tears
AGGRESSION = (2, 3, 4, 5)
KEPT_VOLUME = 0.98  # share that a repair must leave: it shall not cut off a limb
PASSES = 4  # of one aggression: a low one stops short of the target, and goes on when asked again


@dataclass(frozen=True, kw_only=True)
class SimplifyConfig:
    """How many faces to keep and how far off that number may end."""

    target_faces: int = 20_000
    tolerance: float = 0.02

    def __post_init__(self) -> None:
        if self.target_faces < FEWEST_FACES:
            raise InputError(
                f"simplify: target of {self.target_faces} faces; a closed surface has at least {FEWEST_FACES}"
            )


def simplify(surface: Surface, config: SimplifyConfig | None = None) -> Surface:
    """A sound surface of `target_faces` triangles, within the tolerance and never more than were given.

    A surface that already has no more than the target comes back as it is.

    Raises:
        GeometryError: no method reached the target with a closed manifold surface.
    """
    config = config or SimplifyConfig()
    if len(surface.faces) <= config.target_faces:
        return surface
    slack = max(config.tolerance * config.target_faces, 2.0)
    closest = len(surface.faces)
    for candidate in candidates(surface, config.target_faces):
        count = len(candidate.faces)
        if abs(count - config.target_faces) <= slack and not find_defects(candidate):
            return candidate
        closest = min(closest, count, key=lambda faces: abs(faces - config.target_faces))
    raise GeometryError(
        f"simplify: no method kept the surface closed and manifold at {config.target_faces} faces, "
        f"the nearest try had {closest}; ask for more faces"
    )


def candidates(surface: Surface, target_faces: int) -> Iterator[Surface]:
    """Ways to the target in the order of their worth, each repaired once if its result is not sound."""
    yield decimate(surface, target_faces)
    for aggression in AGGRESSION:
        yield from with_repair(collapse_fast(surface, target_faces, aggression))
    yield from with_repair(collapse_carefully(surface, target_faces))


def with_repair(surface: Surface) -> Iterator[Surface]:
    """The surface, then the same cleaned, if that takes no part of it away."""
    yield surface
    if not find_defects(surface):
        return
    try:
        repaired = clean(surface).surface
    except GeometryError:
        return
    if volume(repaired) >= KEPT_VOLUME * volume(surface):
        yield repaired


def collapse_fast(surface: Surface, target_faces: int, aggression: int) -> Surface:
    """fast-simplification: quick, does not watch the topology."""
    import fast_simplification

    for _ in range(PASSES):
        vertices, faces = fast_simplification.simplify(
            surface.vertices, surface.faces, target_count=target_faces, agg=aggression
        )[:2]
        before = len(surface.faces)
        surface = Surface(vertices=np.asarray(vertices, dtype=np.float64), faces=faces.astype(np.int64))
        if len(faces) <= target_faces or len(faces) == before:
            break
    return surface


def collapse_carefully(surface: Surface, target_faces: int) -> Surface:
    """pymeshlab: about ten times slower, refuses collapses that change the topology."""
    meshes = to_pymeshlab(surface)
    meshes.apply_filter(
        "meshing_decimation_quadric_edge_collapse",
        targetfacenum=target_faces,
        preservetopology=True,
        preservenormal=True,
    )
    return from_pymeshlab(meshes)
