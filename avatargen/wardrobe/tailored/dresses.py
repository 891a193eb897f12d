"""Dresses: the upper part of a top, and a skirt that hangs from its waist."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64

from avatargen.wardrobe.makehuman.solid import boundary_loops
from avatargen.wardrobe.tailored.form import Sheet
from avatargen.wardrobe.tailored.hanging import ROW, Fall, carried, ring_at, skirt, zipped
from avatargen.wardrobe.tailored.painting import Texels, line, shaded
from avatargen.wardrobe.tailored.tops import Top, top_paint, top_sheet


@dataclass(frozen=True, kw_only=True)
class Dress:
    """A top, which ends at the waist, and how the skirt hangs from there."""

    top: Top
    fall: Fall


def dress_sheet(dress: Dress) -> Sheet:
    """A dress's cloth."""
    upper = top_sheet(dress.top, ends_below=False)
    edge = min(boundary_loops(upper.faces), key=lambda loop: float(upper.at[loop, 1].mean()))
    fall = replace(dress.fall, top=dress.top.hem - 0.5 * ROW)
    lower = carried(skirt(fall, ring_at(upper.vertices[edge])))
    return zipped(upper, edge, lower)


def dress_paint(dress: Dress, found: Texels) -> Float64[np.ndarray, "N 3"]:
    """A top's, with a seam around the waist and a hem."""
    color = top_paint(dress.top, found)
    y = found.at[:, 1]
    color = shaded(color, line(y - dress.top.hem, 0.004), 0.82)
    return shaded(color, line(y - dress.fall.hem - 0.025, 0.0035), 0.86)
