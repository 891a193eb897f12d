"""A belt."""

import torch

from avatargen.wardrobe.attributes import People
from avatargen.wardrobe.chart import Places, tailor
from avatargen.wardrobe.garments.fabric import WAIST_Y, loosened
from avatargen.wardrobe.layers import Layer, cloth, mix, ramp


def belt(places: Places, people: People) -> Layer:
    """A belt at the waist with a buckle."""
    x, y, z = tailor(places.p)
    middle = WAIST_Y - 0.022 + 0.02 * people.normal("wear").clamp(-1, 1)
    covered = 0.016 - (y - middle).abs()
    leather = torch.tensor([0.16, 0.09, 0.05]).to(x) * (0.4 + 1.8 * people.measure("wear")[..., None])
    buckle = torch.sigmoid((0.022 - x.abs()) / 0.0008) * ramp(z, 0.04, 0.05)
    color = mix(leather.expand(*x.shape, 3), torch.tensor([0.75, 0.68, 0.50]).to(x), buckle)
    wide = people.measure("leg_width")
    return Layer(
        sdf=cloth(loosened(places, wide), 0.009 + 0.008 * wide + 0.002 * buckle, covered), color=color
    )
