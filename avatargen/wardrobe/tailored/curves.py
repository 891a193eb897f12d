"""The curves that patterns are cut along, as functions of places on the form: metres, positive on what is
kept."""

import numpy as np
from jaxtyping import Float64

from avatargen.smoothstep import smoothstep
from avatargen.wardrobe.tailored.form import to_front

SHOULDER = 0.58  # m, height of the shoulders' tops beside the neck

Places = Float64[np.ndarray, "V 3"]
Values = Float64[np.ndarray, " V"]


def neckline(at: Places, width: float, front: float, back: float, power: float = 2.0) -> Values:
    """Outside a neck's opening, `width` metres to either side on the shoulders, `front` and `back` metres
    deep below them. `power` 1 is a V, 2 round, 4 square."""
    deep = back + (front - back) * smoothstep(0.5 + to_front(at) / 0.016)
    x, y = np.abs(at[:, 0]) / width, (SHOULDER - at[:, 1]).clip(0) / deep
    radius = np.maximum((x**power + y**power) ** (1 / power), 1e-6)
    steep = np.hypot(x ** (power - 1) / width, y ** (power - 1) / deep) / radius ** (power - 1)
    return np.minimum((radius - 1) / np.maximum(steep, 1e-3), SHOULDER + 0.03 - at[:, 1])  # no ears


def above(at: Places, height: float) -> Values:
    """Above a hem, or a waist from below."""
    return at[:, 1] - height


def below(at: Places, height: float, dip: float = 0.0) -> Values:
    """Below a waist that dips by metres in front."""
    return height - dip * smoothstep(0.5 + to_front(at) / 0.2) - at[:, 1]


def sleeve(at: Places, end: float) -> Values:
    """Inward of a sleeve's end, metres from the middle along the arm; far inward on what lies below."""
    return end - np.abs(at[:, 0]) + 4 * (0.37 - at[:, 1]).clip(0)


def armscye(at: Places, top: float = 0.163, under: float = 0.186) -> Values:
    """Inward of the seam around the arm, `top` and `under` metres from the middle on the shoulder and under
    the arm; far inward on what lies below."""
    share = smoothstep((0.525 - at[:, 1]) / 0.13)
    seam = top + (under - top) * share - 0.012 * np.sin(np.pi * share)
    return seam - np.abs(at[:, 0]) + 2 * (0.385 - at[:, 1]).clip(0)
