"""Hair drawn on the skin: the scalp where hair grows, up to a line of single strands, and beards.

HairPaint.painted(colours, feet) -> colours;  HairPaint.relief(points) -> m that a beard stands out

Letters: N points. sRGB 0..1, metres, canonical space.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float64

from avatargen.smoothstep import smoothstep
from avatargen.wardrobe.beards import HIGH, LOW, beard_cover, beard_relief
from avatargen.wardrobe.hairline import Hairline
from avatargen.wardrobe.strand_pattern import Flow

HEAD_LOW = 0.59  # m, under every hairline
RAGGED = 0.0032  # m that single strands begin before the line, or behind it
EDGE = (-0.0040, 0.0060)  # m within the line, from where skin is seen to where it is not

Rgb = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class HairPaint:
    """One person's: `density` is how much of the scalp hair hides (0 of the bald), `flow` how it is combed,
    `mirrored` whether the other way round; `beard` is one of BEARDS."""

    line: Hairline
    density: float
    flow: Flow
    mirrored: bool
    colour: Rgb
    beard: str
    beard_colour: Rgb

    def painted(
        self, colour: Float64[np.ndarray, "N 3"], foot: Float64[np.ndarray, "N 3"]
    ) -> Float64[np.ndarray, "N 3"]:
        """Colours of the skin at points of it, with its hair."""
        colour = colour.copy()
        if self.density > 0:
            near = np.flatnonzero(foot[:, 1] > HEAD_LOW)
            way = self.line.within(foot[near])
            near, way = near[way > 2 * EDGE[0]], way[way > 2 * EDGE[0]]
            at = foot[near] * (-1, 1, 1) if self.mirrored else foot[near]
            strand = self.flow.pattern(at)[:, 0]
            share = self.density * smoothstep(way + RAGGED * strand, *EDGE) * (0.9 + 0.25 * strand).clip(0, 1)
            root = np.array(self.colour) * (0.72 + 0.18 * strand)[:, None]
            colour[near] += (root - colour[near]) * share[:, None]
        if self.beard != "none":
            near = np.flatnonzero(((foot > LOW) & (foot < HIGH)).all(axis=1))
            share = beard_cover(self.beard, foot[near])
            colour[near] += (np.array(self.beard_colour) - colour[near]) * share[:, None]
        return colour

    def relief(self, points: Float[np.ndarray, "N 3"]) -> Float64[np.ndarray, " N"]:
        """Metres by which the skin stands out under a beard."""
        return beard_relief(self.beard, points)
