"""T-shirts, shirts, vests and sweaters."""

import torch
from torch import Tensor

from avatargen.wardrobe.attributes import People
from avatargen.wardrobe.chart import Places, tailor
from avatargen.wardrobe.garments.fabric import WAIST_Y, creases, loosened, pattern, sleeve_cone
from avatargen.wardrobe.garments.worn import has_skirt
from avatargen.wardrobe.layers import Layer, cloth, mix, ramp, smooth_min


def neck_opening(x: Tensor, y: Tensor, z: Tensor, deep: Tensor, vee: Tensor, turtle: Tensor) -> Tensor:
    """Metres covered below a neckline: round or V, `deep` metres below the collar; a turtleneck
    climbs the neck.
    """
    round_cut = torch.sqrt(
        (x / 0.085) ** 2 + ((y - 0.560) / (0.055 + deep)) ** 2 + ((z - 0.045) / 0.105) ** 2 + 1e-10
    )
    bowl = (round_cut - 1) * 0.075
    wedge = (x.abs() - 0.55 * (y - (0.44 - 1.3 * deep))) * 0.8
    front = ramp(z, 0.0, 0.03)
    bowl = torch.where(vee > 0.5, torch.minimum(bowl, wedge * front + 0.1 * (1 - front)), bowl)
    low = 0.552 - y
    high = 0.590 + 0.25 * (0.02 - z) - y
    return torch.where(turtle > 0.5, high, torch.minimum(low, bowl))


def top(places: Places, people: People) -> Layer:
    """T-shirt, shirt, vest or sweater; women's dresses share it."""
    x, y, z = tailor(places.p)
    kind = people.kind("collar_a", "collar_b")  # 0 round, 1 V, 2 shirt, 3 turtleneck
    knit = (kind == 3) | (people.measure("thickness") > 0.75)
    sleeve = people.between("sleeve", 0.135, 0.84).clamp(max=0.69)
    sleeve = torch.where(knit, sleeve.clamp(min=0.60), sleeve)
    layered = people.choice("outer_a")  # under a jacket: close-fitting, and not longer than it
    hem = people.between("hem", -0.09, 0.06) + 0.05 * layered
    ease = people.measure("ease") * (1 - 0.9 * layered)
    crease = creases(places, people)
    tucked_in = people.choice("tucked") * ramp(WAIST_Y + 0.03 - y, 0.0, 0.04)
    thick = (
        0.0045 + 0.006 * people.measure("thickness") + 0.005 * knit + 0.012 * ease * ramp(-y, -0.34, -0.05)
    )
    thick = (thick + (0.0012 + 0.0022 * ease) * crease) * (1 - 0.35 * layered)
    below = torch.where(has_skirt(people) > 0.5, 0.012, 0.005 + 0.0105 * people.measure("leg_width"))
    over_it = (below + 0.003) * ramp(
        WAIST_Y + 0.035 - y, 0.0, 0.05
    )  # what is worn below the waist stays under
    thick = torch.maximum(thick, over_it)
    thick = thick + (0.003 - thick) * tucked_in
    body = loosened(places, ease * (1 - tucked_in))
    width = people.between("sleeve_width", 0.052, 0.078) - 0.03 * ramp(x.abs(), 0.3, 0.7) * (1 - 0.3 * ease)
    body = torch.where(
        (sleeve > 0.2) & (layered < 0.5), smooth_min(body, sleeve_cone(x, y, z, width) + thick, 0.02), body
    )
    deep = people.between("neckline", 0.0, 0.055)
    neck = neck_opening(x, y, z, deep, ((kind == 1) | (kind == 2)).to(x), (kind == 3).to(x))
    covered = torch.minimum(torch.minimum(sleeve - x.abs(), y - hem), neck)
    color, other = people.colour("top"), people.colour("second", chroma=0.2)
    painted = pattern(color.expand(*x.shape, 3), other, places, people)
    rib = ramp(0.016 - torch.minimum(sleeve - x.abs(), y - hem), -0.001, 0.001) * knit + ramp(
        0.014 - neck, -0.001, 0.001
    ) * (kind != 2)
    painted = mix(painted, color * 0.78, 0.8 * rib.clamp(0, 1))
    placket = torch.sigmoid((0.013 - x.abs()) / 0.0008) * ramp(z, 0.03, 0.05) * (kind == 2)
    painted = mix(painted, color * 0.88 + 0.03, placket)
    button = torch.sqrt(x**2 + ((y + 0.01).remainder(0.075) - 0.0375) ** 2 + 1e-10)
    painted = mix(painted, 0.9 - 0.75 * color.round(), placket * torch.sigmoid((0.005 - button) / 0.0006))
    collar = ramp(0.030 - neck, -0.0008, 0.0008) * (kind == 2)
    painted = mix(painted, color * 0.92 + 0.04, collar)
    thick = thick + 0.004 * collar + 0.002 * rib.clamp(0, 1)
    painted = painted * (1 + 0.07 * crease[..., None])
    return Layer(sdf=cloth(body, thick, covered), color=painted.clamp(0, 1))
