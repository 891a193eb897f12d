"""468 landmarks of a face, by the face network: a first look where the pose's landmarks have the face, a
second one where the first has found it (arXiv 1907.06724).

Letters: M = 468 landmarks, K those of the pose.
"""

from math import atan2

import numpy as np
from jaxtyping import Float64, UInt8

from avatargen.photo.seeing.crop import Square, around, cut
from avatargen.photo.seeing.network import Network
from avatargen.photo.seeing.pose import NAMES, sigmoid

SIDE, COUNT = 192, 468
WIDER = 1.5
LEAST_SCORE = 0.6
LEFT_EYE, RIGHT_EYE = 263, 33  # outer corners; the person's left is right in the picture
FACE_WIDTH = 4.2  # of the square, for the way from between the eyes to between the mouth's corners


def find_face(
    network: Network, pixels: UInt8[np.ndarray, "H W 3"], landmarks: Float64[np.ndarray, "K 2"]
) -> Float64[np.ndarray, "M 2"] | None:
    """Pixels of the face's landmarks; None where no face is seen."""
    square = first_square(landmarks)
    found, score = None, 0.0
    for _ in range(2):
        found, score = look(network, pixels, square)
        x, y = found[LEFT_EYE] - found[RIGHT_EYE]
        square = around(found, atan2(y, x), WIDER)
    return found if score >= LEAST_SCORE else None


def first_square(landmarks: Float64[np.ndarray, "K 2"]) -> Square:
    """Where a face is by the pose's landmarks."""
    place = {name: landmarks[NAMES.index(name)] for name in NAMES[:11]}
    left, right = place["left_eye_outer"], place["right_eye_outer"]
    mouth = (place["mouth_left"] + place["mouth_right"]) / 2
    eyes = (place["left_eye_middle"] + place["right_eye_middle"]) / 2
    x, y = left - right
    middle = (eyes + mouth) / 2
    side = max(FACE_WIDTH * float(np.linalg.norm(mouth - eyes)), 2.2 * float(np.hypot(x, y)), 8.0)
    return Square(x=float(middle[0]), y=float(middle[1]), side=side, angle=atan2(y, x))


def look(
    network: Network, pixels: UInt8[np.ndarray, "H W 3"], square: Square
) -> tuple[Float64[np.ndarray, "M 2"], float]:
    """One look: landmarks in the picture, and how likely a face is there, 0..1."""
    outputs = {each.size: each for each in network(cut(pixels, square, SIDE))}
    rows = outputs[COUNT * 3].reshape(COUNT, 3).astype(np.float64)
    return square.to_picture(rows[:, :2] / SIDE), float(sigmoid(outputs[1]).reshape(()))
