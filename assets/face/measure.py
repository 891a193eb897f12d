"""How a face bears its shapes: edges that are pulled, faces that fold, gaps of lids and lips.

Letters: V welded vertices, F faces, E edges. Metres.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from assets.face.curves import nearest_segment
from assets.face.motions import Motions
from assets.mesh.surface import Surface, directed_edges, face_normals

SHORTEST = 1e-3  # m: an edge that is shorter at rest counts as that long, as nobody sees it pulled
MOVED = 1e-4  # m that a shape moves one end of an edge that counts
SMALLEST = 1e-9  # m2 of a face that counts: a speck of .03 mm
TURNED = -0.2  # cosine to what it was at rest of a face that is folded over


@dataclass(frozen=True, kw_only=True)
class Stretch:
    """How many times as long edges become."""

    p99: float
    most: float


def edges_of(faces: Int64[np.ndarray, "F 3"]) -> Int64[np.ndarray, "E 2"]:
    """Every edge once."""
    return np.unique(np.sort(directed_edges(faces), axis=1), axis=0)


def stretch(
    rest: Float64[np.ndarray, "V 3"], at: Float64[np.ndarray, "V 3"], edges: Int64[np.ndarray, "E 2"]
) -> Stretch:
    """Of the edges that a shape moves, over their lengths at rest."""
    moved = (np.abs(at - rest).max(axis=1) > MOVED)[edges].any(axis=1)
    if not moved.any():
        return Stretch(p99=1.0, most=1.0)
    ends = edges[moved].T
    lengths = [np.linalg.norm(p[ends[0]] - p[ends[1]], axis=1) for p in (rest, at)]
    found = lengths[1] / np.maximum(lengths[0], SHORTEST)
    return Stretch(p99=float(np.percentile(found, 99)), most=float(found.max()))


def folded(
    rest: Float64[np.ndarray, "V 3"], at: Float64[np.ndarray, "V 3"], faces: Int64[np.ndarray, "F 3"]
) -> Float64[np.ndarray, " K"]:
    """Areas, mm2, of the faces that a shape has turned over."""
    before, after = (face_normals(Surface(vertices=p, faces=faces)) for p in (rest, at))
    areas = [np.linalg.norm(normal, axis=1) / 2 for normal in (before, after)]
    over = ((before * after).sum(axis=1) < TURNED) & (areas[0] > SMALLEST) & (areas[1] > SMALLEST)
    return 1e6 * areas[1][over]


def lids_apart(motions: Motions, at: Float64[np.ndarray, "V 3"], eye: int) -> float:
    """The widest gap between the margins of an eye's lids, millimetres."""
    upper, lower = motions.margins(eye)
    ways = (
        (upper, np.concatenate([upper[:1], lower, upper[-1:]])),
        (lower, np.concatenate([lower[:1], upper, lower[-1:]])),
    )
    return 1e3 * max(float(to_line(at[rim], at[line]).max()) for rim, line in ways)


def lips_apart(motions: Motions, at: Float64[np.ndarray, "V 3"]) -> float:
    """The widest gap between the rims of the lips, millimetres."""
    gap = at[motions.face.upper] - at[motions.face.lower]
    return 1e3 * float(np.linalg.norm(gap, axis=1).max())


def lips_crossed(motions: Motions, at: Float64[np.ndarray, "V 3"]) -> float:
    """How far the rim of the lower lip lies above the upper one's, millimetres."""
    return 1e3 * max(float((at[motions.face.lower] - at[motions.face.upper])[:, 1].max()), 0.0)


def eyes_through(motions: Motions, at: Float64[np.ndarray, "V 3"]) -> float:
    """How deep skin that a shape has moved lies within an eyeball, deeper than at rest, millimetres; `at` is
    as large and upright as the canonical head."""
    deepest = 0.0
    for eye, ball in enumerate(motions.eyes.balls):
        near = np.flatnonzero(motions.face.curves.outside(motions.at[: motions.skin], eye) < 0.012)
        off = [p[near] - ball.centre for p in (motions.own, at)]
        depth = [ball.radius - np.linalg.norm(o, axis=1) for o in off]
        deepest = max(deepest, float((depth[1] - np.maximum(depth[0], 0)).max()))
    return 1e3 * deepest


def to_line(
    points: Float64[np.ndarray, "N 3"], line: Float64[np.ndarray, "K 3"]
) -> Float64[np.ndarray, " N"]:
    """Distance to a line of segments."""
    return nearest_segment(points, line[:-1], line[1:])[2]
