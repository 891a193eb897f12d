"""Layers of a person: a signed distance and a colour everywhere, laid one over another.

Distances here are first-order: offsets, intersections and smooth unions of true distances, slopes near 1.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import torch
from jaxtyping import Float
from torch import Tensor

Number = Tensor | float | int

EDGE = 0.0006  # m, softness of a colour edge on the surface
DEEPEST = 87.0  # e to the minus this is still a normal float32; below, exponentials take ten times as long
BLEND = 0.003  # m, rounding where two layers meet


@dataclass(frozen=True, kw_only=True)
class Layer:
    """One thing worn, or the skin."""

    sdf: Float[Tensor, "B N"]  # m, negative inside
    color: Float[Tensor, "B N 3"]  # sRGB 0..1


def ramp(x: Tensor, low: Number, high: Number) -> Tensor:
    """Smoothstep from 0 at low to 1 at high."""
    t = ((x - low) / (high - low)).clamp(0, 1)
    return t * t * (3 - 2 * t)


def bump(x: Tensor, centre: Number, width: Number) -> Tensor:
    """Gaussian of height 1."""
    return torch.exp(-(((x - centre) / width) ** 2).clamp(max=DEEPEST))


def mix(a: Tensor, b: Tensor, weight: Tensor) -> Tensor:
    """Colours a..b by a weight without their last axis."""
    return a + (b - a) * weight[..., None]


def smooth_min(a: Tensor, b: Tensor, radius: float = BLEND) -> Tensor:
    """Minimum with a rounded crease; equals the minimum where the two differ by more than radius."""
    h = (radius - (a - b).abs()).clamp(min=0) / radius
    return torch.minimum(a, b) - h * h * radius / 4


def over(below: Layer, above: Layer) -> Layer:
    """Union of two layers; the colour is that of the outer one."""
    visible = torch.sigmoid((below.sdf - above.sdf) / EDGE)
    return Layer(sdf=smooth_min(below.sdf, above.sdf), color=mix(below.color, above.color, visible))


def over_those(below: Layer, worn: Float[Tensor, "B 1"], layer: Callable[[], Layer]) -> Layer:
    """Lay a layer over those who wear it; it is made only where somebody does.

    For the others it is a metre away, further than any place asked for is from a person.
    """
    wearing = worn > 0.5
    if not wearing.any():
        return below
    above = layer()
    return over(below, replace(above, sdf=torch.where(wearing, above.sdf, torch.ones_like(above.sdf))))


def cloth(body: Tensor, thickness: Number, covered: Tensor) -> Tensor:
    """Distance to the body thickened by `thickness`, cut with a rounded edge where `covered` (metres inside
    the pattern piece) goes negative.
    """
    return -smooth_min(thickness - body, covered)


def folds(u: Tensor, v: Tensor, phase: float = 0.0, wavelength: float = 0.075) -> Tensor:
    """Cloth folds in about -1..1 across u, wandering along v (metres); deep here, gone there."""
    wander = 0.35 * torch.sin(6.2832 * v / 0.23) + 0.22 * torch.sin(6.2832 * (u + v) / 0.31 + 1.3)
    angle = 6.2832 * (u / wavelength + wander + phase)
    depth = 0.5 + 0.5 * torch.sin(6.2832 * (v / 0.19 + u / 0.27 + 0.6 * phase))
    return (torch.sin(angle) + 0.3 * torch.sin(1.7 * angle + 0.9)) * (0.15 + 0.85 * depth)
