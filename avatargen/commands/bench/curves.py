"""What the bench measured, as one small file that `avatar-export --tolerance` and `--budget` read."""

import json
from collections.abc import Sequence

import torch

from assets.choose import SPEED_POINTS, speed_points
from assets.field import ask
from avatargen.avatar import Avatar
from avatargen.commands.bench.cost import measured
from avatargen.commands.bench.sweep import SurfaceRow, TextureRow
from avatargen.commands.bench.tables import grouped, median

ROUNDS = 3


def curves(
    avatar: Avatar, surfaces: Sequence[SurfaceRow], textures: Sequence[TextureRow], weights_hash: str
) -> bytes:
    """Medians over the seeds as JSON; `field_us` says how fast the machine was."""
    rows = [
        {
            "resolution": group[0].resolution,
            "faces": group[0].faces,
            "seconds": {
                stage: round(median(group, lambda row, s=stage: row.seconds[s]), 4)
                for stage in group[0].seconds
            },
            "mean_mm": round(median(group, lambda row: row.mean_mm), 4),
            "p99_mm": round(median(group, lambda row: row.p99_mm), 4),
        }
        for group in grouped(surfaces, lambda row: (row.resolution, row.faces))
    ]
    pictures = [
        {
            "size": group[0].size,
            "seconds": {
                stage: round(median(group, lambda row, s=stage: row.seconds[s]), 4)
                for stage in group[0].seconds
            },
            "bytes": int(median(group, lambda row: row.bytes)),
        }
        for group in grouped(textures, lambda row: row.size)
    ]
    seeds = sorted({row.seed for row in surfaces})
    whole = {
        "weights_hash": weights_hash,
        "seeds": seeds,
        "threads": torch.get_num_threads(),
        "field_us": field_microseconds(avatar),
        "surfaces": rows,
        "textures": pictures,
    }
    return json.dumps(whole, indent=1).encode() + b"\n"


def field_microseconds(avatar: Avatar) -> float:
    """Microseconds a point of the field takes here, the best of a few rounds."""
    points = speed_points(avatar.body.vertices)
    best = float("inf")
    for _ in range(ROUNDS):
        with measured() as cost:
            ask(avatar.sdf, points)
        best = min(best, cost.cpu_seconds)
    return round(1e6 * best / SPEED_POINTS, 3)
