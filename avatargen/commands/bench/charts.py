"""Charts along the seams of clothes beside those that xatlas cuts where other joints move the surface."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from assets.build_config import BuildConfig
from assets.charting import cut_at_joints, cut_charts
from assets.texture.pattern import find_pattern, texel_scale
from assets.texture.stretch import measure_atlas
from avatargen.avatar import Avatar
from avatargen.commands.bench.cost import measured
from avatargen.commands.bench.sweep import default_surface
from avatargen.commands.bench.tables import table

WAYS = {"seams of clothes": cut_charts, "xatlas alone": cut_at_joints}


@dataclass(frozen=True, kw_only=True)
class ChartRow:
    """One atlas of one person."""

    seed: int
    way: str
    seconds: float  # the processor's, from a mesh to its texture coordinates
    islands: int
    used: float  # share of the texture
    stretch: float  # Sander's, 1 for none
    shear_p99: float
    unguided: str  # why seams are not those of clothes, where they were to be


def measure_charts(avatar: Avatar, config: BuildConfig) -> Iterator[ChartRow]:
    """Both ways on the person's mesh."""
    assert config.faces is not None, "charts are of so many faces"
    surface = default_surface(avatar, config.resolution, config.faces)
    detail = find_pattern(surface, avatar.body).detail
    for way, cut in WAYS.items():
        finest = detail if cut is cut_charts else np.minimum(detail, 1)  # xatlas knows heads, not faces
        density = texel_scale(finest, config.head_detail)
        with measured() as cost:
            atlas = cut(surface, avatar.body, config)
        found = measure_atlas(surface, atlas, density)
        yield ChartRow(
            seed=avatar.seed, way=way, seconds=cost.cpu_seconds, unguided=atlas.unguided, **vars(found)
        )


def chart_page(rows: Sequence[ChartRow]) -> str:
    """Every atlas, and their medians and extremes, as Markdown."""
    head = ["seed", "charts", "s", "islands", "used %", "stretch", "shear p99"]
    lines = [
        [
            str(row.seed),
            row.way + (" (not those of clothes)" if row.unguided else ""),
            f"{row.seconds:.2f}",
            str(row.islands),
            f"{100 * row.used:.1f}",
            f"{row.stretch:.3f}",
            f"{row.shear_p99:.2f}",
        ]
        for row in rows
    ]
    middle = [["median", way, *(f"{value:.3g}" for value in medians(rows, way))] for way in WAYS]
    parts = [
        "# Charts",
        "Made by `avatargen bench --charts`. Processor seconds from a mesh to its texture coordinates; "
        "stretch is Sander's, 1 for none; shear is how oval a round brush becomes, on all but a hundredth of "
        "the surface.",
        table(head, middle),
        table(head, lines),
    ]
    return "\n\n".join(parts) + "\n"


def medians(rows: Sequence[ChartRow], way: str) -> list[float]:
    """Of one way's numbers, in the order of the table."""
    mine = [row for row in rows if row.way == way]
    columns = [(row.seconds, row.islands, 100 * row.used, row.stretch, row.shear_p99) for row in mine]
    return np.median(columns, axis=0).tolist()
