"""Beards on the default body's face: where they grow, how dense, and how far they stand out.

Letters: N points. Metres, canonical space.
"""

import numpy as np
from jaxtyping import Float, Float64

from avatargen.compiled import compiled
from avatargen.wardrobe.lips import LIPS_HALF, LIPS_Y, smooth
from avatargen.wardrobe.strand_pattern import noise

BEARDS = ("none", "stubble", "moustache", "goatee", "full")
DENSITY = {"stubble": 0.42, "moustache": 0.93, "goatee": 0.93, "full": 0.95}
STANDS = {"stubble": 0.0, "moustache": 0.0028, "goatee": 0.0045, "full": 0.0060}  # m
LOW, HIGH = (-0.085, 0.585, 0.035), (0.085, 0.725, 0.175)  # m, a box around all of them
CHEEK, RISES = 0.661, 0.055  # m: the upper edge on the cheek, and how far it rises to the sideburns
THROAT, FOLLOWS = 0.600, 0.35  # m: the lower edge under the chin; how it follows the jaw backward
LIP = 0.0085  # m from where the lips meet to their edges
FINE, LONG = 0.0012, 0.010  # m across the hairs and along them


def on_lips(x: np.ndarray, y: np.ndarray, wider: float, soft: float) -> np.ndarray:
    """1 on the lips, made `wider` (m) with an edge of `soft` m."""
    across = np.clip(1 - (x / (LIPS_HALF + wider)) ** 2, 0, None) ** 0.6
    inside = (LIP + wider) * across - np.abs(y - LIPS_Y + 0.001)
    return smooth(inside, -0.5 * soft, 0.5 * soft) * (across > 0)


def grown(kind: str, points: Float64[np.ndarray, "N 3"], ragged: np.ndarray | float) -> np.ndarray:
    """How far hair of a kind of beard covers the face, 0..1; edges lie `ragged` (m) further out."""
    x, y, z = points.T
    cheek = CHEEK + RISES * smooth(-z, -0.092, -0.052) + ragged
    throat = THROAT + FOLLOWS * np.clip(0.11 - z, 0, None) - ragged
    jaw = smooth(cheek - y, -0.005, 0.007) * smooth(y - throat, -0.006, 0.007) * smooth(z, 0.050, 0.064)
    above = y - (LIPS_Y + 0.0125) + 0.10 * np.abs(x)
    lip = smooth(0.0075 + ragged - np.abs(above), -0.002, 0.003) * smooth(0.031 - np.abs(x), 0.0, 0.005)
    lip = lip * smooth(z, 0.10, 0.115)
    if kind == "moustache":
        found = lip
    elif kind == "goatee":
        chin = jaw * smooth(0.027 + ragged - np.abs(x), -0.003, 0.005) * smooth(z, 0.09, 0.105)
        found = np.maximum(lip, chin * (y < LIPS_Y + 0.006))
    else:
        found = np.maximum(jaw, lip)
    return found


def beard_relief(kind: str, points: Float[np.ndarray, "N 3"]) -> Float64[np.ndarray, " N"]:
    """Metres by which the skin stands out under a beard."""
    found = np.zeros(len(points))
    if STANDS.get(kind, 0.0) > 0:
        near = np.flatnonzero(((points > LOW) & (points < HIGH)).all(axis=1))
        at = points[near].astype(np.float64)
        bare = 1 - on_lips(at[:, 0], at[:, 1], 0.0025, 0.006)
        found[near] = STANDS[kind] * grown(kind, at, 0.0) ** 1.5 * bare
    return found


def beard_cover(kind: str, points: Float64[np.ndarray, "N 3"]) -> Float64[np.ndarray, " N"]:
    """How much of the skin a beard hides, 0..1, hair by hair."""
    hairs = np.empty(len(points))
    fill_hairs(np.ascontiguousarray(points), kind == "stubble", hairs)
    whole = grown(kind, points, 0.004 * hairs) * (1 - on_lips(points[:, 0], points[:, 1], 0.0, 0.002))
    if kind == "stubble":
        return DENSITY[kind] * whole * (0.75 + 0.45 * hairs).clip(0, 1)
    return DENSITY[kind] * whole * (0.88 + 0.35 * hairs).clip(0, 1)


@compiled
def fill_hairs(points, short, found):
    """Fill in the pattern of hairs [N], -1..1, that grow down the face, or `short` ones that do not lie."""
    long = 1.3 * FINE if short else LONG
    for n in range(len(points)):
        x, y, z = points[n, 0], points[n, 1], points[n, 2]
        round_ = 0.07 * np.arctan2(x, z - 0.045)
        across, along = round_ + 0.25 * (y - 0.62) * np.sign(x), y - 0.3 * z
        fine = noise(across / FINE, along / long, 91)
        found[n] = 0.6 * fine + 0.4 * noise(across / (2.6 * FINE), along / (2.6 * long), 92)
