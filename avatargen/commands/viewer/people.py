"""People for the viewer: drawn and built once, the last few kept."""

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float64

from assets import Asset, BuildConfig, build, with_levels
from assets.asset.levels import at_level, level_error
from assets.picture.paint import vertex_errors
from avatargen.avatar import Avatar, Sampler

KEPT = 4  # people: each takes some 100 MB with its planes
Progress = Callable[[str, float], None]  # name of the stage that begins, share of the work behind it


@dataclass(frozen=True)
class Wish:
    """Which person, and in how many triangles."""

    seed: int
    truncation: float = 1.0
    faces: int = 20_000


@dataclass(kw_only=True)
class Person:
    """A built person; coarser levels are made, and errors measured, when they are first looked at."""

    avatar: Avatar
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
        """Distance of the mesh to the field around each vertex, millimetres."""
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
            AvatarGenError: the field gives no whole surface, or the wish is out of range.
        """
        if wish not in self.kept:
            avatar = self.sampler.sample(wish.seed, wish.truncation)
            self.kept[wish] = Person(avatar=avatar, asset=build(avatar, self.settings(wish.faces), progress))
            while len(self.kept) > KEPT:
                self.kept.popitem(last=False)
        self.kept.move_to_end(wish)
        return self.kept[wish]
