"""Hair as one person has it: a volume, of whatever origin, grown from the person's hairline and coloured strand
by strand.

    volume's distance --as long as this person's--> --no further than it may stand off the skin--> distance
    volume's shade x strands x colour --> sRGB

At the hairline hair lies flat on the skin and rises from there; what hangs before the face is taken away, and
skin where hair grows is covered everywhere.

Letters: N points, V vertices and F faces of the body. Metres, canonical space.
"""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float, Float32, Float64

from avatargen.body.distance import BodyHit
from avatargen.body.model import CanonicalBody
from avatargen.compiled import compiled, inner
from avatargen.wardrobe.dressed import Cloth
from avatargen.wardrobe.hairline import AROUND, AXIS_Z, Hairline, way_within
from avatargen.wardrobe.strand_pattern import Flow

Rgb = tuple[float, float, float]

BEGINS = 0.004  # m within the hairline, from where hair has a thickness; up to there it is drawn on the skin
FULL = 0.022  # m within it, from where skin is covered
DEEP = 0.012  # m under the skin that hair is kept to where it may not be
BESIDE = (0.050, 2.5)  # m from the middle of the face; beyond, loose hair hangs, this much more a metre
BEHIND = (0.100, 4.0)  # m round the head, and the same: hair before the ears and behind them
NAPE = 0.165  # m round the head, from where tied hair hangs
ENDS = 0.014  # m that strands end higher or lower
COLOURED = 0.02  # m from hair beyond which it has no colour
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
        light = 1 + 0.55 * (shade.clip(0.4, 1.8) - 1)
        light = light * (1 + 0.26 * strand + 0.12 * lock) * (0.72 + 0.28 * (above / 0.008).clip(0, 1))
        shine = gloss * (0.55 + 0.45 * strand).clip(0, 1)
        own = np.array(self.colour)
        colour = own * light.clip(0.3, 1.8)[:, None] + (0.45 * own + 0.035) * (0.6 * shine)[:, None]
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
        pattern = cut.flow.pattern(stored)
        distance = self.volume.distance(stored).astype(np.float32)
        rim = np.empty(len(points), np.float32)
        vertices, faces = self.body.vertices, self.body.faces
        settings = (cut.kind, cut.rise, cut.least, cut.ridges, hairdo.end)
        skin = (vertices, faces, hit.face, hit.barycentric, hit.distance)
        fit_hair(points, *skin, hairdo.line.corners, pattern, *settings, distance, rim)
        colour = np.full((len(points), 3), 0.5, np.float32)
        near = np.flatnonzero(distance < COLOURED) if coloured else np.zeros(0, np.int64)
        if len(near):
            shade = self.volume.shade(stored[near])
            colour[near] = hairdo.coloured(shade, pattern[near], hit.distance[near])
        return Cloth(distance=distance, rim=rim, color=colour)


@inner
def ramp(x, low, high):
    """From 0 at low to 1 at high, smoothly."""
    t = min(max((x - low) / (high - low), 0.0), 1.0)
    return t * t * (3 - 2 * t)


@compiled
def fit_hair(
    points, vertices, faces, face, weights, above, line, pattern, kind, rise, least, ridges, end, distance, rim
):
    """Change a volume's distances [N] at points [N 3] to those of one person's hair, and fill in `rim` [N].

    The skin nearest to each point is a face of the body and weights [N 3], `above` [N] metres below it.
    """
    for n in range(len(points)):
        foot_x, foot_y, foot_z = 0.0, 0.0, 0.0
        for k in range(3):
            corner = faces[face[n], k]
            foot_x += weights[n, k] * vertices[corner, 0]
            foot_y += weights[n, k] * vertices[corner, 1]
            foot_z += weights[n, k] * vertices[corner, 2]
        way = way_within(foot_x, foot_y, foot_z, line)
        round_ = AROUND * abs(np.arctan2(foot_x, foot_z - AXIS_Z))
        room = max(rise * (way - BEGINS), -DEEP)
        if kind == HANGING:
            room += BESIDE[1] * max(abs(points[n, 0]) - BESIDE[0], 0.0)
            room += BEHIND[1] * max(round_ - BEHIND[0], 0.0)
            if foot_y < 0.60:
                room += 1.0
        elif kind == TAILED:
            room += BEHIND[1] * max(round_ - NAPE, 0.0)
            if foot_y < 0.62:
                room += 1.0
        grown = ramp(way, BEGINS, FULL)
        found = distance[n] - ridges * pattern[n, 1] * grown
        found = max(found, end + ENDS * pattern[n, 0] * 0.5 - points[n, 1])
        found = min(found, above[n] - least * grown if way > 0 else 1.0)
        distance[n] = max(found, above[n] - room)
        rim[n] = FREE + (GROWN - FREE) * ramp(way, -0.002, 0.004)
