"""Settings of a generator of dressed people: what it knows of each garment, each skin and each iris by name,
and how large their networks and tables are."""

import math
from dataclasses import dataclass

import numpy as np

from avatargen.errors import InputError
from avatargen.wardrobe.appearance import rgb_of

MAX_SIZE = 4096
MAX_NODES = 4_000_000
DAMAGED = "is out of range; download the weights anew"


@dataclass(frozen=True, kw_only=True)
class TableConfig:
    """Numbers learned on a part of the body's surface, whose faces are cut into `segments` squared.

    `nodes` counts the places that own numbers, with the first one, which has none.
    """

    segments: int
    numbers: int
    nodes: int
    bits: int = 8  # of each number in a file, or 16

    def __post_init__(self) -> None:
        within = 1 <= self.segments <= 16 and 1 <= self.numbers <= 256 and 1 <= self.nodes <= MAX_NODES
        if not within or self.bits not in (8, 16):
            raise InputError(f"weights: {self} {DAMAGED}")


@dataclass(frozen=True, kw_only=True)
class GarmentConfig:
    """One garment, or one style of hair. `low` and `high` are the corners of the cube it reads points in,
    metres. `middle` is the median of its own colours, CIELAB.
    """

    name: str
    kind: str
    tags: tuple[str, ...]
    features: TableConfig  # what the network reads
    sewn: TableConfig  # way to an edge, and place along and across the cloth, m
    paint: TableConfig  # colours, and how far a dye takes where that is not everywhere
    low: tuple[float, float, float]
    high: tuple[float, float, float]
    middle: tuple[float, float, float]
    width: int = 64
    depth: int = 3  # hidden layers
    frequencies: int = 6  # of the encoded point
    opening: tuple[float, ...] | None = None  # of a hat: a point of the plane of its edge (m), its normal

    def __post_init__(self) -> None:
        sizes = (self.width, self.depth)
        if not all(1 <= size <= MAX_SIZE for size in sizes) or not 0 <= self.frequencies <= 12:
            raise InputError(f"weights: a size of {self.name} {DAMAGED}")
        if not all(map(math.isfinite, (*self.low, *self.high, *self.middle))) or not all(
            a < b for a, b in zip(self.low, self.high, strict=True)
        ):
            raise InputError(f"weights: the box of {self.name} {DAMAGED}")
        if self.opening is not None and not (
            len(self.opening) == 6 and all(map(math.isfinite, self.opening))
        ):
            raise InputError(f"weights: the opening of {self.name} {DAMAGED}")

    @property
    def own_color(self) -> tuple[float, float, float]:
        """The median of its own colours, sRGB 0..1."""
        r, g, b = rgb_of(np.array(self.middle)[None])[0].tolist()
        return (r, g, b)

    @property
    def inputs(self) -> int:
        """Numbers that the network reads at a point."""
        return 3 + self.features.numbers + 3 * (1 + 2 * self.frequencies)


@dataclass(frozen=True, kw_only=True)
class SkinConfig:
    """Skins, brows, lashes and irises by name. `tables` cover the body piece by piece, `drawn` the part of
    the face where brows and lashes are.
    """

    skins: tuple[str, ...]
    brows: tuple[str, ...]
    lashes: tuple[str, ...]
    irises: tuple[str, ...]
    tables: tuple[TableConfig, ...]
    drawn: TableConfig
    iris_side: int  # texels

    def __post_init__(self) -> None:
        if not self.skins or not self.irises or not 1 <= self.iris_side <= MAX_SIZE:
            raise InputError(f"weights: the skin's settings {DAMAGED.replace('is', 'are')}")
        if self.drawn.numbers != max(1, len(self.brows) + len(self.lashes)):
            raise InputError(f"weights: what is drawn on the face {DAMAGED}")


@dataclass(frozen=True, kw_only=True)
class DressedConfig:
    """A generator of dressed people on one body."""

    garments: tuple[GarmentConfig, ...]
    skin: SkinConfig
    body_hash: str
    vertex_count: int
    face_count: int
    cell: float = 0.04  # metres; spacing of the grid that says where each garment may be

    def __post_init__(self) -> None:
        names = [garment.name for garment in self.garments]
        counts = (self.vertex_count, self.face_count)
        if len(set(names)) < len(names):
            raise InputError(f"weights: {names} are not of different names; download the weights anew")
        if not all(1 <= count <= MAX_NODES for count in counts) or not 0.005 <= self.cell <= 0.5:
            raise InputError(f"weights: a count or the grid {DAMAGED}")
