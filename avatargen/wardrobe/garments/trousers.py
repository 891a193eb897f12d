"""Trousers, jeans, shorts and leggings."""

import torch
from torch import Tensor

from avatargen.wardrobe.attributes import People
from avatargen.wardrobe.chart import Places, tailor
from avatargen.wardrobe.garments.fabric import LINING, WAIST_Y, loosened
from avatargen.wardrobe.garments.worn import has_jeans, has_shorts
from avatargen.wardrobe.layers import Layer, bump, cloth, folds, mix, ramp, smooth_min

KNEE = 0.436  # m below the hip, along the leg


def trouser_colour(people: People) -> Tensor:
    """Blue for jeans, any for others, [B 1 3]."""
    shade = 0.5 + 1.0 * people.measure("bottom")[..., None]
    blue = torch.tensor([0.20, 0.28, 0.42]).to(people.z) * shade
    return torch.where(has_jeans(people)[..., None] > 0.5, blue, people.colour("bottom", 0.05, 0.75, 0.10))


def trousers(places: Places, people: People) -> Layer:
    """Trousers, jeans, shorts or leggings."""
    x, y, z = tailor(places.p)
    lateral, down, depth = places.leg[..., 0], -places.leg[..., 1], places.leg[..., 2]
    short = has_shorts(people)
    end = torch.where(
        short > 0.5,
        people.between("leg_length", 0.22, 0.47),
        people.between("leg_length", 0.70, 1.02).clamp(max=0.895),
    )
    jeans = has_jeans(people)
    wide = people.measure("leg_width")
    knee = bump(down, KNEE, 0.09) + 0.8 * bump(down, 0.05, 0.08) + 0.9 * bump(down, 0.84, 0.06)
    crease = (
        people.between("creased", 0.5, 1.5)
        * folds(down, lateral + depth, 0.4)
        * (0.25 + 0.75 * knee.clamp(0, 1))
        * ramp(down, -0.06, 0.02)
    )
    thick = 0.004 + 0.008 * wide + (0.0008 + 0.0025 * wide) * crease
    centre_z = 0.018 - 0.055 * ramp(down, 0.15, 0.62)
    rho = torch.sqrt((lateral - 0.02 * ramp(down, 0, 0.87)) ** 2 + (depth - centre_z) ** 2 + 1e-10)
    radius = (
        0.062
        + 0.034 * wide
        + 0.028 * bump(down, 0.05, 0.25)
        + 0.035 * (people.measure("flare") - 0.6).clamp(min=0) * ramp(down, 0.45, 0.9)
    )
    cone = rho - radius + 0.12 * ramp(0.26 - down, 0.0, 0.24)  # melts into the hip
    body = smooth_min(loosened(places, wide), cone + thick, 0.03)
    covered = torch.minimum(WAIST_Y + 0.02 * people.normal("wear").clamp(-1, 1) - y, end - down)
    color = trouser_colour(people).expand(*x.shape, 3)
    worn = (
        jeans
        * (bump(down, 0.22, 0.13) + 0.7 * bump(down, KNEE, 0.07))
        * ramp(depth, 0.0, 0.06)
        * people.measure("wear")
    )
    color = mix(color, color + 0.16, worn)
    seam = bump(depth - centre_z, 0, 0.0035) * ramp(lateral, 0.02, 0.04) * ramp(down, -0.12, -0.05)
    color = mix(color, color * 0.72, 0.7 * seam)
    color = mix(
        color,
        color * 0.75,
        bump(x, 0, 0.0035) * ramp(depth, 0.06, 0.08) * ramp(-y, -0.15, -0.13) * ramp(y, -0.06, -0.04),
    )  # fly
    pocket = (
        bump(y + 0.9 * (x.abs() - 0.12), 0.06, 0.004)
        * ramp(x.abs(), 0.085, 0.095)
        * ramp(0.155 - x.abs(), 0, 0.01)
        * ramp(z, 0.03, 0.05)
    )
    color = mix(color, color * 0.65, pocket)
    cuff = ramp(0.018 - (end - down), -0.001, 0.001)
    color = mix(color, color * 0.85, cuff) * (1 + 0.08 * crease[..., None])
    under = ramp(down - end, -0.002, 0.0005)
    color = mix(color, color * LINING, under)
    return Layer(sdf=cloth(body, thick + 0.0015 * cuff, covered), color=color.clamp(0, 1))
