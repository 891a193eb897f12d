"""Fewer faces by quadric edge collapses, with the result checked and still in one closed piece.

The adaptive simplifier collapses by `assets.simplify.decimate` and, where that gets stuck, by
fast-simplification or pymeshlab. Who asks for one of these by name gets its collapses and no others; what
they leave open or crowded is repaired.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from assets.errors import GeometryError
from assets.mesh.clean import clean, from_pymeshlab, to_pymeshlab
from assets.mesh.importance import Importance, evenly
from assets.mesh.surface import Surface, count_pieces, euler_number, find_defects, volume
from assets.simplify.decimate import decimate
from avatargen.errors import InputError

Simplifier = Literal["adaptive", "pymeshlab", "fast-simplification"]
SIMPLIFIERS: tuple[Simplifier, ...] = get_args(Simplifier)

FEWEST_FACES = 4  # a tetrahedron
# of fast-simplification, in the order tried: the lower, the more exact and the less it tears
AGGRESSION = (2, 3, 4, 5)
KEPT_VOLUME = 0.98  # share that a repair must leave: it shall not cut off a limb
PASSES = 4  # of one aggression: a low one stops short of the target, and goes on when asked again


@dataclass(frozen=True, kw_only=True)
class SimplifyConfig:
    """How many faces to keep, how far off that number may end, and by whose collapses."""

    target_faces: int = 20_000
    tolerance: float = 0.02
    simplifier: Simplifier = "adaptive"

    def __post_init__(self) -> None:
        if self.target_faces < FEWEST_FACES:
            raise InputError(
                f"simplify: target of {self.target_faces} faces; a closed surface has at least {FEWEST_FACES}"
            )
        if self.simplifier not in SIMPLIFIERS:
            raise InputError(f"simplifier: found {self.simplifier!r}, wanted one of {', '.join(SIMPLIFIERS)}")


def simplify(
    surface: Surface, config: SimplifyConfig | None = None, importance: Importance = evenly
) -> Surface:
    """A sound surface of `target_faces` triangles, within the tolerance and never more than were given. The
    adaptive simplifier weighs errors by `importance`.

    A surface that already has no more than the target comes back as it is. Handles are kept where a way to
    the target keeps them.

    Raises:
        GeometryError: no way reached the target with a closed manifold surface.
    """
    config = config or SimplifyConfig()
    if len(surface.faces) <= config.target_faces:
        return surface
    slack = max(config.tolerance * config.target_faces, 2.0)
    closest, sound, pieces = len(surface.faces), None, count_pieces(surface)
    for candidate in CANDIDATES[config.simplifier](surface, config.target_faces, importance):
        count = len(candidate.faces)
        if abs(count - config.target_faces) <= slack and not find_defects(candidate, pieces=pieces):
            if euler_number(candidate) == euler_number(surface):
                return candidate
            sound = sound or candidate
        closest = min(closest, count, key=lambda faces: abs(faces - config.target_faces))
    if sound is not None:
        return sound
    other = "" if config.simplifier == "adaptive" else ", or choose the adaptive simplifier"
    raise GeometryError(
        f"simplify: {NAMES[config.simplifier]} kept the surface closed and manifold at {config.target_faces} "
        f"faces, the nearest try had {closest}; ask for more faces{other}"
    )


def by_any(surface: Surface, target_faces: int, importance: Importance) -> Iterator[Surface]:
    """Ways to the target in the order of their worth, each repaired once if its result is not sound."""
    yield decimate(surface, target_faces, importance=importance)
    yield from by_fast_simplification(surface, target_faces, importance)
    yield from by_pymeshlab(surface, target_faces, importance)


def by_fast_simplification(surface: Surface, target_faces: int, _: Importance) -> Iterator[Surface]:
    """Ever more willing to change the topology. All errors weigh the same."""
    for aggression in AGGRESSION:
        yield from with_repair(collapse_fast(surface, target_faces, aggression))


def by_pymeshlab(surface: Surface, target_faces: int, _: Importance) -> Iterator[Surface]:
    """All errors weigh the same."""
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


CANDIDATES = {"adaptive": by_any, "pymeshlab": by_pymeshlab, "fast-simplification": by_fast_simplification}
NAMES = {
    "adaptive": "no method",
    "pymeshlab": "pymeshlab has not",
    "fast-simplification": "fast-simplification has not",
}
