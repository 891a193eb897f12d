"""A mesh's numbers rounded to 8 and 16 bits (KHR_mesh_quantization): about half the bytes.

Places become 16-bit steps of a cube around the mesh, .03 mm apart on a person; the mesh's node turns them
back into metres. Letters: W vertices, C columns.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float64, Int8, Int16, UInt16

EXTENSION = "KHR_mesh_quantization"


@dataclass(frozen=True)
class Cube:
    """Where the stored places lie: metres = half * stored + centre, stored in -1..1."""

    centre: Float64[np.ndarray, "3"]
    half: float

    def places(self, vertices: Float[np.ndarray, "W 3"]) -> Int16[np.ndarray, "W 3"]:
        stored = (vertices - self.centre) / self.half
        return np.rint(32767 * np.clip(stored, -1, 1)).astype(np.int16)


def cube_around(vertices: Float[np.ndarray, "W 3"]) -> Cube:
    """The smallest cube about the middle of the vertices; some room for a mesh of one point."""
    low, high = vertices.min(axis=0).astype(np.float64), vertices.max(axis=0).astype(np.float64)
    return Cube(centre=(low + high) / 2, half=max(float((high - low).max()) / 2, 1e-6))


def directions(unit: Float[np.ndarray, "W C"]) -> Int8[np.ndarray, "W C"]:
    """Unit vectors, within half a degree; a sign in a fourth column stays."""
    return np.rint(127 * np.clip(unit, -1, 1)).astype(np.int8)


def shares(values: Float[np.ndarray, "W C"]) -> UInt16[np.ndarray, "W C"]:
    """Numbers from 0 to 1."""
    return np.rint(65535 * np.clip(values, 0, 1)).astype(np.uint16)


def whole_weights(weights: Float[np.ndarray, "W 4"]) -> UInt16[np.ndarray, "W 4"]:
    """Weights whose rows still sum to 1: the heaviest takes what the others' rounding left."""
    rounded = shares(weights / weights.sum(axis=1, keepdims=True, dtype=np.float64)).astype(np.int64)
    rows, heaviest = np.arange(len(rounded)), rounded.argmax(axis=1)
    rounded[rows, heaviest] += 65535 - rounded.sum(axis=1)
    return rounded.astype(np.uint16)
