"""The inside of a mouth, sewn to the rims of the lips: a bag, teeth and a tongue, hidden while they meet.

Letters: V welded vertices, I vertices of the mouth's own, R of the bag's rim, T faces. Metres.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from assets.face.cut import CutMesh
from avatargen.body.face import FaceUnits

BEHIND = 0.0025  # m that the bag's rim stays behind the lips'
NARROWER = np.array([0.86, 1.0, 0.985])  # of teeth and tongue, so that cheeks never meet them
AROUND = 0.045  # m from the middle of the mouth: the skin that the mouth's inside goes with


@dataclass(frozen=True, kw_only=True)
class Inside:
    """The mouth's own vertices, after the skin's, where they are canonically, and the faces among them and
    the rims of the lips. `source` is each one's number among the units' vertices."""

    places: Float64[np.ndarray, "I 3"]
    faces: Int64[np.ndarray, "T 3"]  # welded numbers: below `first` the skin's
    source: Int64[np.ndarray, " I"]
    first: int


def mouth_inside(
    mesh: CutMesh,
    upper: Int64[np.ndarray, " N"],
    lower: Int64[np.ndarray, " N"],
    units: FaceUnits,
    body: Float64[np.ndarray, "B 3"],
) -> Inside:
    """The inside of the mouth behind the rims of the lips, welded vertices from the right to the left."""
    first, points = int(mesh.welded.max()) + 1, mesh.points
    chains = (units.upper_lip, units.lower_lip)
    rim = np.unique(np.concatenate(chains))
    own = len(body) + np.arange(len(units.inner))
    source = np.concatenate([rim, own])
    places = np.concatenate([body[rim], units.inner])
    places[len(rim) :][units.kinds > 0] *= NARROWER
    edge = points[upper]
    in_front = places[: len(rim), 2] + BEHIND - np.interp(body[rim, 0], edge[:, 0], edge[:, 2])
    places[:, 2] -= max(0.0, float(in_front.max()))
    number = np.full(len(body) + len(units.inner), -1)
    number[source] = first + np.arange(len(source))
    where = np.concatenate([points, places])
    strips = [
        zipped(upper[::-1], number[chains[0]][::-1], where[:, 0], down=True),
        zipped(lower, number[chains[1]], where[:, 0], down=False),
    ]
    faces = np.concatenate([*strips, number[units.inner_faces]])
    return Inside(places=places, faces=faces, source=source, first=first)


def zipped(
    near: Int64[np.ndarray, " N"],
    far: Int64[np.ndarray, " R"],
    x: Float64[np.ndarray, " V"],
    *,
    down: bool,
) -> Int64[np.ndarray, "T 3"]:
    """Faces between two chains that run the same way, x falling or rising: each has `near` in its
    direction."""
    sign = -1 if down else 1
    faces, i, j = [], 0, 0
    while i < len(near) - 1 or j < len(far) - 1:
        step_near = sign * x[near[i + 1]] if i < len(near) - 1 else np.inf
        step_far = sign * x[far[j + 1]] if j < len(far) - 1 else np.inf
        if step_near <= step_far:
            faces.append((near[i], near[i + 1], far[j]))
            i += 1
        else:
            faces.append((near[i], far[j + 1], far[j]))
            j += 1
    return np.array(faces)


def go_along(
    places: Float64[np.ndarray, "I 3"],
    skin: Float64[np.ndarray, "K 3"],
    moved: Float64[np.ndarray, "K 3"],
) -> Float64[np.ndarray, "I 3"]:
    """Where places go with the skin around them, as one affine motion: the best for the skin within a hand's
    breadth of their middle."""
    middle = np.median(places, axis=0)
    near = np.linalg.norm(skin - middle, axis=1) < AROUND
    known = np.concatenate([skin[near] - middle, np.ones((near.sum(), 1))], axis=1)
    motion = np.linalg.lstsq(known, moved[near], rcond=None)[0]
    return np.concatenate([places - middle, np.ones((len(places), 1))], axis=1) @ motion
