"""Settings of a generator of dressed people: what it knows of each garment, each skin and each iris by name,
and how large their volumes and tables are."""

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
class VolumeConfig:
    """A grid about a garment, in blocks of 4 x 4 x 4 nodes: `blocks` along each axis from `low` (m) on, of
    which `count` are kept; nodes stand `cell` metres apart. `colors` is 1 of hair (a shade of 0..2), 3 of
    cloth, 4 where a dye does not take everywhere.
    """

    low: tuple[float, float, float]
    cell: float
    blocks: tuple[int, int, int]
    count: int
    colors: int

    def __post_init__(self) -> None:
        sound = all(map(math.isfinite, self.low)) and 0.0005 <= self.cell <= 0.1
        sound = sound and all(1 <= blocks <= MAX_SIZE for blocks in self.blocks)
        if not sound or not 1 <= self.count <= math.prod(self.blocks) <= MAX_NODES:
            raise InputError(f"weights: {self} {DAMAGED}")
        if self.colors not in (1, 3, 4):
            raise InputError(f"weights: a volume of {self.colors} colours {DAMAGED}")

    @property
    def brightest(self) -> float:
        """The largest of its colours."""
        return 2.0 if self.colors == 1 else 1.0


@dataclass(frozen=True, kw_only=True)
class GarmentConfig:
    """One garment, or one style of hair. `middle` is the median of its own colours, CIELAB."""

    name: str
    kind: str
    tags: tuple[str, ...]
    volume: VolumeConfig
    places: TableConfig  # along and across the cloth, m
    middle: tuple[float, float, float]
    opening: tuple[float, ...] | None = None  # of a hat: a point of the plane of its edge (m), its normal

    def __post_init__(self) -> None:
        if not all(map(math.isfinite, self.middle)):
            raise InputError(f"weights: the colours of {self.name} {DAMAGED.replace('is', 'are')}")
        if self.opening is not None and not (
            len(self.opening) == 6 and all(map(math.isfinite, self.opening))
        ):
            raise InputError(f"weights: the opening of {self.name} {DAMAGED}")

    @property
    def own_color(self) -> tuple[float, float, float]:
        """The median of its own colours, sRGB 0..1."""
        r, g, b = rgb_of(np.array(self.middle)[None])[0].tolist()
        return (r, g, b)


@dataclass(frozen=True, kw_only=True)
class SkinConfig:
    """Skins and irises by name. `tables` cover the body piece by piece."""

    skins: tuple[str, ...]
    irises: tuple[str, ...]
    tables: tuple[TableConfig, ...]
    iris_side: int  # texels

    def __post_init__(self) -> None:
        if not self.skins or not self.irises or not 1 <= self.iris_side <= MAX_SIZE:
            raise InputError(f"weights: the skin's settings {DAMAGED.replace('is', 'are')}")


@dataclass(frozen=True, kw_only=True)
class DressedConfig:
    """A generator of dressed people on one body."""

    garments: tuple[GarmentConfig, ...]
    skin: SkinConfig
    body_hash: str
    vertex_count: int
    face_count: int

    def __post_init__(self) -> None:
        names = [garment.name for garment in self.garments]
        counts = (self.vertex_count, self.face_count)
        if len(set(names)) < len(names):
            raise InputError(f"weights: {names} are not of different names; download the weights anew")
        if not all(1 <= count <= MAX_NODES for count in counts):
            raise InputError(f"weights: a count {DAMAGED}")
