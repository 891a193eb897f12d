"""What is painted on cloth: buttons, plackets, ribs, pouches, cords and dots. Metres."""

import numpy as np
from jaxtyping import Float64

from avatargen.wardrobe.tailored.curves import Places
from avatargen.wardrobe.tailored.form import to_front
from avatargen.wardrobe.tailored.painting import line, shaded, within

Colors = Float64[np.ndarray, "N 3"]
RIB = 0.013  # from one to the next
ARM_Y, ARM_Z, ARM, TRUNK = 0.476, 0.01, 0.04, 0.15  # the arm's middle, and radii that ribs go round


def buttons(color: Colors, at: Places, x: float, height: float, radius: float = 0.008) -> Colors:
    """One button in front, lighter in its middle."""
    off = np.hypot(at[:, 0] - x, at[:, 1] - height)
    front = to_front(at) > 0
    color = shaded(color, within(off, -1.0, radius, 0.002) * front, 0.55)
    return shaded(color, within(off, -1.0, 0.45 * radius, 0.002) * front, 1.35)


def placket(color: Colors, at: Places, low: float, count: int, top: float = 0.5) -> Colors:
    """The strip down the front with buttons, from a height `low` up to the neck."""
    on = (to_front(at) > 0) & (at[:, 1] > low)
    for x in (-0.016, 0.016):
        color = shaded(color, line(at[:, 0] - x, 0.003) * on, 0.82)
    for height in np.linspace(low + 0.025, top, count):
        color = buttons(color, at, 0.0, float(height))
    return color


def ribs(color: Colors, at: Places, share: Float64[np.ndarray, " N"], *, arm: bool) -> Colors:
    """Knitted ribs where `share` is 1: along the arm or down the trunk."""
    if arm:
        round_ = np.arctan2(at[:, 1] - ARM_Y, at[:, 2] - ARM_Z) * ARM
    else:
        round_ = np.arctan2(at[:, 0], at[:, 2]) * TRUNK
    wave = 0.5 + 0.5 * np.cos(2 * np.pi * round_ / RIB)
    return shaded(color, share * wave, 0.8)


def pouch(color: Colors, at: Places, low: float) -> Colors:
    """A pocket for both hands in front, from a height `low` upward."""
    x, y = np.abs(at[:, 0]), at[:, 1] - low
    edge = np.maximum.reduce([x - 0.115, -y, y - 0.15, (x - 0.075) * 0.8 + (y - 0.09) * 0.45])
    color = shaded(color, within(edge, -0.2, 0.0, 0.003) * (to_front(at) > 0), 0.96)
    return shaded(color, line(edge, 0.0035) * (to_front(at) > 0), 0.78)


def cords(color: Colors, at: Places, low: float, high: float) -> Colors:
    """Two light cords that hang in front of the chest."""
    x = np.abs(np.abs(at[:, 0]) - 0.035)
    on = (to_front(at) > 0) & (at[:, 1] > low) & (at[:, 1] < high)
    return shaded(color, within(x, -1.0, 0.0035, 0.002) * on, 1.3)


def dots(color: Colors, flat: Float64[np.ndarray, "N 2"], pitch: float, radius: float, ink: Colors) -> Colors:
    """Dots of a colour, `pitch` from one to the next along rows that are offset by half of it."""
    row = np.round(flat[:, 1] / (0.8 * pitch))
    across = flat[:, 0] - 0.5 * pitch * (row % 2)
    off = np.hypot(across - pitch * np.round(across / pitch), flat[:, 1] - 0.8 * pitch * row)
    return color + (ink - color) * within(off, -1.0, radius, 0.0025)[:, None]
