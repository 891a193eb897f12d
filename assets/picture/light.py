"""Soft light: how much points receive of each of many far lamps around a surface that throws shadows.

For every lamp the surface is cast onto a small picture that keeps what lies nearest to the lamp; a point no
farther than that is lit. Weighted by Lambert's cosine the lamps make soft shadows and dark hollows at once.
How strong each lamp shines is chosen afterwards, for each camera, at no cost.

Letters: V points, D lamps, K samples of the surface. A lamp is the unit direction from the surface to it.
"""

import numpy as np
from jaxtyping import Float, Float64, Int64

from assets.mesh.measure import points_on, sample_surface
from assets.mesh.surface import Surface

LAMPS = 64
SAMPLES = 100_000  # one every 4 mm on a person
PIXEL = 0.010  # metres a pixel of a lamp's picture
CLEARANCE = 0.012  # metres before a point in which nothing shades it: its own surroundings


def lamps_around(count: int = LAMPS) -> Float64[np.ndarray, "D 3"]:
    """Directions along a golden spiral over the sphere; none is straight up or down."""
    height = 1 - (2 * np.arange(count) + 1) / count
    turn = np.pi * (3 - np.sqrt(5)) * np.arange(count)
    ring = np.sqrt(1 - height**2)
    return np.stack([ring * np.cos(turn), height, ring * np.sin(turn)], axis=1)


def cast_samples(surface: Surface) -> Float64[np.ndarray, "K 3"]:
    """The points of a surface that cast its shadows."""
    return points_on(surface, *sample_surface(surface, SAMPLES, seed=0))


def received(
    points: Float64[np.ndarray, "V 3"],
    normals: Float64[np.ndarray, "V 3"],
    casters: Float64[np.ndarray, "K 3"],
    lamps: Float64[np.ndarray, "D 3"],
) -> Float64[np.ndarray, "V D"]:
    """Share of each lamp's light that each point receives: 0 in shadow and facing away.

    A point that sees its whole half of the sky receives 1 in all.
    """
    lifted = points + CLEARANCE / 4 * normals
    light = np.zeros((len(points), len(lamps)))
    for number, lamp in enumerate(lamps):
        cosine = normals @ lamp
        facing = np.flatnonzero(cosine > 0)
        light[facing, number] = cosine[facing] * sees(lifted[facing], casters, lamp)
    return 4 / len(lamps) * light


def sees(
    points: Float64[np.ndarray, "V 3"], casters: Float64[np.ndarray, "K 3"], lamp: Float64[np.ndarray, "3"]
) -> Float64[np.ndarray, " V"]:
    """How much of a lamp each point sees, 0 to 1; the four pixels around a point blend.

    Works for every lamp that is not straight up or down.
    """
    right = np.cross([0.0, 1.0, 0.0], lamp)
    right /= np.maximum(np.linalg.norm(right), 1e-9)
    axes = np.stack([right, np.cross(lamp, right)], axis=1) / PIXEL
    cast, place = casters @ axes, points @ axes
    low = cast.min(axis=0) - 1
    size = np.ceil(cast.max(axis=0) - low).astype(np.int64) + 2
    nearest = np.full(size.prod(), -np.inf)
    np.maximum.at(nearest, pixel_of(np.rint(cast - low), size), casters @ lamp)
    corner = np.floor(place - low)
    share, depth = place - low - corner, points @ lamp + CLEARANCE
    light = np.zeros(len(points))
    for x in (0, 1):
        for y in (0, 1):
            weight = np.abs(1 - x - share[:, 0]) * np.abs(1 - y - share[:, 1])
            light += weight * (nearest[pixel_of(corner + np.array([x, y]), size)] <= depth)
    return light


def pixel_of(place: Float[np.ndarray, "N 2"], size: Int64[np.ndarray, "2"]) -> Int64[np.ndarray, " N"]:
    """Numbers of the pixels centred at whole places; beyond the rim, of the nearest pixel there (empty)."""
    column, row = np.clip(place, 0, size - 1).astype(np.int64).T
    return column * size[1] + row
