"""Where a request's people come from: the generator, or the wardrobe that it learns from."""

from typing import Protocol, runtime_checkable

import avatargen
from assets.build_config import AvatarFields
from avatargen.avatar import shipped
from avatargen.body.load import load_body
from avatargen.body.model import CanonicalBody, canonical_body
from avatargen.export.request import ExportRequest


@runtime_checkable
class People(Protocol):
    """Avatars by seed, all on one canonical body."""

    @property
    def body(self) -> CanonicalBody: ...

    def sample(self, seed: int) -> AvatarFields: ...


def open_people(request: ExportRequest) -> People:
    """Load what draws the request's people.

    Raises:
        InputError: a file is missing or damaged, or a wardrobe does not fit the body.
    """
    if request.source == "generator":
        return avatargen.load_generator(request.weights, body=request.body, device=request.device)
    body = canonical_body(load_body(request.body or shipped("body.npz")))
    if request.wardrobe is None:
        from avatargen.wardrobe.procedural import ProceduralWardrobe

        return ProceduralWardrobe(body)
    from avatargen.wardrobe.makehuman.person import Wardrobe

    return Wardrobe(request.wardrobe, body)
