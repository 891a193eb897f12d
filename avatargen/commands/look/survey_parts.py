"""People in parts, surveyed: whether each part is closed and manifold, and how far parts come through one
another as the person moves."""

import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from avatargen.errors import InputError

if TYPE_CHECKING:
    from assets import Asset
    from assets.build_config import AvatarFields

POSES = ("a", "step", "run", "sit", "arms up")  # of the bench's table
AIM = 1.0  # mm that parts may come through at the 99th percentile
HAIR = "hair"  # covers nothing


@dataclass(frozen=True, kw_only=True)
class PartsRow:
    """One seed's outcome. `open` are the parts with a hole, an edge of three faces or an inside out;
    `through` is by pose and by part beneath another the 99th percentile of how far it comes out, mm."""

    seed: int
    faces: Mapping[str, int]
    open: tuple[str, ...]
    mean_mm: float
    p99_mm: float
    through: Mapping[str, Mapping[str, float]]
    bytes: int
    seconds: float

    def __str__(self) -> str:
        worst = ", ".join(
            f"{pose} {max(found.values(), default=0.0):.1f}" for pose, found in self.through.items()
        )
        state = f"open: {', '.join(self.open)}" if self.open else "all closed"
        return f"seed {self.seed}: {', '.join(self.faces)}; {state}; comes through, mm: {worst}"


def in_parts(avatar: "AvatarFields") -> tuple["Asset", bytes, PartsRow]:
    """A person in parts, the file of them, and how they came out.

    Raises:
        InputError: the person is one field.
    """
    from assets.asset.asset import apart
    from assets.mesh.surface import count_pieces, find_defects
    from assets.poke import poke_through, surface_of
    from assets.separate import LayeredFields, build_parts
    from avatargen.commands.bench.poses import rotations
    from exporters.glb import encode

    if not isinstance(avatar, LayeredFields):
        raise InputError("survey: the wardrobe's own people are one field; leave --parts separate out")
    started = time.perf_counter()
    asset = build_parts(avatar)
    data, seconds = encode(asset), time.perf_counter() - started
    assert asset.report is not None  # only assets that were not built have none
    parts = dict(apart(asset))
    surfaces = {name: surface_of(part) for name, part in parts.items()}
    covers = {name: layer.cover for name, layer in avatar.layers.items() if name != HAIR}
    names = asset.skeleton.joint_names
    through = {pose: poke_through(asset, covers, rotations(pose, names)) for pose in POSES}
    row = PartsRow(
        seed=avatar.info.seed,
        faces={name: len(part.faces) for name, part in parts.items()},
        open=tuple(n for n, each in surfaces.items() if find_defects(each, pieces=count_pieces(each))),
        mean_mm=asset.report.error.mean_mm,
        p99_mm=asset.report.error.p99_mm,
        through={pose: {part: e.p99_mm for part, e in found.items()} for pose, found in through.items()},
        bytes=len(data),
        seconds=seconds,
    )
    return asset, data, row


def summary_in_parts(rows: list[PartsRow]) -> dict[str, object]:
    """How many parts there are, and are closed; and by pose of the parts beneath others how many come through
    by more than the aim, and the worst, mm."""
    return {
        "seeds": len(rows),
        "parts": sum(len(row.faces) for row in rows),
        "closed": sum(len(row.faces) - len(row.open) for row in rows),
        "mean_mm": float(np.mean([row.mean_mm for row in rows])),
        "through": {pose: of_pose([row.through[pose] for row in rows]) for pose in POSES},
        "median_seconds": float(np.median([row.seconds for row in rows])),
    }


def of_pose(found: list[Mapping[str, float]]) -> dict[str, int | float]:
    """Over everybody's parts in one pose."""
    depths = [depth for of_one in found for depth in of_one.values()]
    return {
        "parts": len(depths),
        f"over_{AIM:g}_mm": sum(depth > AIM for depth in depths),
        "worst_p99_mm": max(depths, default=0.0),
    }
