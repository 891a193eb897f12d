"""Analytic shapes built in code: distance fields as torch functions of points, and meshes."""

from collections.abc import Callable

import numpy as np
import torch
from torch import Tensor

from assets.mesh.surface import Surface

Field = Callable[[Tensor], Tensor]
BOX = np.array([[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]])
PERSON_BOX = np.array([[-1.0, -1.0, -0.25], [1.0, 1.0, 0.25]])


def sphere(radius: float = 0.6, centre: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Field:
    return lambda points: (points - torch.tensor(centre)).norm(dim=1) - radius


def torus(major: float = 0.6, minor: float = 0.2) -> Field:
    def field(points: Tensor) -> Tensor:
        ring = points[:, [0, 2]].norm(dim=1) - major
        return torch.stack([ring, points[:, 1]], dim=1).norm(dim=1) - minor

    return field


def capsule(start: tuple[float, ...], end: tuple[float, ...], radius: float) -> Field:
    def field(points: Tensor) -> Tensor:
        a, axis = torch.tensor(start), torch.tensor(end) - torch.tensor(start)
        along = ((points - a) @ axis / (axis @ axis)).clamp(0, 1)
        return (points - a - along[:, None] * axis).norm(dim=1) - radius

    return field


def plate(thickness: float = 0.02) -> Field:
    """A rounded square plate of side 1."""
    half = torch.tensor([0.5, thickness / 2, 0.5]) - thickness / 4

    def field(points: Tensor) -> Tensor:
        beyond = points.abs() - half
        return beyond.clamp(min=0).norm(dim=1) + beyond.max(dim=1).values.clamp(max=0) - thickness / 4

    return field


def box(half: tuple[float, float, float], turn: Tensor | None = None) -> Field:
    """An exact distance to a box with sharp edges, turned by a rotation matrix."""
    size = torch.tensor(half)

    def field(points: Tensor) -> Tensor:
        beyond = (points if turn is None else points @ turn).abs() - size
        return beyond.clamp(min=0).norm(dim=1) + beyond.max(dim=1).values.clamp(max=0)

    return field


def cylinder(radius: float, half_height: float, turn: Tensor | None = None) -> Field:
    """An exact distance to a cylinder with sharp rims about the y axis, turned by a rotation matrix."""

    def field(points: Tensor) -> Tensor:
        local = points if turn is None else points @ turn
        beyond = torch.stack([local[:, [0, 2]].norm(dim=1) - radius, local[:, 1].abs() - half_height], dim=1)
        return beyond.clamp(min=0).norm(dim=1) + beyond.max(dim=1).values.clamp(max=0)

    return field


def union(*fields: Field) -> Field:
    return lambda points: torch.stack([field(points) for field in fields]).min(dim=0).values


def person() -> Field:
    """A figure of capsules: trunk, head, two legs apart, two arms out."""
    limbs = [capsule((0, 0, 0), (0, 0.45, 0), 0.15), capsule((0, 0.4, 0), (0, 0.75, 0), 0.1)]
    for side in (-1.0, 1.0):
        limbs.append(capsule((side * 0.08, -0.05, 0), (side * 0.3, -0.85, 0), 0.06))
        limbs.append(capsule((side * 0.1, 0.45, 0), (side * 0.75, 0.45, 0), 0.04))
    return union(*limbs)


def icosphere(radius: float = 1.0, rounds: int = 3) -> Surface:
    """A sphere of 20 * 4**rounds faces."""
    import trimesh

    mesh = trimesh.creation.icosphere(subdivisions=rounds, radius=radius)
    return Surface(
        vertices=np.array(mesh.vertices, dtype=np.float64), faces=np.array(mesh.faces, dtype=np.int64)
    )


def join(*surfaces: Surface) -> Surface:
    """Several surfaces as one, not connected."""
    first = np.cumsum([0] + [len(surface.vertices) for surface in surfaces])
    return Surface(
        vertices=np.concatenate([surface.vertices for surface in surfaces]),
        faces=np.concatenate([s.faces + first[i] for i, s in enumerate(surfaces)]),
    )
