"""What sways on a skeleton: chains of joints along cloth and hair, and what these must not pass.

Letters: N joints of a chain, its end among them.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from assets.errors import GeometryError


@dataclass(frozen=True, kw_only=True)
class Spring:
    """A chain of joints, each the parent of the next; the last one is an end, which moves nothing.

    `carriers` and `shares` are joints and weights with which cloth that does not sway has each joint's place:
    there clips put the chain.
    """

    name: str
    joints: Int64[np.ndarray, " N"]
    carriers: Int64[np.ndarray, "N 4"]
    shares: Float64[np.ndarray, "N 4"]
    stiffness: float  # how fast it goes back to how it hangs, m/s of its end
    drag: float  # share of its speed that it loses in each step
    gravity: float  # m/s of its end
    radius: float  # m around each joint that colliders keep off

    def __post_init__(self) -> None:
        if len(self.joints) < 2 or not (np.diff(self.joints) > 0).all():
            raise GeometryError(f"spring {self.name}: a chain has two joints at least, parents first")


@dataclass(frozen=True, kw_only=True)
class Collider:
    """A capsule, or a ball where `tail` is `offset`, in a joint's own frame, metres."""

    joint: int
    offset: Float64[np.ndarray, "3"]
    tail: Float64[np.ndarray, "3"]
    radius: float
