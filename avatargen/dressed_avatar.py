"""Dressed people by seed: a generator of them on a body, which draws avatars.

A seed's latent is read as the artist-made wardrobe reads it, so a seed is the same person here and there.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float32

from avatargen import __version__
from avatargen.avatar import (
    BOX_MARGIN,
    Avatar,
    require_seed,
    require_shown,
    require_truncation,
    trained_body,
)
from avatargen.avatar_info import AvatarInfo
from avatargen.body.distance import BodyDistance
from avatargen.body.load import load_body
from avatargen.body.model import Body, CanonicalBody, canonical_body, shape
from avatargen.generator.config import body_hash
from avatargen.generator.dressed.checkpoint import load_dressed
from avatargen.generator.dressed.config import DressedConfig
from avatargen.generator.dressed.garment import LearnedHair, ReadyGarment, WornGarment, ready_garment
from avatargen.generator.dressed.skin import ReadySkin, ready_skin
from avatargen.shipped import shipped
from avatargen.wardrobe.appearance import Dye
from avatargen.wardrobe.choosing import Traits, traits_of
from avatargen.wardrobe.cloth_grain import Grain, grain_of
from avatargen.wardrobe.dressed import DressedField
from avatargen.wardrobe.makehuman.choose import DRESS, Attributes, Draw, Item, choose, draw_latent
from avatargen.wardrobe.makehuman.condition import condition
from avatargen.wardrobe.makehuman.grooming import hairdo_of
from avatargen.wardrobe.makehuman.hm08 import load_hm08
from avatargen.wardrobe.makehuman.words import garment_word, hair_word
from avatargen.wardrobe.stature import Sizing
from avatargen.wardrobe.worn_hair import WornHair

LOW, HIGH = (-1.05, -1.2, -0.35), (1.05, 1.0, 0.4)  # m; what a person's clothes and hair stay within


@dataclass(frozen=True, kw_only=True, eq=False)
class DressedSampler:
    """A trained generator of dressed people on a body."""

    config: DressedConfig
    body: CanonicalBody
    distance: BodyDistance
    fitted: CanonicalBody  # that it was trained on
    own_body: bool
    offset: Float32[np.ndarray, "3"]
    ready: Callable[[str], ReadyGarment]  # made ready when somebody first wears it
    skin: ReadySkin
    grain: Grain  # along which cloth is printed
    bounds: Float32[np.ndarray, "2 3"]
    sizing: Sizing | None  # statures of the body's shapes; None where these mean other things
    weights_hash: str
    licence: str

    @torch.inference_mode()
    def sample(
        self,
        seed: int,
        truncation: float = 1.0,
        traits: Traits | Mapping[str, str | float] | None = None,
        wear: Mapping[str, int] | None = None,
    ) -> Avatar:
        """Draw a person, as `AvatarSampler.sample` does; what a seed says is what the artist-made wardrobe's
        own person of that seed is and wears. With `wear`, such as {"top": 8, "outer": 8}, in garments of
        other seeds.

        Raises:
            InputError: the seed is no whole number in 0..2^63 - 1, truncation is not in 0..1, traits are
            unknown, contradict each other, or are none that this body can show, or a seed does not wear what
            is borrowed of it.
        """
        require_seed(seed)
        require_truncation(truncation)
        chosen = traits if isinstance(traits, Traits) else traits_of(traits or {})
        z = truncation * draw_latent(seed)
        person = self.choose(Draw(z))
        if chosen.given():
            require_shown(chosen, truncation, coded=True, sizing=self.sizing)
            z, person = condition(z, chosen, self)
        draw = Draw(z)
        if wear:
            from avatargen.wardrobe.makehuman.borrow import borrow  # most people wear their own

            person = borrow(person, lambda lender: self.lender(lender, truncation), wear)
        betas = self.betas(draw, chosen.height)
        height = float(np.ptp(shape(self.body.source, betas).vertices[:, 1]))
        return self.avatar(person, betas, height, seed)

    def avatar(
        self, person: Attributes, betas: Float32[np.ndarray, " b"], height: float, seed: int
    ) -> Avatar:
        """A person of known attributes and shape, `height` metres tall."""
        return Avatar(
            body=self.body,
            betas=betas,
            bounds=self.bounds,
            info=AvatarInfo(
                seed=seed,
                weights_hash=self.weights_hash,
                version=__version__,
                licence=self.licence,
                height_m=height,
                attributes=person,
            ),
            field=self.dress(person),
        )

    def had(self) -> dict[str, set[str]]:
        """Words of what there is to wear, by trait."""
        words: dict[str, set[str]] = {
            name: set() for name in ("hair", "top", "bottom", "overall", "outer", "shoes", "hat")
        }
        for each in self.config.garments:
            if each.kind == "hair":
                words["hair"].add(hair_word(each.name))
            elif each.kind == DRESS:
                words["top"].add(DRESS)
                words["bottom"].add(DRESS)
            elif each.kind in words:
                words[each.kind].add(garment_word(each.name, each.kind))
        words["hair"].add(hair_word(None))
        return words

    def lender(self, seed: int, truncation: float) -> Attributes:
        """The person of a seed, of whom something is borrowed."""
        require_seed(seed)
        return self.choose(Draw(truncation * draw_latent(seed)))

    def choose(self, draw: Draw, items: Mapping[str, Item] | None = None) -> Attributes:
        """What the person of a draw is and wears, out of all there is or out of these items."""
        skin = self.config.skin
        return choose(draw, self.items if items is None else items, list(skin.skins), list(skin.irises))

    @property
    def irises(self) -> tuple[str, ...]:
        """Colours of eyes."""
        return tuple(self.config.skin.irises)

    @property
    def items(self) -> Mapping[str, Item]:
        """What there is to choose among."""
        return {each.name: each for each in self.config.garments}

    def dress(self, person: Attributes) -> DressedField:
        """The field of a person."""
        worn = [
            WornGarment(
                ready=self.ready(name),
                appearance=Dye(
                    middle=self.ready(name).config.middle,
                    dye=colour,
                    kind=kind,
                    ink=person.print_colour,
                    width=person.print_width,
                    grain=self.grain,
                ),
            )
            for name, colour, kind in zip(person.garments, person.colours, person.prints, strict=True)
        ]
        hair = None
        if person.hair is not None:
            volume = LearnedHair(ready=self.ready(person.hair))
            hair = WornHair(volume=volume, hairdo=hairdo_of(person), body=self.fitted)
        return DressedField(
            body=self.fitted,
            distance=self.distance,
            skin=self.skin.of(person),
            garments=tuple(worn),
            hair=hair,
            fitted=None if self.own_body else self.fitted.distance,
            offset=self.offset,
        )

    def betas(self, draw: Draw, height: float | None) -> Float32[np.ndarray, " b"]:
        """The body's shape at the stature asked for or the person's own."""
        if self.sizing is None:
            return np.zeros(self.body.source.shapedirs.shape[2], np.float32)
        betas = self.sizing.betas(draw.people)
        if height is not None:
            betas = self.sizing.sized(betas, torch.full((1, 1), height))
        return betas[0].numpy()


def load_dressed_sampler(weights: str | Path, body: str | Path | Body | None = None) -> DressedSampler:
    """Load a generator of dressed people, on its own body or on another, pelvis to pelvis.

    Raises:
        InputError: a file is missing or damaged, or the weights fit neither this body nor the default one.
    """
    checkpoint = load_dressed(weights)
    config = checkpoint.config
    source = body if isinstance(body, Body) else load_body(body or shipped("body.npz"))
    canonical = canonical_body(source)
    own_body = body_hash(canonical) == config.body_hash
    trained = canonical if own_body else trained_body(config.body_hash)
    offset = (trained.joints[0] - canonical.joints[0]).astype(np.float32)
    low = np.minimum(np.array(LOW) - offset, canonical.vertices.min(axis=0) - BOX_MARGIN)
    high = np.maximum(np.array(HIGH) - offset, canonical.vertices.max(axis=0) + BOX_MARGIN)
    return DressedSampler(
        config=config,
        body=canonical,
        distance=canonical.distance,
        fitted=trained,
        own_body=own_body,
        offset=offset,
        ready=cache(lambda name: ready_garment(checkpoint.garment(name))),
        skin=ready_skin(checkpoint.skin(), config.skin, trained, load_hm08()),
        grain=grain_of(trained),
        bounds=np.stack([low, high]).astype(np.float32),
        sizing=Sizing(source) if own_body else None,
        weights_hash=checkpoint.weights_hash,
        licence=checkpoint.notes.get("licence", "unknown"),
    )
