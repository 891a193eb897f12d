"""MakeHuman's base mesh hm08 where our template stands: vertices at rest, and how they are carried to the
canonical body. Made by `derive.py`.
"""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from jaxtyping import Float64, Int64

from avatargen.body.arrays import read_npz
from avatargen.errors import InputError

HM08_VERTICES = 19158
FILE = Path(__file__).parent / "hm08.npz"
ARRAYS = ("rest", "joints", "weights", "T_canonical_rest", "hm08_of_body", "uv", "uv_corners", "eyes")


@dataclass(frozen=True, kw_only=True)
class Hm08:
    """The base mesh with its helper geometry, metres, y up, facing +z.

    `rest` is MakeHuman's rest pose, in which garments are bound. Carried by its joints and weights, it lies
    on the canonical body.
    """

    rest: Float64[np.ndarray, "V 3"]
    joints: Int64[np.ndarray, "V 6"]
    weights: Float64[np.ndarray, "V 6"]
    T_canonical_rest: Float64[np.ndarray, "J 4 4"]
    hm08_of_body: Int64[np.ndarray, " W"]  # the vertex of hm08 under each body vertex; -1 on the eyes
    uv: Float64[np.ndarray, "T 2"]  # of MakeHuman's skins, v counts upward
    uv_corners: Int64[np.ndarray, "F 3"]  # rows of uv at the corners of the body's faces
    eyes: Float64[np.ndarray, "2 4"]  # centre and radius of the left and the right eyeball, canonical, m

    @cached_property
    def dense_weights(self) -> Float64[np.ndarray, "V J"]:
        """Every vertex's weight on every joint."""
        dense = np.zeros((len(self.rest), len(self.T_canonical_rest)))
        np.add.at(dense, (np.arange(len(dense))[:, None], self.joints), self.weights)
        return dense

    @cached_property
    def body_at_rest(self) -> Float64[np.ndarray, "W 3"]:
        """The body's vertices in MakeHuman's rest pose; NaN on the eyes."""
        return np.where(self.hm08_of_body[:, None] < 0, np.nan, self.rest[self.hm08_of_body])

    def hidden_body(self, hidden: Int64[np.ndarray, " H"]) -> Int64[np.ndarray, " B"]:
        """The body's vertices among vertices of hm08."""
        return np.flatnonzero(np.isin(self.hm08_of_body, hidden))


def load_hm08(path: Path = FILE) -> Hm08:
    """Read the file that comes with the package.

    Raises:
        InputError: the file is missing or damaged.
    """
    found = read_npz(path, ARRAYS, "hm08")
    if missing := [name for name in ARRAYS if name not in found]:
        raise InputError(f"hm08: {path} lacks {', '.join(missing)}; install the package again")
    weights = found["weights"].astype(np.float64)
    return Hm08(
        rest=found["rest"].astype(np.float64),
        joints=found["joints"].astype(np.int64),
        weights=weights / weights.sum(axis=1, keepdims=True),
        T_canonical_rest=found["T_canonical_rest"].astype(np.float64),
        hm08_of_body=found["hm08_of_body"].astype(np.int64),
        uv=found["uv"] / 65535.0,
        uv_corners=found["uv_corners"].astype(np.int64),
        eyes=found["eyes"].astype(np.float64),
    )
