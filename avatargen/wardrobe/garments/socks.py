"""Short socks."""

import torch

from avatargen.wardrobe.attributes import People
from avatargen.wardrobe.chart import Places
from avatargen.wardrobe.layers import Layer, cloth

ANKLE = 0.871  # m below the hip, along the leg


def socks(places: Places, people: People) -> Layer:
    """Short socks, seen below shorts and skirts."""
    down = -places.leg[..., 1]
    covered = down - (ANKLE - people.between("leg_length", 0.02, 0.14))
    color = people.colour("second", 0.3, 0.95, 0.05).expand(*down.shape, 3)
    sdf = torch.where(down > 0.55, cloth(places.closed, 0.0025, covered), torch.ones_like(down))
    return Layer(sdf=sdf, color=color)
