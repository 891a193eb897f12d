"""People for the viewer: drawn and built once, the last few kept."""

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float64

from assets import Asset, BuildConfig, build, with_levels
from assets.asset.levels import at_level, level_error
from assets.build_config import AvatarFields
from assets.content import MOVING_FACE
from assets.picture.paint import vertex_errors
from avatargen.avatar import Sampler
from avatargen.errors import InputError
from avatargen.export.rules import check_text
from avatargen.photo.picture import Picture, picture_of
from avatargen.wardrobe.choosing import Traits

if TYPE_CHECKING:
    from avatargen.export.photographs import Finder, FoundPerson

FINDING = 0.6  # of the work on a photograph, before its person is built
KEPT = 4  # people: each takes some 100 MB with its planes
Progress = Callable[[str, float], None]  # name of the stage that begins, share of the work behind it


@dataclass(frozen=True)
class Photo:
    """A photograph's file, or that of a saved person; held in memory alone."""

    name: str
    data: bytes = field(repr=False)

    @property
    def saved(self) -> bool:
        """Whether it is a saved person's."""
        return self.name.lower().endswith(".safetensors")

    @cached_property
    def picture(self) -> Picture:
        """What it shows. Raises InputError where it is no picture."""
        return picture_of(self.data, self.name)


@dataclass(frozen=True)
class Wish:
    """Which person, as a text says or a photograph shows where there is one, in how many triangles, and
    whether in parts."""

    seed: int
    text: str = ""
    photo: Photo | None = None
    truncation: float = 1.0
    faces: int = 20_000
    parts: bool = False  # body, garments and hair as meshes of their own
    face: bool = False  # one that moves

    @property
    def who(self) -> tuple[int, str, Photo | None]:
        """The person alone."""
        return self.seed, self.text, self.photo


@dataclass(kw_only=True)
class Person:
    """A built person; coarser levels are made, and errors measured, when they are first looked at."""

    avatar: AvatarFields
    asset: Asset
    lines: tuple[str, ...] = ()  # what whoever gave a photograph should know
    measured: Float64[np.ndarray, " W"] | None = field(default=None)
    coarser: dict[int, "Person"] = field(default_factory=dict)

    def at(self, level: int) -> "Person":
        """The person in half the faces, `level` times over.

        Raises:
            AvatarGenError: the surface cannot be kept closed with so few faces.
        """
        if level == 0:
            return self
        if level not in self.coarser:
            asset = at_level(with_levels(self.asset, (len(self.asset.faces) >> level,)), 1)
            assert asset.report is not None  # every built asset has one
            report = replace(asset.report, error=level_error(asset, asset.faces, self.avatar.sdf))
            self.coarser[level] = Person(
                avatar=self.avatar, asset=replace(asset, report=report), lines=self.lines
            )
        return self.coarser[level]

    def errors(self) -> Float64[np.ndarray, " W"]:
        """Distance of the mesh to the field around each vertex, millimetres.

        Raises:
            InputError: the person is in parts, which have a field each.
        """
        if self.asset.parts:
            raise InputError("the error is shown of one mesh; leave the clothes on for good to see it")
        if self.measured is None:
            self.measured = vertex_errors(self.asset, self.avatar.sdf)
        return self.measured


class People:
    """Builds people as they are wished for. `settings` give all but the number of faces."""

    def __init__(self, sampler: Sampler, settings: Callable[[int], BuildConfig]) -> None:
        self.sampler, self.settings = sampler, settings
        self.kept: OrderedDict[Wish, Person] = OrderedDict()
        self.last: tuple[Photo, FoundPerson] | None = None

    @property
    def joint_names(self) -> tuple[str, ...]:
        return self.sampler.body.joint_names

    def get(self, wish: Wish, progress: Progress) -> Person:
        """The person wished for.

        Raises:
            AvatarGenError: the field gives no whole surface, the wish is out of range, or its text says
                nothing that can be made, or its photograph shows no whole person, or its file holds none.
        """
        if wish not in self.kept:
            self.kept[wish] = self.made(wish, progress)
            while len(self.kept) > KEPT:
                self.kept.popitem(last=False)
        self.kept.move_to_end(wish)
        return self.kept[wish]

    def made(self, wish: Wish, progress: Progress) -> Person:
        """The person, built."""
        if wish.photo is None:
            avatar = self.drawn(wish)
            return Person(avatar=avatar, asset=self.built(avatar, wish, progress))
        if wish.photo.saved:
            return self.kept_person(wish, wish.photo, progress)
        found = self.found(wish.photo, lambda stage, share: progress(stage, FINDING * share))
        asset = self.built(
            found.avatar, wish, lambda stage, share: progress(stage, FINDING + (1 - FINDING) * share)
        )
        progress("paint", 1.0)
        asset = self.finder.painted(asset, found)
        assert isinstance(asset, Asset)
        return Person(avatar=found.avatar, asset=asset, lines=tuple(found.lines()))

    def kept_person(self, wish: Wish, file: Photo, progress: Progress) -> Person:
        """The person of a file of --save-person, with the pixels that it holds."""
        from avatargen.export.person_file import decode_person  # most people are drawn
        from avatargen.export.saved_people import SavedPhotographed, person_on

        person = person_on(self.sampler, decode_person(file.data, file.name), file.name, pixels=True)
        avatar = person.sample(wish.seed)
        asset = self.built(avatar, wish, progress)
        painted = person.painted(asset) if isinstance(person, SavedPhotographed) else asset
        assert isinstance(painted, Asset)
        return Person(avatar=avatar, asset=painted)

    @cached_property
    def finder(self) -> "Finder":
        """Reads photographs. Raises InputError where its networks are missing, or the people are others."""
        from avatargen.export.photographs import Finder  # most people are drawn
        from avatargen.photo.seeing.see import open_eyes

        return Finder(self.sampler, open_eyes())

    def found(self, photo: Photo, progress: Progress) -> "FoundPerson":
        """The person of a photograph; the last one is known still."""
        if self.last is None or self.last[0] != photo:
            picture = photo.picture  # what may fail at once comes first
            self.last = (photo, self.finder.find([picture], Traits(), progress=progress))
        return self.last[1]

    def drawn(self, wish: Wish) -> AvatarFields:
        """The person as fields; whom a text describes keeps the whole variety."""
        if not wish.text:
            return self.sampler.sample(wish.seed, wish.truncation)
        from avatargen.text.person import drawn  # most people are of a seed alone

        check_text(wish.text, change=False)
        return drawn(self.sampler, wish.seed, wish.text)

    def built(self, avatar: AvatarFields, wish: Wish, progress: Progress) -> Asset:
        """The person's asset; in parts the whole body is kept, to be seen when clothes come off.

        Raises:
            InputError: parts of a person who is one field, or a face that moves in parts or on another body.
        """
        settings = replace(self.settings(wish.faces), face=MOVING_FACE if wish.face else "none")
        if not wish.parts:
            return build(avatar, settings, progress)
        from assets.separate import LayeredFields, build_parts  # most people are looked at as one mesh

        assert isinstance(avatar, LayeredFields)  # which raises for a person who is one field
        return build_parts(avatar, settings, "keep", progress)
