"""Folds: where cloth is pulled and where it has too much length, it makes ridges, each in its own direction.

Ridges run from the armpits down and inward, lie across the waist, around elbows and knees, spread from the
crotch, and hang below the chest. A family of them is a wave along one direction, bent and broken by noise of
half a hand's length, so that no ridge is straight and each comes to an end; ridges are narrow, what is
between them is wide.

Letters: V vertices. Metres; places are a sheet's `at`: legs straight, arms to the sides.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from avatargen.smoothstep import smoothstep
from avatargen.wardrobe.tailored.curves import Places, Values

ARMPIT = (0.165, 0.375)  # beside the middle, above the pelvis
CROTCH = (0.0, -0.11)
ELBOW = 0.44  # along an arm, from the middle
WAIST, KNEE, ANKLE = 0.13, -0.46, -0.84  # heights
BEND = 1.1  # radians that noise moves a ridge by
UNBROKEN = 0.35  # of the noise, above which a ridge is whole


def noise(at: Places, size: float, seed: int) -> Values:
    """Smooth and about -1..1, with hills `size` apart."""
    rng = np.random.default_rng(seed)
    total = np.zeros(len(at))
    for _ in range(8):
        direction = rng.normal(size=3)
        pitch = direction / np.linalg.norm(direction) * rng.uniform(0.7, 1.4) * 2 * np.pi / (1.6 * size)
        total += np.sin(at @ pitch + rng.uniform(0, 2 * np.pi))
    return total / 2.8


@dataclass(frozen=True, kw_only=True)
class Family:
    """Ridges of one direction: turns of the wave, and how far they are there, 0..1, at each vertex."""

    turns: Float64[np.ndarray, " V"]
    there: Float64[np.ndarray, " V"]


def hill(value: Values, middle: float, width: float) -> Values:
    return np.exp(-(((value - middle) / width) ** 2))


def ridges(at: Places, family: Family, seed: int) -> Values:
    """How high a family's ridges stand, 0..1."""
    phase = 2 * np.pi * family.turns + BEND * noise(at, 0.09, seed)
    whole = smoothstep((noise(at, 0.07, seed + 1) + UNBROKEN) / 0.8)
    return ((0.5 + 0.5 * np.cos(phase)) ** 2.5) * whole * family.there


def of_top(at: Places, end: float | None, hem: float) -> Values:
    """How far a top's folds stand out, about 0..1; `end` is the sleeves', `hem` a height."""
    x, y, z = np.abs(at[:, 0]), at[:, 1], at[:, 2]
    body = 1 - smoothstep((x - 0.15) / 0.05)
    back = smoothstep(0.5 - z / 0.1)
    toward = np.arctan2(ARMPIT[1] - y, ARMPIT[0] - x)  # 0 inward, a quarter turn down
    far = np.hypot(x - ARMPIT[0], y - ARMPIT[1])
    pulled = Family(
        turns=toward / np.radians(24),
        there=smoothstep((far - 0.015) / 0.04)
        * (1 - smoothstep((far - 0.08) / 0.1))
        * smoothstep((y - hem) / 0.15)
        * body,
    )
    slack = Family(
        turns=(y + 0.35 * x) / 0.062,
        there=hill(y, WAIST, 0.1) * (0.4 + 0.6 * np.maximum(smoothstep((x - 0.06) / 0.07), back)) * body,
    )
    around = np.arctan2(at[:, 0], z) * 0.14
    hanging = Family(
        turns=(around + 0.3 * (y - hem) * np.sign(at[:, 0])) / 0.105,
        there=(1 - smoothstep((y - 0.1) / 0.2)) * body * (hem < WAIST),
    )
    families = [(pulled, 11, 0.6), (slack, 23, 1.0), (hanging, 37, 1.0)]
    if end is not None:
        families.append((sleeve_rings(at, end), 51, 1.0))
    return np.max([share * ridges(at, family, seed) for family, seed, share in families], axis=0)


def sleeve_rings(at: Places, end: float) -> Family:
    """Around a sleeve: at the elbow where it covers that, before the cuff, and at the shoulder of a short
    one. They lean, one way above the arm and the other below, as cloth around a tube does."""
    x = np.abs(at[:, 0])
    around = np.abs(np.arctan2(at[:, 2], at[:, 1] - 0.43)) / np.pi
    elbow = hill(x, ELBOW, 0.075) * (end > ELBOW + 0.04)
    cuff = 0.8 * hill(x, end - 0.055, 0.04) * (end > ELBOW + 0.08)
    upper = hill(x, 0.235, 0.035) * 0.6
    return Family(turns=(x + 0.05 * around) / 0.046, there=np.maximum.reduce([elbow, cuff, upper]))


def of_bottom(at: Places, hem: float) -> Values:
    """How far trousers' folds stand out, about 0..1; `hem` is a height."""
    x, y, z = np.abs(at[:, 0]), at[:, 1], at[:, 2]
    front = smoothstep(z / 0.04)
    toward = np.arctan2(y - CROTCH[1], x - CROTCH[0])  # 0 outward, a quarter turn up
    far = np.hypot(x - CROTCH[0], y - CROTCH[1])
    spread = Family(
        turns=toward / np.radians(19),
        there=smoothstep((far - 0.02) / 0.04) * (1 - smoothstep((far - 0.11) / 0.07)) * (0.35 + 0.65 * front),
    )
    knee = Family(
        turns=(y + 0.25 * np.abs(x - 0.1) * np.where(z > 0, 1, -1)) / 0.05,
        there=hill(y, KNEE, 0.09) * (0.4 + 0.6 * (1 - front)) * (hem < KNEE - 0.08),
    )
    stacked = Family(
        turns=(y + 0.15 * x) / 0.04,
        there=hill(y, hem + 0.08, 0.06) * (hem < ANKLE + 0.08),
    )
    seat = Family(
        turns=(y + 0.9 * np.abs(x - 0.08)) / 0.055,
        there=hill(y, -0.15, 0.05) * (1 - front) * 0.8,
    )
    families = [(spread, 11, 0.8), (knee, 23, 1.0), (stacked, 37, 1.0), (seat, 51, 0.8)]
    return np.max([share * ridges(at, family, seed) for family, seed, share in families], axis=0)
