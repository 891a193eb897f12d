"""Hair on the head, and hats: shells over the scalp, curtains to jaw or back, buns and tails."""

import torch
from torch import Tensor

from avatargen.wardrobe.attributes import People
from avatargen.wardrobe.chart import Places, tailor
from avatargen.wardrobe.layers import Layer, Number, bump, mix, ramp, smooth_min
from avatargen.wardrobe.skin import hair_tone

CROWN = (0.0, 0.735, 0.045)  # centre of the skull

# styles by three choices; columns: thickness at the sides and on top (m), curtain (0 none, 1 bob, 2 long),
# knot (1 bun, 2 tail)
WOMEN = ((0.012, 0.022, 1, 0), (0.012, 0.020, 2, 0), (0.010, 0.016, 0, 1), (0.010, 0.016, 0, 2),
         (0.014, 0.024, 2, 0), (0.016, 0.024, 1, 0), (0.012, 0.022, 0, 0), (0.055, 0.065, 0, 0))  # fmt: skip
MEN = ((0.004, 0.005, 0, 0), (0.007, 0.016, 0, 0), (0.009, 0.026, 0, 0), (0.012, 0.020, 0, 0),
       (0.005, 0.020, 0, 0), (0.030, 0.038, 0, 0), (0.014, 0.022, 2, 0), (0.000, 0.000, 0, 0))  # fmt: skip


def style(people: People) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Columns of the style tables for every person, each [B 1]."""
    table = torch.tensor([MEN, WOMEN]).to(people.z)
    row = table[people.choice("woman")[:, 0].long(), people.kind("hair_a", "hair_b", "hair_c")[:, 0].long()]
    side, top, curtain, knot = (row[:, i : i + 1] for i in range(4))
    return side, top, curtain, knot


def scalp(x: Tensor, y: Tensor, z: Tensor, raised: Number) -> Tensor:
    """Metres inside the hairline: over the forehead, down before the ears, round behind them to the nape."""
    line = 0.632 + 0.034 * ramp(z, -0.045, -0.01) + 0.062 * ramp(z, 0.0, 0.034)
    line = line - 0.018 * bump(z, 0.072, 0.012) + 0.062 * ramp(z, 0.074, 0.125)
    corner = 0.010 * bump(x.abs(), 0.05, 0.018) * ramp(z, 0.08, 0.10)  # temples
    return (y - line - corner - raised * ramp(z, 0.06, 0.11)) * 0.8


def capsule(
    x: Tensor, y: Tensor, z: Tensor, a: tuple[float, float, float], b: tuple[Number, ...], radius: Number
) -> Tensor:
    """Distance to a segment a-b thickened by radius."""
    ab = [bi - ai for ai, bi in zip(a, b, strict=True)]
    ap = [x - a[0], y - a[1], z - a[2]]
    dot = sum((p * d for p, d in zip(ap, ab, strict=True)), torch.zeros_like(x))
    t = (dot / sum(d * d for d in ab)).clamp(0, 1)
    return (
        torch.sqrt(sum(((p - t * d) ** 2 for p, d in zip(ap, ab, strict=True)), torch.full_like(x, 1e-10)))
        - radius
    )


def curtain_sdf(places: Places, people: People, end: Tensor) -> Tensor:
    """Hair hanging from the skull behind the face down to height `end`, over neck and back."""
    x, y, z = tailor(places.p)
    sway = people.between("wavy", 0.0005, 0.004) * torch.sin(x * 150)
    skull = torch.sqrt(
        x**2 + ((z - CROWN[2]) * 0.93) ** 2 + ((y - CROWN[1]) * ramp(y, 0.70, 0.76) * 0.98) ** 2 + 1e-10
    )
    fall = ramp(-y, -0.72, -0.50)
    around = skull - (0.107 + 0.018 * fall) - sway
    behind = z - (0.078 - 0.075 * fall)  # the front edge recedes below the ears
    above_back = places.closed - 0.024 - sway
    strand = torch.maximum(torch.where(y > 0.56, around, smooth_min(around, above_back, 0.02)), behind)
    strand = torch.maximum(strand, x.abs() - (0.125 - 0.01 * fall))
    return torch.maximum(strand, end - y + 0.012 * torch.cos(x * 18))


def hair(places: Places, people: People) -> Layer:
    """All hair above the face."""
    x, y, z = tailor(places.p)
    side, top, curtain, knot = style(people)
    raised = people.between("hairline", -0.008, 0.012) - 0.030 * people.choice("fringe") * (
        curtain + people.choice("woman") > 0.5
    )
    inside = scalp(x, y, z, raised)
    strands = torch.sin(torch.atan2(x, CROWN[2] - z + 1e-6) * 22 + 3 * torch.sin(y * 40))
    thick = side + (top - side) * ramp(y, 0.70, 0.79) + 0.0012 * strands * (side > 0.006)
    thick = thick * ramp(inside, -0.002, 0.010 + 1.3 * thick).clamp(min=0.12)
    shell = torch.maximum(places.body - thick, -inside)
    length = torch.where(
        curtain > 1.5,
        0.56 - 0.30 * people.measure("hair_length"),
        0.655 - 0.06 * people.measure("hair_length"),
    )
    shell = torch.where(curtain > 0.5, smooth_min(shell, curtain_sdf(places, people, length), 0.012), shell)
    bun = torch.sqrt(x**2 + (y - 0.80) ** 2 + (z + 0.058) ** 2 + 1e-10) - 0.040
    tail = capsule(
        x, y, z, (0.0, 0.775, -0.085), (0.0, 0.60 - 0.12 * people.measure("hair_length"), -0.125), 0.026
    )
    shell = torch.where(knot == 1, smooth_min(shell, bun, 0.008), shell)
    shell = torch.where(knot == 2, smooth_min(shell, tail, 0.008), shell)
    shell = torch.where(top > 0, shell, torch.ones_like(shell))
    tone = hair_tone(people)
    light = 0.92 + 0.10 * strands + 0.10 * bump(y, 0.80, 0.03)
    return Layer(sdf=shell, color=(tone * light[..., None]).clamp(0, 1))


def beanie(places: Places, people: People) -> Layer:
    """A knitted hat with a rolled brim, over the hair."""
    x, y, z = tailor(places.p)
    rim = y - (0.742 + 0.012 * ramp(z, 0.0, 0.12))
    knit = 0.0006 * torch.sin(torch.atan2(x, z - CROWN[2] + 1e-6) * 36)
    skull = torch.sqrt((x / 0.098) ** 2 + ((y - 0.725) / 0.128) ** 2 + ((z - CROWN[2]) / 0.124) ** 2 + 1e-10)
    dome = (skull - 1) * 0.105
    brim = 0.006 * ramp(0.032 - rim, 0, 0.004)
    color = mix(
        people.colour("second", chroma=0.2),
        people.colour("second", chroma=0.2) * 0.85,
        ramp(0.032 - rim, -0.001, 0.001),
    )
    return Layer(
        sdf=torch.maximum(torch.minimum(dome, places.body - 0.012) - brim - knit, -rim),
        color=color.clamp(0, 1),
    )
