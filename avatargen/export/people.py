"""Where a request's people come from: the generator, or the wardrobe that it learns from."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

import avatargen
from assets.asset.asset import PlainAsset
from assets.build_config import AvatarFields
from avatargen.avatar import Avatar, Sampler, shipped
from avatargen.body.load import load_body
from avatargen.body.model import CanonicalBody, canonical_body
from avatargen.export.request import ExportRequest
from avatargen.wardrobe.choosing import Traits

if TYPE_CHECKING:
    from avatargen.artist_wardrobe import ArtistWardrobe


@runtime_checkable
class People(Protocol):
    """Avatars by seed, all on one canonical body."""

    @property
    def body(self) -> CanonicalBody: ...

    def sample(self, seed: int) -> AvatarFields: ...


@runtime_checkable
class Found(Protocol):
    """What a photograph told of a person, for reports and in lines."""

    def facts(self) -> dict[str, object]: ...

    def lines(self) -> list[str]: ...


@runtime_checkable
class Photographed(People, Protocol):
    """The person of photographs. What was found is known once that person was sampled."""

    @property
    def found(self) -> Found: ...

    def pose(self, joint_names: tuple[str, ...]) -> Float[np.ndarray, "J 3"]: ...

    def painted(self, asset: PlainAsset) -> PlainAsset: ...


@dataclass(frozen=True, kw_only=True, eq=False)
class ChosenPeople:
    """The generator's people, under the traits that were chosen and in what they borrow."""

    sampler: Sampler
    traits: Traits
    wear: Mapping[str, int]

    @property
    def body(self) -> CanonicalBody:
        return self.sampler.body

    def sample(self, seed: int) -> Avatar:
        return self.sampler.sample(seed, traits=self.traits, wear=self.wear)


@dataclass(frozen=True, kw_only=True, eq=False)
class DescribedPeople:
    """The generator's people as a text says, under the traits that were chosen besides."""

    chosen: ChosenPeople
    text: str
    change: bool  # of each seed's own person

    @property
    def body(self) -> CanonicalBody:
        return self.chosen.body

    def sample(self, seed: int) -> Avatar:
        from avatargen.text.person import drawn

        people = self.chosen
        return drawn(people.sampler, seed, self.text, self.change, people.traits, people.wear)


@dataclass(frozen=True, kw_only=True, eq=False)
class BorrowingPeople:
    """A wardrobe's people in what they borrow of each other."""

    wardrobe: "ArtistWardrobe"
    wear: Mapping[str, int]

    @property
    def body(self) -> CanonicalBody:
        return self.wardrobe.body

    def sample(self, seed: int) -> Avatar:
        return self.wardrobe.sample(seed, self.wear)


def open_people(request: ExportRequest) -> People:
    """Load what draws the request's people.

    Raises:
        InputError: a file is missing or damaged, or a wardrobe does not fit the body.
    """
    if request.photos:
        from avatargen.export.photographs import PhotoPeople  # most people are drawn

        return PhotoPeople(request)
    if request.person is not None:
        from avatargen.export.saved_people import open_saved

        return open_saved(request, request.person)
    if request.source == "generator":
        sampler = avatargen.load_generator(request.weights, body=request.body, device=request.device)
        people = ChosenPeople(sampler=sampler, traits=request.traits, wear=dict(request.wear))
        return people if request.text is None else described(people, request.text, change=request.change)
    body = canonical_body(load_body(request.body or shipped("body.npz")))
    if request.wardrobe is None:
        from avatargen.wardrobe.procedural import ProceduralWardrobe

        return ProceduralWardrobe(body)
    from avatargen.artist_wardrobe import ArtistWardrobe

    return BorrowingPeople(wardrobe=ArtistWardrobe(request.wardrobe, body), wear=dict(request.wear))


def described(people: ChosenPeople, text: str, *, change: bool) -> DescribedPeople:
    """People as a text says. Raises InputError where nothing of it can be made."""
    from avatargen.text.person import offered_by, understand

    if not change:  # else it depends on who is changed
        understand(text, offered_by(people.sampler))
    return DescribedPeople(chosen=people, text=text, change=change)
