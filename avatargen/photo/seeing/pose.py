"""Landmarks of one person and where the person is seen, by the landmark network.

The network sees a square of the picture in which the person stands upright. A second look at the square that
the first look's landmarks ask for is more exact (BlazePose, arXiv 2006.10204, section 3.2).

Letters: K = 33 landmarks; L = 39 with those that are no part of the body.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Float64, UInt8

from avatargen.photo.seeing.crop import Square, cut, spread_back, upright
from avatargen.photo.seeing.network import Network

SIDE, LANDMARKS, ALL = 256, 33, 39
WIDER = 1.25
LOOKS = 2
NAMES = (
    "nose",
    *(f"{side}_eye_{part}" for side in ("left", "right") for part in ("inner", "middle", "outer")),
    "left_ear",
    "right_ear",
    "mouth_left",
    "mouth_right",
    *(
        f"{side}_{part}"
        for part in (
            *("shoulder", "elbow", "wrist", "pinky", "index", "thumb"),
            *("hip", "knee", "ankle", "heel", "foot"),
        )
        for side in ("left", "right")
    ),
)


@dataclass(frozen=True, kw_only=True)
class Landmarks:
    """What the network says of one person. `metres` are x right, y down and z away, from between the hips."""

    pixels: Float64[np.ndarray, "K 2"]
    metres: Float64[np.ndarray, "K 3"]
    visibility: Float64[np.ndarray, " K"]
    score: float
    square: Square
    heat: Float32[np.ndarray, "S S"]  # how likely each place of the square is the person

    def cover(self, width: int, height: int) -> Float32[np.ndarray, "H W"]:
        """How likely each pixel of the picture is the person."""
        return spread_back(self.heat, self.square, width, height)


def sigmoid(logits: np.ndarray) -> np.ndarray:
    return 1 / (1 + np.exp(-np.clip(logits.astype(np.float64), -60, 60)))


def find_landmarks(network: Network, pixels: UInt8[np.ndarray, "H W 3"], square: Square) -> Landmarks:
    """Look at the person in the square, and again at the square that this look asks for."""
    found, aim = look(network, pixels, square)
    for _ in range(LOOKS - 1):
        if found.score < 0.3:
            break
        found, aim = look(network, pixels, aim)
    return found


def look(network: Network, pixels: UInt8[np.ndarray, "H W 3"], square: Square) -> tuple[Landmarks, Square]:
    """One look: the landmarks, and the square to look at next."""
    outputs = {each.size: each for each in network(cut(pixels, square, SIDE))}
    rows = outputs[ALL * 5].reshape(ALL, 5).astype(np.float64)
    metres = outputs[ALL * 3].reshape(ALL, 3)[:LANDMARKS].astype(np.float64)
    metres[:, :2] = metres[:, :2] @ square.axes.T
    places = square.to_picture(rows[:, :2] / SIDE)
    found = Landmarks(
        pixels=places[:LANDMARKS],
        metres=metres,
        visibility=np.minimum(sigmoid(rows[:LANDMARKS, 3]), sigmoid(rows[:LANDMARKS, 4])),
        score=float(outputs[1].reshape(())),
        square=square,
        heat=sigmoid(outputs[SIDE * SIDE].reshape(SIDE, SIDE)).astype(np.float32),
    )
    return found, upright(places[LANDMARKS], places[LANDMARKS + 1], WIDER)
