"""A person of a file in place of a seed's, and the file of a person who was made."""

import json
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float64

import avatargen
from assets.asset.asset import PlainAsset, TexturedAsset
from assets.build_config import AvatarFields
from avatargen.avatar import Avatar, Sampler
from avatargen.body.model import CanonicalBody
from avatargen.dressed_avatar import DressedSampler
from avatargen.errors import InputError
from avatargen.export.person_file import Saved, Words, read_person
from avatargen.export.photo_pixels import painted
from avatargen.export.photographs import GENDERS, FoundPerson, for_joints
from avatargen.export.request import ExportRequest
from avatargen.generator.config import body_hash
from avatargen.photo.models import FACE, model_path
from avatargen.photo.seeing.network import FileNetwork, Network
from avatargen.wardrobe.beards import BEARDS
from avatargen.wardrobe.makehuman.choose import Attributes

PRINTS = ("plain", "across", "down", "checks")


def saved(avatar: AvatarFields, found: object, *, pixels: bool) -> Saved:
    """What a file keeps of a person; of one who was found in photographs their `pixels`, or no more than the
    pose.

    Raises:
        InputError: the person is one field, of whom there is nothing to keep but the seed.
    """
    person = avatar.info.attributes
    if not isinstance(avatar, Avatar) or not isinstance(person, Attributes):
        raise InputError(
            "found --save-person of people who are one field; leave --weights out, or keep their seed"
        )
    if isinstance(found, SavedPhotographed):
        return found.saved if pixels else without_pixels(found.saved)
    words = Words(
        attributes=person,
        seed=avatar.seed,
        height=avatar.height,
        said=avatar.info.said,
        weights_hash=avatar.info.weights_hash,
        body_hash=body_hash(avatar.body),
    )
    if not isinstance(found, FoundPerson):
        return Saved(words=words, betas=avatar.betas)
    whole = Saved(
        words=replace(
            words,
            looks=tuple((look.fit.camera.focal, look.fit.height) for look in found.looks),
            photo=json.dumps(found.facts() | {"seconds": {}}),
        ),
        betas=avatar.betas,
        turns=found.fits[0].rotations,
        looks=found.looks,
        stuffs=found.stuffs,
    )
    return whole if pixels else without_pixels(whole)


def without_pixels(person: Saved) -> Saved:
    """The same person and pose."""
    return replace(person, words=replace(person.words, looks=()), looks=(), stuffs=None)


@dataclass(frozen=True, kw_only=True, eq=False)
class SavedPerson:
    """The person of a file, whatever seed is asked for."""

    sampler: DressedSampler
    saved: Saved

    @property
    def body(self) -> CanonicalBody:
        return self.sampler.body

    def sample(self, seed: int) -> Avatar:
        words = self.saved.words
        avatar = self.sampler.avatar(words.attributes, self.saved.betas, words.height, words.seed)
        return replace(avatar, info=replace(avatar.info, said=words.said))


@dataclass(frozen=True, kw_only=True, eq=False)
class SavedPhotographed(SavedPerson):
    """The person of a file who was found in photographs. With `face`, the face network, in their pixels."""

    face: Network | None

    @property
    def found(self) -> "SavedPhotographed":
        return self

    def facts(self) -> dict[str, object]:
        return json.loads(self.saved.words.photo)

    def lines(self) -> list[str]:
        return []  # they were told when the photographs were given

    def pose(self, joint_names: tuple[str, ...]) -> Float64[np.ndarray, "J 3"]:
        assert self.saved.turns is not None
        return for_joints(self.saved.turns, self.body.joint_names, joint_names)

    def painted(self, asset: PlainAsset) -> PlainAsset:
        saved = self.saved
        if not isinstance(asset, TexturedAsset) or saved.stuffs is None:
            return asset
        return painted(asset, self.body, saved.looks, saved.stuffs, self.face)


def open_saved(request: ExportRequest, path: Path) -> SavedPerson:
    """The person of a request's file.

    Raises:
        InputError: the file is missing, damaged, or of other weights or another body, the photograph's pose
            is asked for and there is none, or the face network is missing and pixels are wanted.
    """
    saved = read_person(path)
    sampler = avatargen.load_generator(request.weights, body=request.body, device=request.device)
    person = person_on(sampler, saved, str(path), pixels=request.texture_from == "photo")
    if request.photo_pose and not isinstance(person, SavedPhotographed):
        raise InputError(f"found --pose photo, but {path} holds no photograph's pose; leave it out")
    return person


def person_on(sampler: Sampler, saved: Saved, name: str, *, pixels: bool) -> SavedPerson:
    """A saved person on the weights they were saved with; with `pixels`, a photograph's are on the texture.
    Errors call the file `name`.

    Raises:
        InputError: they were saved with other weights or another body, wear what there is not, or the face
            network is missing and there are pixels.
    """
    if not isinstance(sampler, DressedSampler) or sampler.weights_hash != saved.words.weights_hash:
        raise InputError(f"person: {name} was saved with other weights; give those, or save the person anew")
    if body_hash(sampler.body) != saved.words.body_hash:
        raise InputError(f"person: {name} was saved with another body; give that, or save the person anew")
    check_person(saved, sampler, name)
    if not saved.words.photo:
        return SavedPerson(sampler=sampler, saved=saved)
    face = FileNetwork(model_path(FACE, None)) if saved.looks and pixels else None
    return SavedPhotographed(sampler=sampler, saved=saved, face=face)


def check_person(saved: Saved, sampler: DressedSampler, name: str) -> None:
    """Raises InputError where a person is or wears what the weights do not have, or has another body."""
    person, skin, items = saved.words.attributes, sampler.config.skin, sampler.items
    count, body = len(person.garments), sampler.body.source
    numbers = [*person.skin_tint, *person.hair_colour, *person.print_colour, person.skin_mix]
    numbers += [x for colour in (*person.colours, *person.shades) if colour is not None for x in colour]
    known = (
        all(each in items for each in person.garments)
        and all(items[each].kind == kind for each, kind in zip(person.garments, person.kinds, strict=False))
        and (person.hair is None or (person.hair in items and items[person.hair].kind == "hair"))
        and set(person.skin) <= set(skin.skins)
        and person.eyes in skin.irises
        and person.sex in GENDERS
        and person.beard in BEARDS
        and set(person.prints) <= set(PRINTS)
        and {len(person.colours), len(person.kinds), len(person.shades), len(person.prints)} == {count}
        and all(0 <= x <= 2 for x in numbers)
        and 0 < person.print_width < 1
        and saved.betas.shape == (body.shapedirs.shape[2],)
        and (saved.turns is None or len(saved.turns) == body.joint_count)
        and all(len(look.fit.betas) <= body.shapedirs.shape[2] for look in saved.looks)
    )
    if not known:
        raise InputError(f"person: {name} is damaged (nobody is or wears that); save the person anew")
