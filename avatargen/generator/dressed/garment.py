"""A trained garment as a layer that one person wears, dyed and printed.

Letters: N points, M of them asked, V body vertices, F its faces. Metres.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float32, Int64

from avatargen.body.distance import BodyHit
from avatargen.generator.dressed.config import GarmentConfig
from avatargen.generator.dressed.generator import LearnedGarment
from avatargen.generator.dressed.tables import Surface
from avatargen.generator.dressed.volume import Bricks
from avatargen.wardrobe.appearance import Appearance
from avatargen.wardrobe.dressed import Cloth, Opening, chosen

PAINTED = 0.02  # m from a garment beyond which it has no colour


@dataclass(frozen=True, kw_only=True, eq=False)
class ReadyGarment:
    """What all who wear a garment share, ready to be asked."""

    config: GarmentConfig
    volume: Bricks
    places: Surface
    hidden: Bool[np.ndarray, " V"]


@dataclass(frozen=True, kw_only=True, eq=False)
class WornGarment:
    """A garment as one person has it."""

    ready: ReadyGarment
    appearance: Appearance

    @property
    def kind(self) -> str:
        return self.ready.config.kind

    @property
    def hidden(self) -> Bool[np.ndarray, " V"]:
        return self.ready.hidden

    @property
    def opening(self) -> Opening | None:
        plane = self.ready.config.opening
        return None if plane is None else Opening(at=np.array(plane[:3]), up=np.array(plane[3:]))

    def least(self, points: Float32[np.ndarray, "N 3"]) -> Float32[np.ndarray, " N"]:
        return self.ready.volume.least(points)

    def cloth(self, points: Float32[np.ndarray, "M 3"], hit: BodyHit, *, coloured: bool) -> Cloth:
        volume = self.ready.volume
        distance, rim = volume.read(points)
        colour = np.full((len(points), 3), 0.5, np.float32)
        near = np.flatnonzero(distance < PAINTED) if coloured else np.zeros(0, np.int64)
        if len(near):
            places = self.ready.places.at(chosen(hit, near))
            colour[near] = self.appearance.color(volume.colors(points[near]), places)
        return Cloth(distance=distance, rim=rim, color=colour)


@dataclass(frozen=True, kw_only=True, eq=False)
class LearnedHair:
    """A trained style of hair."""

    ready: ReadyGarment

    def least(self, points: Float32[np.ndarray, "N 3"]) -> Float32[np.ndarray, " N"]:
        return self.ready.volume.least(points)

    def distance(self, points: Float32[np.ndarray, "N 3"]) -> Float32[np.ndarray, " N"]:
        return self.ready.volume.read(points)[0]

    def shade(self, points: Float32[np.ndarray, "N 3"]) -> Float32[np.ndarray, " N"]:
        return self.ready.volume.colors(points)[:, 0]


def ready_garment(learned: LearnedGarment, faces: Int64[np.ndarray, "F 3"]) -> ReadyGarment:
    """The arrays of a trained garment."""
    return ReadyGarment(
        config=learned.config,
        volume=learned.volume.read(),
        places=learned.places.read(faces, learned.covered.numpy().astype(bool)),
        hidden=learned.hidden.numpy().astype(bool),
    )
