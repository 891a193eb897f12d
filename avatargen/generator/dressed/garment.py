"""A trained garment as a layer that one person wears, dyed and printed.

Letters: N points, M of them asked, V body vertices, F its faces. Metres.
"""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float32, Float64, Int64, UInt8

from avatargen.body.distance import BodyHit
from avatargen.compiled import compiled
from avatargen.generator.decoder import DISTANCE_SCALES
from avatargen.generator.dressed.config import GarmentConfig
from avatargen.generator.dressed.generator import GRID_LOW, LearnedGarment
from avatargen.generator.dressed.network import GarmentNetwork, signed_distance
from avatargen.generator.dressed.tables import Surface, fade_out
from avatargen.generator.gathering import fill_place
from avatargen.wardrobe.appearance import Appearance
from avatargen.wardrobe.dressed import Cloth, Opening, chosen

GRID_SLACK = 0.48  # of the grid's spacing, by which a garment may be nearer than it says between its nodes
PAINTED = 0.02  # m from a garment beyond which it has no colour


@dataclass(frozen=True, kw_only=True, eq=False)
class ReadyGarment:
    """What all who wear a garment share, ready to be asked."""

    config: GarmentConfig
    network: GarmentNetwork
    features: Surface
    sewn: Surface
    paint: Surface
    faces: Int64[np.ndarray, "F 3"]
    inverse_reach: Float64[np.ndarray, " V"]
    hidden: Bool[np.ndarray, " V"]
    away: UInt8[np.ndarray, "X Y Z"]
    cell: float

    @torch.inference_mode()
    def raw(self, points: Float32[np.ndarray, "M 3"], hit: BodyHit) -> torch.Tensor:
        """The network's outputs."""
        config = self.config
        inputs = np.empty((len(points), config.inputs), np.float32)
        inputs[:, 0] = 10 * hit.distance
        for column, scale in enumerate(DISTANCE_SCALES, 1):
            inputs[:, column] = np.tanh(hit.distance / scale)
        faded = np.empty(len(points), np.float32)
        fade_out(hit.distance, self.faces, hit.face, hit.barycentric, self.inverse_reach, faded)
        column = 1 + len(DISTANCE_SCALES)
        self.features.fill(hit, faded, inputs, column)
        low, high = (np.array(corner) for corner in (config.low, config.high))
        angle = np.pi * (2 * (points - low) / (high - low) - 1)
        column += config.features.numbers
        fill_place(angle, np.sin(angle), np.cos(angle), np.arange(len(points)), inputs, column)
        return self.network(torch.from_numpy(inputs))

    def least(self, points: Float32[np.ndarray, "N 3"]) -> Float32[np.ndarray, " N"]:
        """Metres that the garment is away from each point at least."""
        found = np.empty(len(points), np.float32)
        place = (points.astype(np.float64) - np.array(GRID_LOW)) / self.cell
        bound(place, self.away, GRID_SLACK * self.cell, found)
        return found


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
        return self.ready.least(points)

    def cloth(self, points: Float32[np.ndarray, "M 3"], hit: BodyHit, *, coloured: bool) -> Cloth:
        ready = self.ready
        raw = ready.raw(points, hit)
        distance = signed_distance(raw, torch.from_numpy(hit.distance)).numpy()
        least = ready.least(points)
        distance = np.where(least > 0, np.maximum(distance, least), distance)  # far off, networks guess
        sewn = ready.sewn.at(hit)
        colour = np.full((len(points), 3), 0.5, np.float32)
        near = np.flatnonzero(distance < PAINTED) if coloured else np.zeros(0, np.int64)
        if len(near):
            colour[near] = self.appearance.color(ready.paint.at(chosen(hit, near)), sewn[near])
        return Cloth(distance=distance, rim=sewn[:, 0], color=colour)


def ready_garment(
    learned: LearnedGarment,
    faces: Int64[np.ndarray, "F 3"],
    inverse_reach: Float64[np.ndarray, " V"],
    cell: float,
) -> ReadyGarment:
    """The arrays of a trained garment."""
    covered = learned.covered.numpy().astype(bool)
    return ReadyGarment(
        config=learned.network.config,
        network=learned.network,
        features=learned.features.read(faces, covered),
        sewn=learned.sewn.read(faces, covered),
        paint=learned.paint.read(faces, covered),
        faces=faces,
        inverse_reach=inverse_reach,
        hidden=learned.hidden.numpy().astype(bool),
        away=learned.away.numpy(),
        cell=cell,
    )


@compiled
def bound(place, away, slack, found):
    """Fill in how far (metres) a garment is at least, by the grid, less `slack`.

    `place` [N 3] in the grid's cells; `away` [X Y Z] millimetres.
    """
    for i in range(len(place)):
        x = min(max(place[i, 0], 0.0), away.shape[0] - 1.001)
        y = min(max(place[i, 1], 0.0), away.shape[1] - 1.001)
        z = min(max(place[i, 2], 0.0), away.shape[2] - 1.001)
        p, q, r = int(x), int(y), int(z)
        x, y, z = x - p, y - q, z - r
        total = 0.0
        for a in range(2):
            for b in range(2):
                for c in range(2):
                    share = (x if a else 1 - x) * (y if b else 1 - y) * (z if c else 1 - z)
                    total += share * away[p + a, q + b, r + c]
        found[i] = max(total / 1000 - slack, 0.0)
