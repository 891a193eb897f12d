"""Skirts' finish: waistband, pleats and hem."""

import numpy as np
from jaxtyping import Float64

from avatargen.wardrobe.tailored.form import to_front
from avatargen.wardrobe.tailored.hanging import Fall, around
from avatargen.wardrobe.tailored.painting import Texels, cloth, line, shaded, within

BAND = 0.03  # m


def skirt_paint(fall: Fall, base: tuple[float, float, float], found: Texels) -> Float64[np.ndarray, "N 3"]:
    """A skirt's cloth, its waistband, side seams and hem; sharp folds are shaded as pleats."""
    at = found.at
    color = cloth(found, base)
    down = fall.top - at[:, 1]
    if fall.sharp:
        share = (around(at) * fall.folds / (2 * np.pi)) % 1
        inside = np.exp(-(((share - 0.36) / 0.12) ** 2)) * (down > BAND)
        color = shaded(color, inside, 0.7)
    side = line(to_front(at), 0.003) * (np.abs(at[:, 0]) > 0.1) * (not fall.sharp)
    color = shaded(color, side, 0.9)
    color = shaded(color, line(down - BAND, 0.003), 0.8)
    color = shaded(color, within(down, -1.0, 0.003), 0.9)
    return shaded(color, line(at[:, 1] - fall.hem - 0.025, 0.003), 0.88)
