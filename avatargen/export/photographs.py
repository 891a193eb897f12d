"""People of photographs: the generator's person who is most like the one that is seen, and the photographs'
own colours on that person's texture."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float64, UInt8

from assets.asset.asset import PlainAsset, TexturedAsset
from assets.picture.preview import sample_texture
from assets.texture.atlas import Atlas
from assets.texture.bake import TexelMap, map_texels
from avatargen.avatar import Avatar
from avatargen.body.model import CanonicalBody
from avatargen.dressed_avatar import DressedSampler
from avatargen.errors import InputError
from avatargen.photo.fit import Fit, Fitter
from avatargen.photo.picture import read_picture
from avatargen.photo.pixels import Shown, evened, scene_of, show, trust
from avatargen.photo.resembling.person import attributes_of, avatar_of
from avatargen.photo.resembling.pieces import Dresser
from avatargen.photo.resembling.resemble import Resemblance, Wardrobe, resemble
from avatargen.photo.seeing.see import open_eyes, see
from avatargen.photo.sighting import Sighting
from avatargen.wardrobe.choosing import Traits

GENDERS = ("woman", "man")
GAMMA = 2.2  # of `sample_texture`'s linear light


@dataclass(frozen=True, kw_only=True, eq=False)
class FoundPerson:
    """A person in a photograph, and the person of the generator who is most like them."""

    sighting: Sighting
    fit: Fit
    resemblance: Resemblance
    avatar: Avatar


def find_person(sampler: DressedSampler, sighting: Sighting, traits: Traits) -> FoundPerson:
    """Fit and dress the person who was seen. `traits` may tell gender, age and height."""
    assert sampler.sizing is not None
    fitter, wardrobe = Fitter(sampler.body.source, sampler.sizing), Wardrobe(sampler)
    found: list[tuple[Fit, Resemblance]] = []
    for sex in GENDERS if traits.gender is None else (traits.gender,):
        fit = fitter.fit(sighting, height=traits.height, gender=sex)
        found.append((fit, resemble(sampler, wardrobe, sighting, fit, sex)))
    fit, best = min(found, key=lambda each: each[1].miss)
    person = attributes_of(sampler, best, traits.age or "young")
    return FoundPerson(
        sighting=sighting, fit=fit, resemblance=best, avatar=avatar_of(sampler, person, fit)
    )


def painted(asset: TexturedAsset, found: FoundPerson) -> TexturedAsset:
    """The asset, where the photograph shows it well in the photograph's own colours."""
    assert asset.canonical is not None
    size, sighting = len(asset.texture), found.sighting
    vertices = Dresser(found.avatar.body).move(asset.canonical, found.fit)
    scene = scene_of(vertices, asset.faces, found.fit.camera)
    tall = float((sighting.mask > 0.5).any(axis=1).sum())
    trusted = trust(scene.seen, sighting.mask, tall)
    own = np.zeros(sighting.picture.pixels.shape)
    at = scene.seen.mask
    own[at] = sample_texture(asset, scene.seen.face[at], scene.seen.barycentric[at]).clip(0, 1) ** (1 / GAMMA)
    photograph = evened(sighting.picture.pixels, own, trusted, tall)
    texels = map_texels(
        Atlas(vertex_map=np.arange(len(asset.vertices)), uv=asset.uv, faces=asset.faces), size
    )
    shown = show(
        scene, texels.face[texels.asked], texels.barycentric(texels.asked), photograph, trusted
    )
    return replace(asset, texture=blended(asset.texture, texels, shown))


def blended(
    texture: UInt8[np.ndarray, "S S 3"], texels: TexelMap, shown: Shown
) -> UInt8[np.ndarray, "S S 3"]:
    """The texture with what is shown laid over it."""
    values = texture.reshape(-1, 3).astype(np.float64)
    old = values[texels.asked]
    values[texels.asked] = old + shown.weight[:, None] * (255 * shown.color - old)
    return texels.spread(np.rint(values).astype(np.uint8).reshape(texture.shape))
