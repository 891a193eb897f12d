"""Hair as one person has it: a volume, of whatever origin, grown from the person's hairline and coloured
strand by strand.

    volume's distance --as long as this person's--> --no further than it may stand off the skin--> distance
    volume's shade x strands x colour --> sRGB

At the hairline hair lies flat on the skin and rises from there; what hangs before the face is taken away, and
skin where hair grows is covered everywhere.

Letters: N points, V vertices and F faces of the body. Metres, canonical space.
"""

from dataclasses import dataclass
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float, Float32, Float64

from avatargen.body.distance import BodyHit
from avatargen.body.model import CanonicalBody
from avatargen.compiled import compiled, inner
from avatargen.wardrobe.dressed import Cloth
from avatargen.wardrobe.hairline import AROUND, AXIS_Z, Hairline, way_within
from avatargen.wardrobe.strand_pattern import CENTRE, Flow

Rgb = tuple[float, float, float]

BEGINS = 0.004  # m within the hairline, from where hair has a thickness; up to there it is drawn on the skin
RISE = (0.45, 15.0)  # how hair rises from its line: flat at first, then ever steeper
FULL = 0.022  # m within it, from where skin is covered
LOWEST = 0.58  # m, under every hairline
DEEP = 0.012  # m under the skin that hair is kept to where it may not be
BESIDE = (0.068, 2.0)  # m from the middle of the face; beyond, loose hair hangs, this much more a metre
FORWARD = (0.100, 0.110, 0.73, 0.80)  # m that it hangs forward beside the face, more between these heights
OPEN = (0.70, 0.80, 0.03)  # m: between these heights the face's opening becomes this much wider
BEHIND = (0.080, 2.5)  # m round the head, and the same: hair before the ears and behind them
DEEPER = 0.025  # m more than its half width that a bulk has upward, forward and back
NECK = 0.61  # m: below this height loose hair hangs freely
NAPE = 0.165  # m round the head, from where tied hair hangs
ENDS = 0.014  # m that strands end higher or lower
COLOURED = 0.02  # m from hair beyond which it has no colour
KNOWN = 0.006  # m from a volume's surface, about as far as its shades are known
FREE, GROWN = 1.0, 0.0  # as ways to an edge: of hair that hangs, and where it grows
CROPPED, HANGING, TAILED = 0, 1, 2


@dataclass(frozen=True, kw_only=True)
class Cut:
    """How a style is worn. `kind` is CROPPED, which ends at the hairline, HANGING or TAILED, which is tied
    behind. `rise` is how steeply it rises from the hairline, `least` m its thickness, `ridges` m of locks.
    """

    kind: int
    flow: Flow
    rise: float = 1.0
    least: float = 0.003
    ridges: float = 0.0008
    bulk: float = 1.0  # m, half the width that it has at most
    ends: tuple[float, float] | None = None  # m, the lowest and the highest that it can be cut off


@dataclass(frozen=True, kw_only=True)
class Hairdo:
    """One person's: a cut, which way round, how long, from which hairline and in which colour."""

    cut: Cut
    mirrored: bool
    end: float  # m, the height that it hangs down to at most
    line: Hairline
    colour: Rgb

    def places(self, points: Float32[np.ndarray, "N 3"]) -> Float32[np.ndarray, "N 3"]:
        """Where points are in the style as it is stored."""
        return points * np.array((-1, 1, 1), np.float32) if self.mirrored else points

    def coloured(
        self,
        shade: Float[np.ndarray, " N"],
        pattern: Float64[np.ndarray, "N 3"],
        above: Float[np.ndarray, " N"],
    ) -> Float32[np.ndarray, "N 3"]:
        """sRGB from a volume's shades (1 on average), strands, and metres over the skin."""
        strand, lock, gloss = pattern.T
        light = 1 + 0.4 * (shade.clip(0.6, 1.6) - 1)
        light = light * (1 + 0.26 * strand + 0.12 * lock) * (0.72 + 0.28 * (above / 0.008).clip(0, 1))
        shine = gloss * (0.55 + 0.45 * strand).clip(0, 1)
        own = np.array(self.colour)
        colour = own * light.clip(0.3, 1.8)[:, None] + (0.5 * own + 0.05) * (0.7 * shine)[:, None]
        return colour.clip(0, 1).astype(np.float32)


@runtime_checkable
class HairVolume(Protocol):
    """What hair is before it is somebody's."""

    def least(self, points: Float32[np.ndarray, "N 3"]) -> Float32[np.ndarray, " N"]:
        """Metres that it is away from each point at least."""
        ...

    def distance(self, points: Float32[np.ndarray, "N 3"]) -> Float32[np.ndarray, " N"]:
        """Signed distance, m."""
        ...

    def shade(self, points: Float32[np.ndarray, "N 3"]) -> Float32[np.ndarray, " N"]:
        """How bright it is there, 1 on average."""
        ...


@dataclass(frozen=True, kw_only=True, eq=False)
class WornHair:
    """A volume of hair on a body that it fits, as a layer."""

    volume: HairVolume
    hairdo: Hairdo
    body: CanonicalBody

    @property
    def kind(self) -> str:
        return "hair"

    @property
    def hidden(self) -> Bool[np.ndarray, " V"]:
        return np.zeros(len(self.body.vertices), dtype=bool)

    @property
    def opening(self) -> None:
        return None

    def least(self, points: Float32[np.ndarray, "N 3"]) -> Float32[np.ndarray, " N"]:
        return (self.volume.least(self.hairdo.places(points)) - self.hairdo.cut.least).clip(0)

    def cloth(self, points: Float32[np.ndarray, "N 3"], hit: BodyHit, *, coloured: bool) -> Cloth:
        hairdo, cut = self.hairdo, self.hairdo.cut
        stored = hairdo.places(points)
        whole = self.volume.distance(stored).astype(np.float32)
        shown = np.flatnonzero(whole < COLOURED if coloured else np.abs(whole) < ENDS)
        pattern = np.zeros((len(points), 3))
        pattern[shown] = cut.flow.pattern(stored[shown])
        distance = whole.copy()
        rim = np.empty(len(points), np.float32)
        skin = Skin(self.body.vertices, self.body.faces, hit.face, hit.barycentric, hit.distance)
        rule = Rule(cut.kind, cut.rise, cut.least, cut.ridges, cut.bulk, hairdo.end)
        fit_hair(points, skin, hairdo.line.corners, pattern, rule, distance, rim)
        colour = np.full((len(points), 3), 0.5, np.float32)
        near = np.flatnonzero(distance < COLOURED) if coloured else np.zeros(0, np.int64)
        if len(near):
            known = np.exp(-((whole[near] / KNOWN) ** 2))  # a cut surface is none that anybody painted
            shade = 1 + known * (self.volume.shade(stored[near]) - 1)
            colour[near] = hairdo.coloured(shade, pattern[near], hit.distance[near])
        return Cloth(distance=distance, rim=rim, color=colour)


class Skin(NamedTuple):
    """The body [V 3] [F 3], and the place on it nearest to each point: a face, weights [N 3], m over it."""

    vertices: np.ndarray
    faces: np.ndarray
    face: np.ndarray
    weights: np.ndarray
    above: np.ndarray


class Rule(NamedTuple):
    """Numbers of a hairdo."""

    kind: int
    rise: float
    least: float
    ridges: float
    bulk: float
    end: float


@inner
def ramp(x, low, high):
    """From 0 at low to 1 at high, smoothly."""
    t = min(max((x - low) / (high - low), 0.0), 1.0)
    return t * t * (3 - 2 * t)


@inner
def beyond_bulk(x, y, z, bulk):
    """Metres, about, beyond an egg around the head, upright below its middle, of half a width `bulk`."""
    more = bulk + DEEPER
    up, fore = max(y - CENTRE[1], 0.0) / more, (z - CENTRE[2]) / more
    return (np.sqrt((x / bulk) ** 2 + up * up + fore * fore) - 1) * bulk


@inner
def loose_room(kind, side, x, y, z):
    """Metres of room over a place on the skin that loose hair has besides what grows there, `side` metres
    from the middle of the face."""
    if y < NECK:
        return 1.0
    behind = AROUND * abs(np.arctan2(x, z - AXIS_Z))
    if kind == TAILED:
        return BEHIND[1] * max(behind - NAPE, 0.0)
    half = BESIDE[0] + OPEN[2] * ramp(y, OPEN[0], OPEN[1])
    return BESIDE[1] * max(side - half, 0.0) + BEHIND[1] * max(behind - BEHIND[0], 0.0)


@compiled
def fit_hair(points, skin, line, pattern, rule, distance, rim):
    """Change a volume's distances [N] at points [N 3] to those of one person's hair, and fill in `rim` [N].

    `line` [K 2] is the hairline, `pattern` [N 3] of the strands.
    """
    vertices, faces, face, weights, above = skin
    kind, rise, least, ridges, bulk, end = rule
    for n in range(len(points)):
        foot_x, foot_y, foot_z = 0.0, 0.0, 0.0
        for k in range(3):
            corner = faces[face[n], k]
            foot_x += weights[n, k] * vertices[corner, 0]
            foot_y += weights[n, k] * vertices[corner, 1]
            foot_z += weights[n, k] * vertices[corner, 2]
        way = way_within(foot_x, foot_y, foot_z, line) if foot_y > LOWEST else -1.0
        grown = ramp(way, BEGINS, FULL)
        found = distance[n] - ridges * pattern[n, 1] * grown
        found = max(found, end + 0.5 * ENDS * pattern[n, 0] - points[n, 1])
        if way > 0:
            found = min(found, above[n] - least * grown)
        far = way - BEGINS
        room = max(rise * far * (RISE[0] + RISE[1] * max(far, 0.0)), -DEEP)
        if kind == HANGING:
            front = FORWARD[0] + FORWARD[1] * ramp(points[n, 1], FORWARD[2], FORWARD[3])
            found = max(found, 0.8 * (points[n, 2] - front))
        if kind != CROPPED:
            room += loose_room(kind, abs(points[n, 0]), foot_x, foot_y, foot_z)
        found = max(found, beyond_bulk(points[n, 0], points[n, 1], points[n, 2], bulk))
        distance[n] = max(found, above[n] - room)
        rim[n] = FREE + (GROWN - FREE) * ramp(way, -0.002, 0.004)
