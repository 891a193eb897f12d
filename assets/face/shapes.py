"""Every shape of a face as displacements of its vertices: the recipes of `assets.face.names` mixed from
motions.

Letters: V welded vertices. Metres, canonical space.
"""

from collections.abc import Iterator

import numpy as np
from jaxtyping import Float64

from assets.face.motions import Motions
from assets.face.names import ARKIT, VISEMES, Recipe
from avatargen.smoothstep import smoothstep

MIDDLE = 0.010  # m on either side of the nose within which left and right are mixed
CORNERS = 0.006  # m before the lips' corners within which upper and lower are mixed


def face_shapes(
    motions: Motions,
) -> Iterator[tuple[str, Float64[np.ndarray, "V 3"]]]:
    """ARKit's 52 shapes and the 15 visemes, by name."""
    sides = side_shares(motions)
    known: dict[str, Float64[np.ndarray, "V 3"]] = {}
    for name, recipe in (ARKIT | VISEMES).items():
        yield name, motions.settled(mixed(motions, sides, recipe, known))


def mixed(
    motions: Motions,
    sides: dict[str, Float64[np.ndarray, " V"]],
    recipe: Recipe,
    known: dict[str, Float64[np.ndarray, "V 3"]],
) -> Float64[np.ndarray, "V 3"]:
    """The sum of a recipe's terms."""
    found = np.zeros_like(motions.at)
    for name, share, where in recipe:
        if name not in known:
            known[name] = motions.named(name)
        part = share * known[name]
        for side, shares in sides.items():
            if side in where:
                part = part * shares[:, None]
        found += part
    return found


def side_shares(motions: Motions) -> dict[str, Float64[np.ndarray, " V"]]:
    """How much a vertex belongs to the left or right half, and to what is above or below the lips."""
    left = smoothstep(motions.at[:, 0], -MIDDLE, MIDDLE)
    corner = motions.face.curves.lips[-1, 0]
    apart = 1 - smoothstep(np.abs(motions.at[:, 0]), corner - CORNERS, corner)
    by_height = smoothstep(motions.over, -0.02, 0.02)
    at_lips = apart * (1 - smoothstep(np.abs(motions.over), 0.01, 0.02))
    up = at_lips * motions.upper_side() + (1 - at_lips) * by_height
    return {"left": left, "right": 1 - left, "up": up, "down": 1 - up}
