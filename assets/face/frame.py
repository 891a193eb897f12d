"""Where an open face is at rest: how its head is turned and scaled, and what is inside of it.

Letters: W vertices of the skin, K welded ones of skin and mouth, V welded ones. Metres.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from assets.asset.asset import Asset
from assets.face.mouth import go_along
from assets.face.opened import OpenFace


@dataclass(frozen=True, kw_only=True)
class Frame:
    """How a head is turned and scaled at rest, against the canonical one."""

    turn: Float64[np.ndarray, "3 3"]
    size: float

    def own(self, rest: Float64[np.ndarray, "N 3"]) -> Float64[np.ndarray, "N 3"]:
        """Places at rest as large and upright as the canonical head's."""
        return rest @ self.turn / self.size

    def rest(self, own: Float64[np.ndarray, "N 3"]) -> Float64[np.ndarray, "N 3"]:
        """The way back, of places and of displacements."""
        return own @ self.turn.T * self.size


def head_frame(asset: Asset, face: OpenFace, rest: Float64[np.ndarray, "K 3"]) -> Frame:
    """Of an asset whose skin and mouth are there at rest."""
    skeleton, head = asset.skeleton, asset.skeleton.joint_names.index("head")
    turn = np.eye(3) if skeleton.rest_rotations is None else skeleton.rest_rotations[head]
    return Frame(turn=turn, size=face_size(face, rest))


def face_size(face: OpenFace, rest: Float64[np.ndarray, "V 3"]) -> float:
    """How large the face is at rest, by its size in canonical space."""
    near = np.flatnonzero(face.curves.distance(face.mesh.points) < 0.02)
    spread = [np.linalg.norm(at[near] - at[near].mean(axis=0)) for at in (rest, face.mesh.points)]
    return float(spread[0] / max(spread[1], 1e-9))


def at_rest(face: OpenFace, skin: Float64[np.ndarray, "W 3"]) -> Float64[np.ndarray, "K 3"]:
    """Welded places at rest of the skin's vertices, and of the mouth's, which go with it."""
    welded = np.zeros((face.inside.first, 3))
    welded[face.mesh.welded] = skin
    return np.concatenate([welded, go_along(face.inside.places, face.mesh.points, welded)])
