"""What moves the default body's face: expression units as displacements of its canonical vertices, where lips
and lids meet, and the inside of a mouth. Made by `avatargen.wardrobe.makehuman.derive_expressions`.

Letters: U units, V vertices of the body, I vertices of the mouth's own, numbered after the body's. Metres,
canonical space.
"""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from jaxtyping import Float64, Int64

from avatargen.body.arrays import read_npz
from avatargen.errors import InputError
from avatargen.shipped import shipped

ARRAYS = ("names", "starts", "rows", "moves", "inner", "kinds", "inner_faces", "balls")
CURVES = ("upper_lip", "lower_lip", "lids", "eyes")


@dataclass(frozen=True, kw_only=True)
class FaceUnits:
    """The units and the curves at which a face opens."""

    names: tuple[str, ...]
    starts: Int64[np.ndarray, " U1"]  # of each unit's rows, and where the last one ends
    rows: Int64[np.ndarray, " R"]  # vertices that a unit moves
    moves: Float64[np.ndarray, "R 3"]
    inner: Float64[np.ndarray, "I 3"]
    kinds: Int64[np.ndarray, " I"]  # 0 the bag of the mouth, 1 upper teeth, 2 lower teeth, 3 the tongue
    inner_faces: Int64[np.ndarray, "T 3"]  # the bag's rim is the lips'
    upper_lip: Int64[np.ndarray, " A"]  # body vertices from the right corner, -x, to the left one
    lower_lip: Int64[np.ndarray, " B"]
    lids: Int64[np.ndarray, "2 C"]  # body vertices around the left and the right eye
    eyes: Int64[np.ndarray, " E"]  # body vertices on the eyeballs
    balls: Float64[np.ndarray, "2 4"]  # centre and radius of the left and the right eyeball

    @property
    def body_vertices(self) -> int:
        """How many vertices the body has that the units belong to, at least."""
        return int(self.eyes.max()) + 1

    @cached_property
    def number(self) -> dict[str, int]:
        return {name: index for index, name in enumerate(self.names)}

    def unit(self, name: str, count: int) -> Float64[np.ndarray, "N 3"]:
        """How far one unit moves each of `count` vertices: the body's, then the mouth's own."""
        index, moved = self.number[name], np.zeros((count, 3))
        rows = slice(int(self.starts[index]), int(self.starts[index + 1]))
        moved[self.rows[rows]] = self.moves[rows]
        return moved


def load_face(path: Path | None = None) -> FaceUnits:
    """Read the file that comes with the package.

    Raises:
        InputError: the file is missing or damaged.
    """
    path = path or shipped("face.npz")
    found = read_npz(path, (*ARRAYS, *CURVES), "face")
    if missing := [name for name in (*ARRAYS, *CURVES) if name not in found]:
        raise InputError(f"face: {path} lacks {', '.join(missing)}; install the package again")
    whole = {n: found[n].astype(np.int64) for n in ("starts", "rows", "kinds", "inner_faces", *CURVES)}
    return FaceUnits(
        names=tuple(str(name) for name in found["names"]),
        moves=found["moves"].astype(np.float64),
        inner=found["inner"].astype(np.float64),
        balls=found["balls"].astype(np.float64),
        **whole,
    )
