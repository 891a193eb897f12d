"""Sneakers, boots, flats and leather shoes."""

import torch
from torch import Tensor

from avatargen.wardrobe.attributes import People
from avatargen.wardrobe.chart import SOLE, Places
from avatargen.wardrobe.garments.worn import has_skirt
from avatargen.wardrobe.layers import Layer, bump, mix, ramp, smooth_min

FLOOR = 0.952  # m below the hip, along the leg


def shoe_colour(people: People) -> Tensor:
    """Of a shoe's upper, [B 1 3]."""
    return people.colour("shoe", 0.05, 0.85, 0.14)


def shoes(places: Places, people: People) -> Layer:
    """Sneakers, boots, flats or leather shoes: the closed foot with a sole."""
    lateral, down, depth = places.leg[..., 0], -places.leg[..., 1], places.leg[..., 2]
    kind = people.kind("shoe_a", "shoe_b")  # 0 sneakers, 1 boots, 2 flats, 3 leather shoes
    tall = 0.14 + 0.22 * people.measure("leg_length") * has_skirt(people)
    shaft = torch.where(kind == 1, tall, 0.055 + 0.03 * (kind == 0))
    ground = FLOOR + SOLE
    opening = torch.where(kind == 2, 0.020 + 0.035 * ramp(0.05 - depth, 0, 0.1), shaft)
    covered = torch.minimum(down - (FLOOR - opening), ground - down)
    upper = places.closed - (0.006 + 0.004 * (kind == 1) + 0.003 * (kind == 0))
    sole = torch.maximum(places.shod - 0.0075, FLOOR - 0.006 - down)
    sdf = torch.maximum(smooth_min(upper, sole, 0.003), -covered)
    leather = shoe_colour(people)
    color = leather.expand(*down.shape, 3)
    pale = torch.where(
        ((kind == 0) | (people.measure("wear") > 0.7))[..., None],
        0.9 * torch.ones_like(leather),
        0.10 * torch.ones_like(leather),
    )
    color = mix(color, pale.expand_as(color), torch.sigmoid((down - FLOOR + 0.006) / 0.0007))
    lace = (
        torch.sin(down * 260).clamp(min=0)
        * bump(lateral - 0.015, 0, 0.020)
        * ramp(depth, 0.04, 0.06)
        * ramp(0.12 - depth, 0, 0.02)
    )
    color = mix(color, pale.expand_as(color), 0.8 * lace * ((kind == 0) | (kind == 1)))
    toe = ramp(depth, 0.135, 0.138) * (kind == 0)
    color = mix(color, pale * 0.9 + 0.05 * leather, 0.8 * toe)
    stripe = (
        torch.sigmoid((0.012 - (depth - 0.02 + 0.5 * (down - 0.9)).abs()) / 0.001)
        * (kind == 0)
        * (down > 0.89)
    )
    color = mix(color, people.colour("second", chroma=0.2), stripe)
    near_foot = torch.where(down > 0.55, sdf, torch.ones_like(sdf))
    return Layer(sdf=near_foot, color=color.clamp(0, 1))
