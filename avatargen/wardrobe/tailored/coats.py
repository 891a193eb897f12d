"""Coats: a wide top and what hangs from its waist, open in front, with a collar."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from avatargen.smoothstep import smoothstep
from avatargen.wardrobe.tailored.collars import Collar, collared
from avatargen.wardrobe.tailored.curves import Places, Values
from avatargen.wardrobe.tailored.cutting import cut
from avatargen.wardrobe.tailored.details import buttons
from avatargen.wardrobe.tailored.dresses import Dress, dress_paint, dress_sheet
from avatargen.wardrobe.tailored.form import Sheet, to_front
from avatargen.wardrobe.tailored.painting import Texels, line, shaded

BEHIND = 0.02  # m before the side seams, from where the front's edges are cut


@dataclass(frozen=True, kw_only=True)
class Coat:
    """A dress's cut with its front open: half as wide as `open` below, `lapel` at the neck. Metres."""

    dress: Dress
    collar: Collar
    open: float
    lapel: float

    def front(self, at: Places) -> Values:
        """Beside the opening."""
        wide = self.open + (self.lapel - self.open) * smoothstep((at[:, 1] - 0.27) / 0.27)
        return np.maximum(np.abs(at[:, 0]) - wide, BEHIND - to_front(at))


def coat_sheet(coat: Coat) -> Sheet:
    """A coat's cloth."""
    sheet = collared(dress_sheet(coat.dress), coat.collar, coat.dress.top.ease)
    return cut(sheet, coat.front(sheet.at))


def coat_paint(coat: Coat, found: Texels) -> Float64[np.ndarray, "N 3"]:
    """A dress's, with stitched front edges, buttons on one side and pockets."""
    at = found.at
    color = dress_paint(coat.dress, found)
    front = to_front(at) > BEHIND
    color = shaded(color, line(coat.front(at) - 0.018, 0.003) * front, 0.84)
    for height in (0.22, 0.1, -0.02):
        color = buttons(color, at, coat.open + 0.03, height, 0.011)
    slant = (np.abs(at[:, 0]) - 0.13) * 0.9 + (at[:, 1] - 0.03) * 0.25
    on = front & (np.abs(at[:, 1] - 0.02) < 0.075)
    return shaded(color, line(slant, 0.004) * on, 0.75)
