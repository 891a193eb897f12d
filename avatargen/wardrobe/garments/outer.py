"""Jackets, cardigans and coats; and all cloth that hangs free of the legs."""

import torch
from torch import Tensor

from avatargen.wardrobe.attributes import People
from avatargen.wardrobe.chart import Places, tailor
from avatargen.wardrobe.garments.fabric import creases, sleeve_cone
from avatargen.wardrobe.garments.skirt import skirt_cone, skirt_sdf
from avatargen.wardrobe.garments.worn import has_coat, has_skirt
from avatargen.wardrobe.layers import Layer, bump, cloth, mix, ramp, smooth_min


def coat_tail(p: Tensor, people: People) -> Tensor:
    """The free-hanging part of a coat, m."""
    hem = people.between("outer_length", -0.42, -0.12)
    return skirt_sdf(p, 0.12 * torch.ones_like(hem), hem, 0.020, people.between("creased", 0.5, 1.5))[0]


def free_cloth(p: Tensor, people: People) -> Tensor:
    """Signed distance to what hangs free of the legs, 1 for those who wear nothing of the kind, m."""
    skirt = torch.where(has_skirt(people) > 0.5, skirt_cone(p, people)[0], 1.0)
    return torch.minimum(skirt, torch.where(has_coat(people) > 0.5, coat_tail(p, people), 1.0))


def outer_colour(people: People) -> Tensor:
    """Of a jacket or coat, [B 1 3]."""
    return people.colour("outer", 0.06, 0.80, 0.12)


def outer(places: Places, people: People) -> Layer:
    """Jacket, cardigan or coat, open in front or closed; coats reach to the thighs or knees."""
    x, y, z = tailor(places.p)
    coat = people.choice("outer_b")
    openness = people.choice("collar_b")
    hem = torch.where(
        coat > 0.5, people.between("outer_length", -0.42, -0.12), people.between("outer_length", -0.04, 0.06)
    )
    crease = creases(places, people)
    thick = 0.019 + 0.006 * people.measure("thickness") + 0.004 * crease * (0.4 + people.measure("ease"))
    body = smooth_min(
        places.closed, sleeve_cone(x, y, z, 0.068 - 0.016 * ramp(x.abs(), 0.3, 0.7)) + thick, 0.02
    )
    tail = coat_tail(places.p, people)
    width = 0.02 + 0.055 * people.measure("collar_height") + 0.05 * ramp(-y, -0.45, 0.1)
    vee = 0.60 * (y - 0.30 + 0.08 * people.measure("collar_height")).clamp(min=0)
    front = torch.maximum(x.abs() - torch.where(openness > 0.5, width, vee), 0.7 * (0.02 - z))
    collar = 0.575 + 0.25 * (0.0 - z) - y
    covered = torch.minimum(torch.minimum(0.692 - x.abs(), y - hem), torch.minimum(collar, front))
    shape = torch.where(
        coat > 0.5, torch.maximum(smooth_min(body - thick, tail, 0.02), -covered), cloth(body, thick, covered)
    )
    base = outer_colour(people)
    color = base.expand(*x.shape, 3)
    lapel = ramp(0.030 - front, -0.001, 0.001) * ramp(y, 0.15, 0.25) * ramp(z, -0.01, 0.02)
    color = mix(color, base * 0.78 + 0.02, lapel)
    closed_line = bump(x, 0.0, 0.003) * (1 - openness) * ramp(z, 0.02, 0.04)
    color = mix(color, base * 0.45, closed_line)
    button = torch.sqrt((x - 0.02) ** 2 + (y.remainder(0.11) - 0.055) ** 2 + 1e-10)
    color = mix(
        color,
        0.15 * torch.ones_like(base),
        torch.sigmoid((0.008 - button) / 0.0008) * (1 - openness) * ramp(z, 0.02, 0.04) * (y < 0.3),
    )
    cuff = ramp(0.030 - (0.692 - x.abs()), -0.001, 0.001)
    color = mix(color, base * 0.8, cuff)
    pocket = (
        bump(y, 0.06, 0.004)
        * ramp(x.abs(), 0.075, 0.08)
        * ramp(0.135 - x.abs(), 0, 0.005)
        * ramp(z, 0.02, 0.04)
    )
    color = mix(color, base * 0.5, pocket)
    inside = torch.maximum(ramp(0.0022 - covered, 0, 0.002), ramp(hem - y, -0.004, -0.001))
    color = mix(color * (1 + 0.07 * crease[..., None]), base * 0.55, inside)
    return Layer(sdf=shape, color=color.clamp(0, 1))
