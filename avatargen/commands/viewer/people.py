"""People for the viewer: drawn and built once, the last few kept."""

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float64

from assets import Asset, BuildConfig, build
from assets.paint import vertex_errors
from avatargen.avatar import Avatar, AvatarSampler

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
    """A built person; the errors are measured when they are first looked at."""

    avatar: Avatar
    asset: Asset
    measured: Float64[np.ndarray, " W"] | None = field(default=None)

    def errors(self) -> Float64[np.ndarray, " W"]:
        """Distance of the mesh to the field around each vertex, millimetres."""
        if self.measured is None:
            self.measured = vertex_errors(self.asset, self.avatar.sdf)
        return self.measured


class People:
    """Builds people as they are wished for. `settings` give all but the number of faces."""

    def __init__(self, sampler: AvatarSampler, settings: Callable[[int], BuildConfig]) -> None:
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
