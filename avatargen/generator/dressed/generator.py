"""The generator of dressed people: a network and tables for each garment, tables for the skin, and where each
garment can be.

    z --choices--> skins, irises, garments, colours   of one person
    points --bounds--> the garments that can be near them --> distance and colour, laid one over another

Letters: V body vertices, F faces. Metres.
"""

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor, nn

from avatargen.generator.dressed.config import DressedConfig, GarmentConfig, SkinConfig
from avatargen.generator.dressed.network import GarmentNetwork
from avatargen.generator.dressed.tables import Table

GRID_LOW, GRID_HIGH = (-1.10, -1.25, -0.425), (1.10, 1.05, 0.475)
FARTHEST_MM = 250  # what the grid says of all that is farther


def grid_shape(cell: float) -> tuple[int, int, int]:
    """Nodes of the grid along each axis."""
    x, y, z = (round((high - low) / cell) + 1 for low, high in zip(GRID_LOW, GRID_HIGH, strict=True))
    return (x, y, z)


def grid_points(cell: float) -> Float[np.ndarray, "N 3"]:
    """The grid's nodes, metres, the last axis fastest."""
    axes = [low + cell * np.arange(n) for low, n in zip(GRID_LOW, grid_shape(cell), strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3).astype(np.float32)


class LearnedGarment(nn.Module):
    """A garment's network, its tables and the faces that they cover, the body's vertices that it hides, and
    where it can be: whole millimetres on the grid."""

    covered: Tensor
    hidden: Tensor
    away: Tensor

    def __init__(self, config: GarmentConfig, whole: DressedConfig) -> None:
        super().__init__()
        self.network = GarmentNetwork(config)
        self.features = Table(config.features)
        self.sewn = Table(config.sewn)
        self.paint = Table(config.paint)
        self.register_buffer("covered", torch.zeros(whole.face_count, dtype=torch.uint8))
        self.register_buffer("hidden", torch.zeros(whole.vertex_count, dtype=torch.uint8))
        self.register_buffer("away", torch.zeros(grid_shape(whole.cell), dtype=torch.uint8))


class LearnedSkin(nn.Module):
    """Skins as mixtures of the same few patterns, on tables over pieces of the body; brows and lashes as they
    cover the face; irises seen from the front.

    `mixing` [skins, numbers, 3] turns a node's numbers into a skin's colour.
    """

    covered: Tensor
    mixing: Tensor
    middle: Tensor
    irises: Tensor

    def __init__(self, config: SkinConfig, whole: DressedConfig) -> None:
        super().__init__()
        self.tables = nn.ModuleList(Table(table) for table in config.tables)
        self.drawn = Table(config.drawn)
        count = len(config.tables) + 1  # the last are the faces that `drawn` covers
        self.register_buffer("covered", torch.zeros(count, whole.face_count, dtype=torch.uint8))
        numbers = config.tables[0].numbers
        self.register_buffer("mixing", torch.zeros(len(config.skins), numbers, 3))
        self.register_buffer("middle", torch.zeros(len(config.skins), 3))
        side = config.iris_side
        self.register_buffer("irises", torch.zeros(len(config.irises), side, side, 3, dtype=torch.uint8))


class DressedGenerator(nn.Module):
    """All garments and skins on one body. `inverse_reach` (1/m) says how fast features fade off each
    vertex."""

    inverse_reach: Tensor

    def __init__(self, config: DressedConfig) -> None:
        super().__init__()
        self.config = config
        self.register_buffer("inverse_reach", torch.zeros(config.vertex_count))
        self.garments = nn.ModuleDict({each.name: LearnedGarment(each, config) for each in config.garments})
        self.skin = LearnedSkin(config.skin, config)

    def garment(self, name: str) -> LearnedGarment:
        """One of the garments."""
        garment = self.garments[name]
        assert isinstance(garment, LearnedGarment)
        return garment
