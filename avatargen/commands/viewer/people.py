"""People for the viewer: drawn and built once, the last few kept."""

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float64

from assets import Asset, BuildConfig, build, with_levels
from assets.asset.levels import at_level, level_error
from assets.build_config import AvatarFields
from assets.picture.paint import vertex_errors
from avatargen.avatar import Avatar, Sampler
from avatargen.errors import InputError
from avatargen.export.rules import check_text

KEPT = 4  # people: each takes some 100 MB with its planes
Progress = Callable[[str, float], None]  # name of the stage that begins, share of the work behind it


@dataclass(frozen=True)
class Wish:
    """Which person, as a text says where there is one, in how many triangles, and whether in parts."""

    seed: int
    text: str = ""
    truncation: float = 1.0
    faces: int = 20_000
    parts: bool = False  # body, garments and hair as meshes of their own


@dataclass(kw_only=True)
class Person:
    """A built person; coarser levels are made, and errors measured, when they are first looked at."""

    avatar: AvatarFields
    asset: Asset
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
            self.coarser[level] = Person(avatar=self.avatar, asset=replace(asset, report=report))
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

    @property
    def joint_names(self) -> tuple[str, ...]:
        return self.sampler.body.joint_names

    def get(self, wish: Wish, progress: Progress) -> Person:
        """The person wished for.

        Raises:
            AvatarGenError: the field gives no whole surface, the wish is out of range, or its text says
                nothing that can be made.
        """
        if wish not in self.kept:
            avatar = self.drawn(wish)
            self.kept[wish] = Person(avatar=avatar, asset=self.built(avatar, wish, progress))
            while len(self.kept) > KEPT:
                self.kept.popitem(last=False)
        self.kept.move_to_end(wish)
        return self.kept[wish]

    def drawn(self, wish: Wish) -> Avatar:
        """The person as fields; whom a text describes keeps the whole variety."""
        if not wish.text:
            return self.sampler.sample(wish.seed, wish.truncation)
        from avatargen.text.person import drawn  # most people are of a seed alone

        check_text(wish.text, change=False)
        return drawn(self.sampler, wish.seed, wish.text)

    def built(self, avatar: AvatarFields, wish: Wish, progress: Progress) -> Asset:
        """The person's asset; in parts the whole body is kept, to be seen when clothes come off.

        Raises:
            InputError: parts of a person who is one field.
        """
        settings = self.settings(wish.faces)
        if not wish.parts:
            return build(avatar, settings, progress)
        from assets.separate import LayeredFields, build_parts  # most people are looked at as one mesh

        assert isinstance(avatar, LayeredFields)  # which raises for a person who is one field
        return build_parts(avatar, settings, "keep", progress)
