"""From what was found in a photograph to a person of the generator: attributes and an avatar."""

import numpy as np
import torch
from jaxtyping import Float

from avatargen.avatar import Avatar
from avatargen.dressed_avatar import DressedSampler
from avatargen.photo.problem import Fit
from avatargen.photo.resembling.resemble import Resemblance
from avatargen.wardrobe.appearance import Rgb, rgb_of
from avatargen.wardrobe.makehuman.choose import FULL_SIZE, TONES, Attributes, Draw, face_lines, skin_names
from avatargen.wardrobe.makehuman.hairs import hair_worn

HAIR, IRIS = (0.16, 0.11, 0.08), "brown"  # where nobody can see them
SHARES = np.linspace(0, 1, 41)  # of a dark skin in a mixture
TINT = (0.72, 1.22)  # factors on a skin, that light in a photograph may need


def attributes_of(sampler: DressedSampler, found: Resemblance, age: str) -> Attributes:
    """A person who wears what was found, in the colours that were seen."""
    outfit, items, skin = found.outfit, sampler.items, sampler.config.skin
    kinds = tuple(items[name].kind for name in outfit.garments)
    seen = [found.colors.get(name) for name in outfit.garments]
    colours = tuple(None if each is None else rgb(each) for each in seen)
    shades = [items[n].own_color if c is None else c for n, c in zip(outfit.garments, colours, strict=True)]
    hair = found.colors.get(outfit.hair) if outfit.hair else None
    names, mix, tint = skin_of(sampler, found, age)
    usual, woman = Draw(torch.zeros(1, FULL_SIZE)), found.sex == "woman"  # of what the picture does not say
    return Attributes(
        sex=found.sex,
        age=age,
        tone=next(name for name, end in TONES if 0.5 + 0.3 * mix <= end) if mix else "light",
        skin=names,
        skin_mix=mix,
        skin_tint=tint,
        eyes=IRIS if IRIS in skin.irises else skin.irises[0],
        face=face_lines(usual, woman),
        hair=outfit.hair,
        hair_colour=HAIR if hair is None else rgb(hair),
        hair_worn=hair_worn(usual.share, woman, usual.share("age")),
        beard="none",
        garments=outfit.garments,
        colours=colours,
        kinds=kinds,
        shades=tuple(shades),
        prints=("plain",) * len(kinds),
        print_colour=(0.5, 0.5, 0.5),
        print_width=0.02,
    )


def rgb(color: Float[np.ndarray, "3"]) -> Rgb:
    """sRGB of CIELAB."""
    r, g, b = rgb_of(np.asarray(color, dtype=np.float64)[None])[0].tolist()
    return (r, g, b)


def skin_of(sampler: DressedSampler, found: Resemblance, age: str) -> tuple[tuple[str, str], float, Rgb]:
    """A light and a dark skin of the age and sex, the share of the dark one and the tint that come closest to
    the colour of the face."""
    sex, names = ("female" if found.sex == "woman" else "male"), list(sampler.config.skin.skins)
    light, dark = (skin_names(names, age, tone, sex)[0] for tone in ("light", "dark"))
    middles = sampler.skin.middle[[names.index(light), names.index(dark)]]
    wanted = np.array(rgb(found.skin))
    mixed = (1 - SHARES)[:, None] * middles[0] + SHARES[:, None] * middles[1]
    tints = (wanted / np.maximum(mixed, 1e-3)).clip(*TINT)
    off = np.linalg.norm(mixed * tints - wanted, axis=1) + 0.1 * np.linalg.norm(np.log(tints), axis=1)
    best = int(off.argmin())
    r, g, b = tints[best].tolist()
    return (light, dark), float(SHARES[best]), (r, g, b)


def avatar_of(sampler: DressedSampler, person: Attributes, fit: Fit) -> Avatar:
    """The person on the fitted body."""
    betas = np.zeros(sampler.body.source.shapedirs.shape[2], np.float32)
    betas[: len(fit.betas)] = fit.betas
    return sampler.avatar(person, betas, fit.height, seed=0)
