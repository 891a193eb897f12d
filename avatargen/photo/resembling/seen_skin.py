"""Which skin somebody in a photograph has, of those that a generator knows, by its colour."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Float64

from avatargen.dressed_avatar import DressedSampler
from avatargen.wardrobe.appearance import Rgb, rgb_of
from avatargen.wardrobe.makehuman.choose import TONES, skin_names, skin_of

AGE = "young"  # where nobody tells
DEPTHS = np.linspace(0, 1, 101)  # of skins: the measure by which they are drawn
ENDS = [end for _, end in TONES]
DIMMER, HUE = (-0.06, 0.08), 0.04  # mean and spread of the logarithm of light's factor; spread of a channel's
TINT = (0.72, 1.22)  # factors on a skin, that light in a photograph may need


@dataclass(frozen=True, kw_only=True)
class SeenSkin:
    """A skin as `Attributes` have it."""

    tone: str
    names: tuple[str, str]
    mix: float
    tint: Rgb


def seen_skin(sampler: DressedSampler, color: Float64[np.ndarray, "3"], sex: str, age: str = AGE) -> SeenSkin:
    """The likeliest skin of a sex and age whose colour, CIELAB, was photographed. All depths are as likely;
    light makes a colour darker or lighter by some factor (`DIMMER`), and hues vary (`HUE`). What the skin is
    off the colour all the same is its tint."""
    names = list(sampler.config.skin.skins)
    lights, darks = (
        skin_names(names, age, tone, "female" if sex == "woman" else "male") for tone in ("light", "dark")
    )
    dark, shade = np.array([skin_of(float(depth)) for depth in DEPTHS]).T[..., None]
    first = sampler.skin.middle[[names.index(name) for name in lights]]
    colors = ((1 - dark) * first[:, None] + dark * sampler.skin.middle[names.index(darks[0])]) * shade
    wanted = rgb_of(color[None])[0].clip(0.02, 1)
    off = np.log(wanted) - np.log(colors)  # photographs, depths, channels
    dimmer = off.mean(axis=2)
    unlike = ((dimmer - DIMMER[0]) / DIMMER[1]) ** 2 + (((off - dimmer[..., None]) / HUE) ** 2).sum(axis=2)
    likely = np.exp(-0.5 * (unlike - unlike.min()))
    within = np.array([[low < depth <= high for depth in DEPTHS] for low, high in pairwise((-1.0, *ENDS))])
    tone = int((within @ likely.sum(axis=0)).argmax())
    row, place = np.unravel_index((likely * within[tone]).argmax(), likely.shape)
    mix = float(dark[place, 0])
    mixed = (1 - mix) * first[row] + mix * sampler.skin.middle[names.index(darks[0])]
    r, g, b = (wanted / mixed).clip(*TINT).tolist()
    return SeenSkin(tone=TONES[tone][0], names=(lights[row], darks[0]), mix=mix, tint=(r, g, b))
