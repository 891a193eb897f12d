"""How much of the surface counts where: people look at faces, so a millimetre there counts for more."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float, Float64

from avatargen.body.model import CanonicalBody

Importance = Callable[[Float[np.ndarray, "N 3"]], Float64[np.ndarray, " N"]]  # at canonical points

NECK, HEAD = "neck", "head"  # joints: all of the way from one to the other the weight grows


def evenly(points: Float[np.ndarray, "N 3"]) -> Float64[np.ndarray, " N"]:
    """All alike."""
    return np.ones(len(points))


def by_looks(body: CanonicalBody, detail: float) -> Importance:
    """On the head, squared errors weigh `detail` cubed times those elsewhere. Where faces are spread best,
    their number goes with the cube root of the weight: they come `detail` times as dense. A body without a
    head by name counts evenly."""
    names = body.joint_names
    if NECK not in names or HEAD not in names:
        return evenly
    neck, head = (body.joints[names.index(name)].astype(np.float64) for name in (NECK, HEAD))
    axis = (head - neck) / max(float(((head - neck) ** 2).sum()), 1e-12)

    def weight(points: Float[np.ndarray, "N 3"]) -> Float64[np.ndarray, " N"]:
        share = np.clip((np.asarray(points, np.float64) - neck) @ axis, 0, 1)
        return 1 + (detail**3 - 1) * share

    return weight
