"""How cloth lies on the body, creases and is printed: what several garments share."""

import torch
from torch import Tensor

from avatargen.wardrobe.attributes import People
from avatargen.wardrobe.chart import Places, tailor
from avatargen.wardrobe.layers import bump, folds, mix, ramp

ARM_Y, ARM_Z = 0.468, 0.012  # m, of the arm's axis
WAIST_Y = 0.155  # m
PERIOD = 0.07  # m, of stripes and checks
LINING = 0.30  # brightness of undersides and insides


def loosened(places: Places, ease: Tensor) -> Tensor:
    """Body for tight cloth, its closing for loose, m."""
    return places.body + (places.closed - places.body) * (0.35 + 0.65 * ease)


def sleeve_cone(x: Tensor, y: Tensor, z: Tensor, radius: Tensor) -> Tensor:
    """Distance to a cone about the arm, from the shoulder outward, m."""
    rho = torch.sqrt((y - ARM_Y) ** 2 + (z - ARM_Z) ** 2 + 1e-10)
    return torch.maximum(rho - radius, 0.16 - x.abs())


def creases(places: Places, people: People) -> Tensor:
    """Fold pattern of tops within -1.5..1.5: rings near the elbows, drapes elsewhere."""
    x, y, z = tailor(places.p)
    arm = ramp(x.abs(), 0.17, 0.24)
    rings = folds(x.abs(), y + z, 0.2) * (0.5 + 0.5 * bump(x.abs(), 0.45, 0.1))
    drapes = folds(0.55 * x + 0.8 * y, x, 0.6, 0.11) * (0.35 + 0.65 * bump(y, 0.16, 0.12))
    return people.between("creased", 0.5, 1.5) * (arm * rings + (1 - arm) * drapes)


def pattern(color: Tensor, other: Tensor, places: Places, people: People) -> Tensor:
    """Prints by three choices: plain (half of them), stripes across, stripes down, checks, a chest
    print, two blocks.
    """
    x, y, z = tailor(places.p)
    kind = people.kind("pattern_a", "pattern_b", "pattern_c")
    arm = ramp(x.abs(), 0.19, 0.21) * ramp(y, 0.25, 0.30)  # a wide dress has no arms at its sides
    along_limb = y * (1 - arm) + x.abs() * arm
    across = torch.sigmoid(torch.sin(6.2832 * along_limb / PERIOD) * PERIOD / 0.006)
    down = torch.sigmoid(torch.sin(6.2832 * (x * (1 - arm) + y * arm) / PERIOD) * PERIOD / 0.006)
    chest = torch.sqrt(x**2 + (y - 0.335) ** 2 + 1e-10)
    emblem = torch.sigmoid(
        (0.052 - (chest - 0.012 * torch.cos(5 * torch.atan2(x, y - 0.335 + 1e-6)))) / 0.0012
    ) * ramp(z, 0.04, 0.05)
    block = torch.sigmoid((along_limb * (1 - arm) - 0.30 + 10 * arm) / 0.0012)
    weight = (
        across * (kind == 4) + 0.8 * down * (kind == 5) + emblem * (kind == 6) + block * (kind == 7)
        + 0.5 * (across + down) * (kind == 3)
    )  # fmt: skip
    return mix(color, other, weight * people.between("boldness", 0.6, 1.0))
