"""Stress of extraction: fields that are no distances, have no surface, or more than the grid can show.

Each check extracts at a modest resolution, keeps one component, and asks for a closed manifold one: once on
the grid of the resolution, once from cells of two sizes.
"""

from collections.abc import Callable
from functools import partial

import numpy as np
import torch
from torch import Tensor

from assets.errors import GeometryError
from assets.field import Field
from assets.isosurface.adaptive import trace_adaptively
from assets.isosurface.extract import ExtractConfig, Tracer, trace
from assets.mesh.clean import clean
from assets.mesh.surface import Surface, find_defects, volume
from avatargen.commands.stress.case import Case, require
from avatargen.errors import FieldError

BOX = np.array([[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]])
RESOLUTION = 96
VOXEL = 2.0 / RESOLUTION
RADIUS = 0.6
FACES = 2000  # to be left, which tells the cells of two sizes where it is flat
WAYS: dict[str, Tracer] = {"": trace, ", two sizes": partial(trace_adaptively, faces=FACES)}


def sphere(points: Tensor, radius: float = RADIUS, x: float = 0.0) -> Tensor:
    """A ball on the x axis."""
    return (points - torch.tensor([x, 0.0, 0.0])).norm(dim=1) - radius


def solid(way: Tracer, field: Field, bounds: np.ndarray = BOX) -> tuple[Surface, int]:
    """The largest component, closed and manifold, and how many others there were."""
    extraction = way(field, bounds, ExtractConfig(resolution=RESOLUTION))
    cleaning = clean(extraction.surface)
    defects = find_defects(cleaning.surface)
    require(not defects, f"the surface has {defects}")
    return cleaning.surface, cleaning.dropped_components


def same_as_sphere(way: Tracer, change: Callable[[Tensor], Tensor], limit: float) -> str:
    """The zero level of a changed sphere is the sphere's."""
    surface, _ = solid(way, lambda points: change(sphere(points)))
    off = np.abs(np.linalg.norm(surface.vertices, axis=1) - RADIUS).max()
    require(off < limit, f"vertices are off by {1000 * off:.2f} mm")
    return f"closed, vertices within {1000 * off:.3f} mm"


def fails(way: Tracer, field: Field) -> str:
    """A field that has no usable surface."""
    surface, _ = solid(way, field)
    return f"a surface of {len(surface.faces)} faces"


def patch_of_nan(points: Tensor) -> Tensor:
    near = (points - torch.tensor([RADIUS, 0.0, 0.0])).norm(dim=1) < 0.1
    return torch.where(near, torch.full_like(points[:, 0], torch.nan), sphere(points))


def torn(points: Tensor) -> Tensor:
    """Jumps by 2 cm from one stripe to the next."""
    return sphere(points) + 0.02 * torch.sign(torch.sin(31 * points[:, 0]))


def noisy(points: Tensor) -> Tensor:
    """Rough at the scale of a voxel."""
    waves = torch.sin(points * (2.1 / VOXEL)).prod(dim=1)
    return sphere(points) + VOXEL * waves


def plate(points: Tensor) -> Tensor:
    """A square sheet half a voxel thick, a little tilted."""
    across = points @ torch.tensor([0.05, 0.998, 0.03]) + 0.013
    beyond = torch.stack(
        [points[:, 0].abs() - 0.6, points[:, 2].abs() - 0.6, across.abs() - VOXEL / 4], dim=1
    )
    return beyond.max(dim=1).values


def two_sheets(points: Tensor) -> Tensor:
    """Two balls a third of a voxel apart."""
    gap = VOXEL / 6
    return torch.minimum(sphere(points, 0.4, 0.4 + gap), sphere(points, 0.4, -0.4 - gap))


def islands(points: Tensor) -> Tensor:
    """A ball with a bubble inside and two balls beside it."""
    ball = torch.maximum(sphere(points, 0.5), -sphere(points, 0.3))
    return torch.minimum(ball, torch.minimum(sphere(points, 0.1, 0.75), sphere(points, 0.08, -0.75)))


def thin(way: Tracer) -> str:
    try:
        surface, dropped = solid(way, plate)
    except GeometryError as error:
        return f"GeometryError: {error}"
    return f"closed piece of {len(surface.faces)} faces, {dropped} crumbs dropped"


def close_sheets(way: Tracer) -> str:
    surface, dropped = solid(way, two_sheets)
    ball = 4 / 3 * np.pi * 0.4**3
    share = volume(surface) / ball
    require(abs(share - 1) < 0.03 or abs(share - 2) < 0.06, f"{share:.2f} balls are left")
    return f"closed, {share:.2f} balls, {dropped} dropped"


def loose(way: Tracer) -> str:
    surface, dropped = solid(way, islands)
    share = volume(surface) / (4 / 3 * np.pi * 0.5**3)
    require(dropped == 3 and abs(share - 1) < 0.01, f"{dropped} dropped, {share:.3f} of the ball's volume")
    return "bubble and islands dropped, the ball is whole"


def rough(way: Tracer) -> str:
    surface, dropped = solid(way, noisy)
    off = np.abs(np.linalg.norm(surface.vertices, axis=1) - RADIUS).max()
    require(off < 3 * VOXEL, f"vertices are off by {off / VOXEL:.1f} voxels")
    return f"closed, vertices within {off / VOXEL:.1f} voxels, {dropped} crumbs dropped"


def stripes(way: Tracer) -> str:
    surface, dropped = solid(way, torn)
    off = np.abs(np.linalg.norm(surface.vertices, axis=1) - RADIUS).max()
    require(off < 0.02 + 2 * VOXEL, f"vertices are off by {1000 * off:.0f} mm")
    return f"closed, vertices within {1000 * off:.0f} mm, {dropped} dropped"


def far_away(way: Tracer) -> str:
    """A box a hundred metres from the origin, where float32 keeps 8 micrometres."""
    shift = np.array([100.0, 0.0, 0.0])
    surface, _ = solid(way, lambda points: sphere(points - torch.tensor([100.0, 0.0, 0.0])), BOX + shift)
    off = np.abs(np.linalg.norm(surface.vertices - shift, axis=1) - RADIUS).max()
    require(off < 1e-3, f"vertices are off by {1000 * off:.2f} mm")
    return f"closed, vertices within {1000 * off:.2f} mm"


def cases() -> list[Case]:
    """Right surfaces first, then errors."""
    voxel = 0.1 * VOXEL
    right: dict[str, tuple[str, Callable[[Tracer], str]]] = {
        "field scaled by 1e-3": (
            "the same surface",
            partial(same_as_sphere, change=lambda d: 1e-3 * d, limit=voxel),
        ),
        "field scaled by 1e3": (
            "the same surface",
            partial(same_as_sphere, change=lambda d: 1e3 * d, limit=voxel),
        ),
        "field cubed, flat at its zero": (
            "the same topology, within a voxel",
            partial(same_as_sphere, change=lambda d: 1e3 * d**3, limit=VOXEL),
        ),
        "field clamped to 2 cm": (
            "the same surface",
            partial(same_as_sphere, change=lambda d: d.clamp(-0.02, 0.02), limit=voxel),
        ),
        "discontinuous field": ("closed, within the jump", stripes),
        "rough at the voxel": ("closed, within 3 voxels", rough),
        "sheet half a voxel thick": ("a closed piece, or an error that asks for resolution", thin),
        "two sheets closer than a voxel": ("closed: one ball, or both joined", close_sheets),
        "floating islands and a bubble": ("one closed component, three dropped", loose),
        "100 m from the origin": ("closed, within 1 mm", far_away),
    }
    wrong: dict[str, tuple[type[GeometryError] | type[FieldError], str, Field]] = {
        "empty field": (GeometryError, "no surface", lambda points: sphere(points) + 9),
        "full field": (GeometryError, "no surface", lambda points: sphere(points) - 9),
        "NaN in a patch": (FieldError, "NaN", patch_of_nan),
        "infinite field": (FieldError, "infinite", lambda points: points[:, 0] / 0),
        "surface through the box's side": (
            GeometryError,
            "larger bounds",
            lambda points: sphere(points, 1.2),
        ),
        "surface touching the box's side": (
            GeometryError,
            "larger bounds",
            lambda points: sphere(points, 0.4, 0.6005),
        ),
    }
    found = [
        Case(name=name + words, expected=expected, check=partial(check, way))
        for words, way in WAYS.items()
        for name, (expected, check) in right.items()
    ]
    for label, way in WAYS.items():
        for name, (kind, words, field) in wrong.items():
            expected = f"{kind.__name__}: ... {words} ..."
            check = partial(fails, way, field)
            found.append(Case(name=name + label, expected=expected, check=check, error=(kind, words)))
    return found
