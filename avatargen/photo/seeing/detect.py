"""People in a picture, by the pose detector: where each one's hips are, how large they are and how they lean.

The detector is a single-shot one: over a square picture it says, for each of 2254 anchors, how likely a
person is there, and where the person's box and four points lie from it.
(BlazePose, arXiv 2006.10204, section 3.1; anchors as in SSD, arXiv 1512.02325, all of one size.)

Letters: A anchors, N people.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float64, UInt8

from avatargen.photo.seeing.crop import Square, cut, upright
from avatargen.photo.seeing.network import Network

SIDE = 224  # pixels of the detector's picture
GRIDS = ((8, 2), (16, 2), (32, 6))  # pixels a cell, and anchors in it
LEAST_SCORE = 0.5
SAME = 0.3  # overlap of boxes, over their union, from which they are of one person
WIDER = 1.25  # than the person, of the square that is looked at


@dataclass(frozen=True, kw_only=True)
class Found:
    """Somebody in the picture: the square around the whole person, upright, and how sure that is, 0..1."""

    square: Square
    box: Float64[np.ndarray, "2 2"]  # low and high corner of the upper body, pixels
    score: float


def anchors() -> Float64[np.ndarray, "A 2"]:
    """Middles of all anchors, 0..1, row after row of each grid."""
    found = []
    for pixels, each in GRIDS:
        along = (np.arange(SIDE // pixels) + 0.5) / (SIDE // pixels)
        y, x = np.meshgrid(along, along, indexing="ij")
        found.append(np.repeat(np.stack([x, y], axis=2).reshape(-1, 2), each, axis=0))
    return np.concatenate(found)


def decode(
    raw: Float[np.ndarray, "A 12"], logits: Float[np.ndarray, " A"]
) -> tuple[Float64[np.ndarray, "N 12"], Float64[np.ndarray, " N"]]:
    """Boxes (middle, size) and four points of those anchors that are sure enough, 0..1, and their scores, the
    surest first; of those that overlap the surest stays."""
    scores = 1 / (1 + np.exp(-np.clip(logits.astype(np.float64), -100, 100)))
    sure = np.flatnonzero(scores >= LEAST_SCORE)
    sure = sure[np.argsort(-scores[sure], kind="stable")]
    values = raw[sure].astype(np.float64) / SIDE
    values[:, :2] += anchors()[sure]
    for point in range(4, 12, 2):
        values[:, point : point + 2] += anchors()[sure]
    kept: list[int] = []
    for number in range(len(values)):
        if all(overlap(values[number], values[other]) < SAME for other in kept):
            kept.append(number)
    return values[kept], scores[sure[kept]]


def overlap(one: Float64[np.ndarray, "12"], other: Float64[np.ndarray, "12"]) -> float:
    """Intersection of two boxes over their union."""
    low = np.maximum(one[:2] - one[2:4] / 2, other[:2] - other[2:4] / 2)
    high = np.minimum(one[:2] + one[2:4] / 2, other[:2] + other[2:4] / 2)
    both = float(np.prod(np.maximum(high - low, 0)))
    return both / max(float(np.prod(one[2:4]) + np.prod(other[2:4])) - both, 1e-12)


def find_people(network: Network, pixels: UInt8[np.ndarray, "H W 3"]) -> list[Found]:
    """Everybody in the picture, the largest first."""
    height, width = pixels.shape[:2]
    whole = Square(x=width / 2, y=height / 2, side=float(max(width, height)))
    raw, logits = sorted(network(2 * cut(pixels, whole, SIDE) - 1), key=lambda each: -each.size)
    values, scores = decode(raw.reshape(-1, 12), logits.reshape(-1))
    people = []
    for row, score in zip(values, scores, strict=True):
        hips, reach = whole.to_picture(row[4:8].reshape(2, 2))
        corners = np.stack([row[:2] - row[2:4] / 2, row[:2] + row[2:4] / 2])
        people.append(
            Found(square=upright(hips, reach, WIDER), box=whole.to_picture(corners), score=float(score))
        )
    return sorted(people, key=lambda found: -found.square.side)
