"""The tailor's form: the canonical body's surface, which patterns are drawn on and cut from.

Two sets of places belong to a sheet of cloth. `vertices` are where it is, on the canonical body (X-pose).
`at` is where the skin under it is when the legs hang straight down and the arms point sideways: patterns are
drawn there, as hems are level there. Metres, y up, facing +z; the pelvis is the origin.

Letters: V vertices, F faces.
"""

from dataclasses import dataclass, replace
from functools import cache

import igl
import numpy as np
from jaxtyping import Bool, Float64, Int64

from avatargen.body.load import load_body
from avatargen.body.model import CanonicalBody, canonical_body, pose_canonically
from avatargen.body.skinning import unskin
from avatargen.shipped import shipped

MIDDLE_Y = (-0.95, -0.6, -0.4, -0.2, 0.0, 0.1, 0.2, 0.38, 0.47, 0.62)  # m, heights and
MIDDLE_Z = (-0.035, -0.035, 0.0, 0.014, 0.008, 0.022, 0.033, 0.03, 0.012, 0.012)  # where side seams lie


@dataclass(frozen=True, kw_only=True, eq=False)
class Sheet:
    """A piece of cloth, open or closed. `part` numbers the pattern piece of each face."""

    vertices: Float64[np.ndarray, "V 3"]
    at: Float64[np.ndarray, "V 3"]
    faces: Int64[np.ndarray, "F 3"]
    part: Int64[np.ndarray, " F"]

    def kept(self, faces: Bool[np.ndarray, " F"]) -> "Sheet":
        """The sheet of some of its faces."""
        used, corners = np.unique(self.faces[faces], return_inverse=True)
        return Sheet(
            vertices=self.vertices[used],
            at=self.at[used],
            faces=corners.reshape(-1, 3).astype(np.int64),
            part=self.part[faces],
        )

    def finer(self) -> "Sheet":
        """Each face as four, smoothly (Loop 1987)."""
        faces = self.faces.astype(np.int64)
        vertices, fine = igl.loop(self.vertices, faces)
        at, _ = igl.loop(self.at, faces)
        return replace(
            self,
            vertices=np.asarray(vertices),
            at=np.asarray(at),
            faces=np.asarray(fine, dtype=np.int64),
            part=np.repeat(self.part, 4),
        )


@cache
def default_body() -> CanonicalBody:
    """The body that the garments fit."""
    return canonical_body(load_body(shipped("body.npz")))


@cache
def whole_form() -> Sheet:
    """All of the body's surface."""
    body = default_body()
    posed = pose_canonically(body.source)
    straight = unskin(body.vertices.astype(np.float64), body.weights.astype(np.float64), posed.T_posed_rest)
    return Sheet(
        vertices=body.vertices.astype(np.float64),
        at=np.asarray(straight, dtype=np.float64),
        faces=body.faces.astype(np.int64),
        part=np.zeros(len(body.faces), dtype=np.int64),
    )


def to_front(at: Float64[np.ndarray, "V 3"]) -> Float64[np.ndarray, " V"]:
    """Metres before the side seams, which run from the ankles to the shoulders' tops and along the arms."""
    return at[:, 2] - np.interp(at[:, 1], MIDDLE_Y, MIDDLE_Z)
