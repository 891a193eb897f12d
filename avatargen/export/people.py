"""Where a request's people come from: the generator, or the wardrobe that it learns from."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import avatargen
from assets.build_config import AvatarFields
from avatargen.avatar import Avatar, Sampler, shipped
from avatargen.body.load import load_body
from avatargen.body.model import CanonicalBody, canonical_body
from avatargen.export.request import ExportRequest
from avatargen.wardrobe.choosing import Traits


@runtime_checkable
class People(Protocol):
    """Avatars by seed, all on one canonical body."""

    @property
    def body(self) -> CanonicalBody: ...

    def sample(self, seed: int) -> AvatarFields: ...


@dataclass(frozen=True, kw_only=True, eq=False)
class ChosenPeople:
    """The generator's people, under the traits that were chosen."""

    sampler: Sampler
    traits: Traits

    @property
    def body(self) -> CanonicalBody:
        return self.sampler.body

    def sample(self, seed: int) -> Avatar:
        return self.sampler.sample(seed, traits=self.traits)


def open_people(request: ExportRequest) -> People:
    """Load what draws the request's people.

    Raises:
        InputError: a file is missing or damaged, or a wardrobe does not fit the body.
    """
    if request.source == "generator":
        sampler = avatargen.load_generator(request.weights, body=request.body, device=request.device)
        return ChosenPeople(sampler=sampler, traits=request.traits)
    body = canonical_body(load_body(request.body or shipped("body.npz")))
    if request.wardrobe is None:
        from avatargen.wardrobe.procedural import ProceduralWardrobe

        return ProceduralWardrobe(body)
    from avatargen.artist_wardrobe import ArtistWardrobe

    return ArtistWardrobe(request.wardrobe, body)
