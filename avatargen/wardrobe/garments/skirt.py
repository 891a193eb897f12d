"""Skirts, and the lower half of dresses: a flared rounded prism around both legs."""

import torch
from torch import Tensor

from avatargen.wardrobe.attributes import People
from avatargen.wardrobe.chart import Places, tailor
from avatargen.wardrobe.garments.fabric import LINING, WAIST_Y, loosened, pattern
from avatargen.wardrobe.garments.worn import has_dress
from avatargen.wardrobe.layers import Layer, Number, mix, ramp, smooth_min


def skirt_sdf(p: Tensor, flare: Tensor, end: Tensor, ease: Number, creased: Tensor) -> tuple[Tensor, Tensor]:
    """A flared rounded prism around both legs from the waist down to height `end`, its underside
    hollow; and its fold pattern.
    """
    x, y, z = tailor(p)
    below = (WAIST_Y - y).clamp(min=0)
    half = (
        0.150
        + 0.062 * ramp(below, 0.0, 0.28)
        + (0.42 * (below - 0.2).clamp(min=0))
        + flare * 0.28 * below
        + ease
    )
    deep = 0.112 + 0.020 * ramp(below, 0.02, 0.2) + flare * 0.30 * below + ease
    centre = 0.030 - 0.028 * ramp(below, 0.0, 0.30)
    angle = torch.atan2((z - centre) / 0.12, x / (half + 1e-3))
    wave = torch.sin(angle * 7 + 0.8) + 0.4 * torch.sin(angle * 11 + 2.1)
    amplitude = (0.4 + flare) * 0.016 * below * creased
    qx, qz = x.abs() - (half - deep), (z - centre).abs()
    outline = torch.where(qx > 0, torch.sqrt(qx.clamp(min=0) ** 2 + qz**2 + 1e-10), qz) - deep
    wall = (outline - amplitude * wave) * 0.88
    hollow = 0.07 * ramp(-wall, 0.010, 0.055)
    return torch.maximum(torch.maximum(wall, y - WAIST_Y - 0.01), end + hollow - y), wave


def skirt_end(people: People) -> Tensor:
    """Height at which a skirt ends, m."""
    return WAIST_Y - people.between("skirt_length", 0.36, 0.95)


def skirt_cone(p: Tensor, people: People) -> tuple[Tensor, Tensor]:
    """The free-hanging part of a person's skirt, and its folds."""
    flare, creased = people.between("flare", 0.05, 0.75), people.between("creased", 0.5, 1.5)
    return skirt_sdf(p, flare, skirt_end(people), 0.004, creased)


def skirt_colour(people: People) -> Tensor:
    """A dress has the colour of the top, [B 1 3]."""
    own = people.colour("bottom", 0.08, 0.85, 0.16)
    return torch.where(has_dress(people)[..., None] > 0.5, people.colour("top"), own)


def skirt(places: Places, people: People) -> Layer:
    """Skirts, and the lower half of dresses."""
    x, y, _z = tailor(places.p)
    end = skirt_end(people)
    sdf, wave = skirt_cone(places.p, people)
    dress = has_dress(people)
    tight = torch.maximum(
        loosened(places, people.measure("ease")) - 0.011, torch.maximum(y - WAIST_Y - 0.02, end - y)
    )
    color = skirt_colour(people).expand(*x.shape, 3)
    color = torch.where(
        dress[..., None] > 0.5, pattern(color, people.colour("second", chroma=0.2), places, people), color
    )
    trim = ramp(0.02 - (y - end), -0.001, 0.001) * (people.measure("wear") > 0.6)
    color = mix(color, people.colour("second", chroma=0.2).expand_as(color), 0.8 * trim)
    color = color * (1 + 0.10 * wave * ramp(WAIST_Y - y, 0.05, 0.4))[..., None]
    under = ramp(end - y, -0.0055, -0.002) + ramp(-(sdf - (end - y)).abs(), -0.002, 0) * ramp(
        y - end, 0.001, 0.01
    )
    color = mix(color, color * LINING, under.clamp(0, 1))
    return Layer(sdf=smooth_min(sdf, tight, 0.015), color=color.clamp(0, 1))
