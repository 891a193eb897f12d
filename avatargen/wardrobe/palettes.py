"""The ranges of colour that garments draw from, for those who go from a colour back to its coordinates."""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float64

from avatargen.wardrobe.attributes import LATENT_SIZE, People, coordinate


@dataclass(frozen=True, kw_only=True)
class Palette:
    """One coloured attribute, with the range of its lightness and the reach of its hues."""

    name: str
    low: float = 0.06
    high: float = 0.92
    chroma: float = 0.16

    @property
    def coordinates(self) -> slice:
        first = coordinate(self.name)
        return slice(first, first + 3)

    def colours(self, normal: Float64[np.ndarray, "N 3"]) -> Float64[np.ndarray, "N 3"]:
        """Colours, sRGB 0..1, of rows of the attribute's three coordinates."""
        z = torch.zeros(len(normal), LATENT_SIZE, dtype=torch.float64)
        z[:, self.coordinates] = torch.from_numpy(normal)
        return People(z).colour(self.name, self.low, self.high, self.chroma)[:, 0].numpy()


PALETTES = {  # as `garments.py` has them
    "top": Palette(name="top"),
    "trousers": Palette(name="bottom", low=0.05, high=0.75, chroma=0.10),
    "skirt": Palette(name="bottom", low=0.08, high=0.85),
    "outer": Palette(name="outer", low=0.06, high=0.80, chroma=0.12),
}
