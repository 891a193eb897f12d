"""Stress of the training's geometry terms: no slope, steep slopes, deep inside, on the body's own vertices;
two precisions against float64, and gradients that stay finite."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import torch
from torch import Tensor

from avatargen.body.model import canonical_body, pose, shape
from avatargen.commands.stress.case import Case, require
from avatargen.commands.stress.figure import default_body
from avatargen.commands.stress.numbers import PRECISIONS, distances
from avatargen.generator.config import DEBUG, GeometryConfig, for_body
from avatargen.generator.generator import AvatarGenerator
from avatargen.generator.picture import CanonicalSurface, People, make_people
from avatargen.training.losses import (
    STEEPNESS,
    distance_and_slope,
    eikonal,
    minimal_surface,
    slope_of,
)

LENGTHS = (0.0, 1e-20, 1e-9, 1e-6, 1e-3, 1.0, 1e3, 1e6)  # of gradients


def terms_of_distance(dtype: torch.dtype) -> str:
    """The minimal-surface term from 64 m inside to 64 m outside, one distance at a time."""
    worst = 0.0
    for place in distances():
        found, true = (place.to(kind).reshape(1).requires_grad_() for kind in (dtype, torch.float64))
        values = [minimal_surface(d) for d in (found, true)]
        slopes = [torch.autograd.grad(v, d)[0] for v, d in zip(values, (found, true), strict=True)]
        require(torch.isfinite(slopes[0]).all(), f"its gradient is not finite at {place:g} m")
        value, true = (v.detach() for v in values)
        require(0 <= value <= 1, f"{float(value):g} at {place:g} m")
        worst = max(worst, float((value - true).abs()), float((slopes[0] - slopes[1]).abs()) / STEEPNESS)
    require(worst < PRECISIONS[dtype], f"off by {worst:.1e}")
    return f"0 to 1 on both sides, value and gradient within {worst:.1e}"


def terms_of_slope(dtype: torch.dtype) -> str:
    """The eikonal term and its gradient for gradients of every length, none among them."""
    worst = 0.0
    for length in LENGTHS:
        results = []
        for kind in (dtype, torch.float64):
            gradient = torch.tensor([[0.6, 0.0, -0.8]], dtype=kind).mul(length).requires_grad_()
            value = eikonal(slope_of(gradient))
            results.append((value.detach(), torch.autograd.grad(value, gradient)[0]))
        (value, way), (true, true_way) = results
        require(torch.isfinite(value) and torch.isfinite(way).all(), f"not finite at length {length:g}")
        scale = max(1.0, length)
        worst = max(
            worst, float((value - true).abs()) / scale**2, float((way - true_way).abs().max()) / scale
        )
    require(worst < PRECISIONS[dtype], f"off by {worst:.1e}")
    return f"finite from no slope to 1e6, value and gradient within {worst:.1e}"


def someone(distance: str) -> tuple[AvatarGenerator, People]:
    """An untrained generator on the default body: the body, or with `raw` the same distance everywhere."""
    surface = CanonicalSurface(default_body())
    config = for_body(DEBUG, canonical_body(default_body()))
    torch.manual_seed(0)
    generator = AvatarGenerator(replace(config, geometry=GeometryConfig(distance=distance)))
    w = torch.zeros(1, config.mapping.w_size)
    poses, betas = torch.zeros(1, config.joint_count, 3), torch.zeros(1, config.shape_count)
    return generator, make_people(generator, surface, w, generator.planes(w), poses, betas)


def slopes_at(points: Callable[[People], Tensor], distance: str, low: float, high: float) -> str:
    """Slopes within limits, and gradients of the weights that are finite."""
    generator, person = someone(distance)
    sdf, slope = distance_and_slope(generator, person, points(person)[None])
    (eikonal(slope) + minimal_surface(sdf)).backward()
    least, most = float(slope.detach().min()), float(slope.detach().max())
    require(low <= least and most <= high, f"slopes {least:g} to {most:g}")
    grads = [p.grad for p in generator.parameters() if p.grad is not None]
    require(grads and all(torch.isfinite(g).all() for g in grads), "a weight's gradient is not finite")
    return f"slopes {least:.1e} to {most:.3g}, finite gradients of {len(grads)} weights"


def vertices(person: People) -> Tensor:
    """Some of the posed body's own: the closest point is the point itself, and no way leads there."""
    return person.posed.vertices[0, ::50]


def inside(person: People) -> Tensor:
    """The middle of every bone, where the closest point jumps from side to side."""
    body = default_body()
    posed = pose(body, shape(body, np.zeros(0)), np.zeros((body.joint_count, 3)))
    joints, parents = posed.joints, body.parents
    return torch.from_numpy((joints[1:] + joints[parents[1:]]) / 2).float()


def cases() -> list[Case]:
    """Every one ends in a right number."""
    found = []
    for dtype, name in ((torch.float32, "float32"), (torch.bfloat16, "bfloat16")):
        expected = f"finite, within {PRECISIONS[dtype]:.0e} of float64"
        found += [
            Case(
                name=f"minimal-surface term, 64 m inside to 64 m outside, {name}",
                expected=f"{expected}, at most 1",
                check=lambda dtype=dtype: terms_of_distance(dtype),
            ),
            Case(
                name=f"eikonal term, slopes 0 to 1e6, {name}",
                expected=expected,
                check=lambda dtype=dtype: terms_of_slope(dtype),
            ),
        ]
    flat, steep = "slope 0, finite gradients", "slope up to 1, finite gradients"
    rows = (
        ("geometry terms where the field is flat", flat, vertices, "raw", (0.0, 1e-5)),
        ("geometry terms on the body's own vertices", steep, vertices, "residual", (0.0, 1.01)),
        ("geometry terms deep inside, between two sides", steep, inside, "residual", (0.5, 1.5)),
    )
    found += [
        Case(name=name, expected=expected, check=lambda p=points, d=distance, r=limits: slopes_at(p, d, *r))
        for name, expected, points, distance, limits in rows
    ]
    return found
