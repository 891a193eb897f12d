"""From what was found in a photograph to a person of the generator: attributes and an avatar."""

import numpy as np
import torch
from jaxtyping import Float

from avatargen.avatar import Avatar
from avatargen.dressed_avatar import DressedSampler
from avatargen.photo.problem import Fit
from avatargen.photo.resembling.resemble import Resemblance
from avatargen.photo.resembling.seen_skin import seen_skin
from avatargen.wardrobe.appearance import Rgb, rgb_of
from avatargen.wardrobe.makehuman.choose import FULL_SIZE, Attributes, Draw, face_lines
from avatargen.wardrobe.makehuman.hairs import hair_worn

HAIR, IRIS = (0.16, 0.11, 0.08), "brown"  # where nobody can see them


def attributes_of(sampler: DressedSampler, found: Resemblance, age: str) -> Attributes:
    """A person who wears what was found, in the colours that were seen."""
    outfit, items, skin = found.outfit, sampler.items, sampler.config.skin
    kinds = tuple(items[name].kind for name in outfit.garments)
    seen = [found.colors.get(name) for name in outfit.garments]
    colours = tuple(None if each is None else rgb(each) for each in seen)
    shades = [items[n].own_color if c is None else c for n, c in zip(outfit.garments, colours, strict=True)]
    hair = found.colors.get(outfit.hair) if outfit.hair else None
    skin_seen = seen_skin(sampler, found.skin, found.sex, age)
    usual, woman = Draw(torch.zeros(1, FULL_SIZE)), found.sex == "woman"  # of what the picture does not say
    return Attributes(
        sex=found.sex,
        age=age,
        tone=skin_seen.tone,
        skin=skin_seen.names,
        skin_mix=skin_seen.mix,
        skin_tint=skin_seen.tint,
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


def avatar_of(sampler: DressedSampler, person: Attributes, fit: Fit) -> Avatar:
    """The person on the fitted body."""
    betas = np.zeros(sampler.body.source.shapedirs.shape[2], np.float32)
    betas[: len(fit.betas)] = fit.betas
    return sampler.avatar(person, betas, fit.height, seed=0)
