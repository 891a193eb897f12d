"""Beards on the default body's face: where they grow, how dense, and how far they stand out.

Letters: N points. Metres, canonical space.
"""

import numpy as np
from jaxtyping import Float, Float64

from avatargen.compiled import compiled, inner
from avatargen.wardrobe.lips import LIPS_HALF, LIPS_Y
from avatargen.wardrobe.strand_pattern import noise

BEARDS = NONE, STUBBLE, MOUSTACHE, GOATEE, FULL = ("none", "stubble", "moustache", "goatee", "full")
DENSITY = {STUBBLE: 0.42, MOUSTACHE: 0.93, GOATEE: 0.93, FULL: 0.95}
STANDS = {STUBBLE: 0.0, MOUSTACHE: 0.0028, GOATEE: 0.0045, FULL: 0.0060}  # m
LOW, HIGH = (-0.085, 0.585, 0.035), (0.085, 0.725, 0.175)  # m, a box around all of them
CHEEK, RISES = 0.661, 0.055  # m: the upper edge on the cheek, and how far it rises to the sideburns
THROAT, FOLLOWS = 0.600, 0.35  # m: the lower edge under the chin; how it follows the jaw backward
LIP = 0.0085  # m from where the lips meet to their edges
WIDER, SOFTER = 0.0025, 0.006  # m around the lips where nothing stands out
RAGGED = 0.004  # m that edges go to and fro
FINE, LONG = 0.0012, 0.010  # m across the hairs and along them


def beard_relief(kind: str, points: Float[np.ndarray, "N 3"]) -> Float64[np.ndarray, " N"]:
    """Metres by which the skin stands out under a beard."""
    found = np.zeros(len(points))
    if STANDS.get(kind, 0.0) > 0:
        fill_relief(points, BEARDS.index(kind), STANDS[kind], found)
    return found


def beard_cover(kind: str, points: Float64[np.ndarray, "N 3"]) -> Float64[np.ndarray, " N"]:
    """How much of the skin a beard hides, 0..1, hair by hair."""
    found = np.zeros(len(points))
    if kind != NONE:
        fill_cover(np.ascontiguousarray(points), BEARDS.index(kind), DENSITY[kind], found)
    return found


@inner
def step(x, low, high):
    """Smoothstep from 0 at low to 1 at high."""
    t = min(max((x - low) / (high - low), 0.0), 1.0)
    return t * t * (3 - 2 * t)


@inner
def on_lips(x, y, wider, soft):
    """1 on the lips, made `wider` (m), with an edge of `soft` m."""
    across = 1 - (x / (LIPS_HALF + wider)) ** 2
    if across <= 0:
        return 0.0
    inside = (LIP + wider) * across**0.6 - abs(y - LIPS_Y + 0.001)
    return step(inside, -0.5 * soft, 0.5 * soft)


@inner
def grown(kind, x, y, z, ragged):
    """How far hair of a kind of beard (by its number) covers the face, 0..1; edges lie `ragged` m further
    out."""
    side = abs(x)
    above = abs(y - (LIPS_Y + 0.0125) + 0.10 * side)
    lip = step(0.0075 + ragged - above, -0.002, 0.003) * step(0.031 - side, 0.0, 0.005) * step(z, 0.10, 0.115)
    if kind == 2:
        return lip
    cheek = CHEEK + RISES * step(-z, -0.092, -0.052) + ragged
    throat = THROAT + FOLLOWS * max(0.11 - z, 0.0) - ragged
    jaw = step(cheek - y, -0.005, 0.007) * step(y - throat, -0.006, 0.007) * step(z, 0.050, 0.064)
    if kind == 3:
        below = 1.0 if y < LIPS_Y + 0.006 else 0.0
        jaw *= below * step(0.027 + ragged - side, -0.003, 0.005) * step(z, 0.09, 0.105)
    return max(jaw, lip)


@inner
def hairs(x, y, z, short):
    """The pattern of hairs, -1..1, that grow down the face, or `short` ones that do not lie."""
    long = 1.3 * FINE if short else LONG
    across = 0.07 * np.arctan2(x, z - 0.045) + 0.25 * (y - 0.62) * np.sign(x)
    along = y - 0.3 * z
    fine = noise(across / FINE, along / long, 91)
    return 0.6 * fine + 0.4 * noise(across / (2.6 * FINE), along / (2.6 * long), 92)


@compiled
def fill_relief(points, kind, stands, found):
    """Fill in how far a beard stands out [N], up to `stands` m, at points [N 3]."""
    for n in range(len(points)):
        x, y, z = np.float64(points[n, 0]), np.float64(points[n, 1]), np.float64(points[n, 2])
        if LOW[0] < x < HIGH[0] and LOW[1] < y < HIGH[1] and LOW[2] < z < HIGH[2]:
            bare = 1 - on_lips(x, y, WIDER, SOFTER)
            found[n] = stands * bare * grown(kind, x, y, z, 0.0) ** 1.5


@compiled
def fill_cover(points, kind, density, found):
    """Fill in how much of the skin a beard hides [N] at points [N 3], where it is `density` at most."""
    for n in range(len(points)):
        x, y, z = points[n, 0], points[n, 1], points[n, 2]
        hair = hairs(x, y, z, kind == 1)
        middle, more = (0.75, 0.45) if kind == 1 else (0.88, 0.35)
        dense = min(max(middle + more * hair, 0.0), 1.0)
        bare = 1 - on_lips(x, y, 0.0, 0.002)
        found[n] = density * dense * bare * grown(kind, x, y, z, RAGGED * hair)
