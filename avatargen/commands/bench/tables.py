"""The bench's numbers as Markdown: medians over the seeds."""

from collections.abc import Callable, Iterable, Sequence
from typing import TypeVar

import numpy as np

from avatargen.commands.bench.compare import Comparison
from avatargen.commands.bench.recipes import RecipeRow, Refusal
from avatargen.commands.bench.sweep import MappingRow, RayRow, SurfaceRow, TextureRow

Row = TypeVar("Row")


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def grouped(rows: Sequence[Row], key: Callable[[Row], object]) -> list[list[Row]]:
    """Rows of one setting together, in the order the settings came."""
    groups: dict[object, list[Row]] = {}
    for row in rows:
        groups.setdefault(key(row), []).append(row)
    return list(groups.values())


def median(rows: Sequence[Row], value: Callable[[Row], float]) -> float:
    return float(np.median([value(row) for row in rows]))


def surface_table(rows: Sequence[SurfaceRow]) -> str:
    """Resolution and faces: cost and error."""
    head = ["resolution", "faces", "s", "extract s", "peak MB", "mesh to field mm: mean", "p99", "max"]
    head += ["field to mesh mm: mean", "p99", "max", "normals °: mean", "p99", "slivers", "closed"]
    lines = []
    for group in grouped(rows, lambda row: (row.resolution, row.faces)):
        numbers = [
            (lambda row: row.total, ".2f"),
            (lambda row: row.seconds["extract"], ".2f"),
            (lambda row: row.peak_mb, ".0f"),
            (lambda row: row.mean_mm, ".3f"),
            (lambda row: row.p99_mm, ".2f"),
            (lambda row: row.max_mm, ".1f"),
            (lambda row: row.back_mean_mm, ".3f"),
            (lambda row: row.back_p99_mm, ".2f"),
            (lambda row: row.back_max_mm, ".1f"),
            (lambda row: row.normal_mean_deg, ".2f"),
            (lambda row: row.normal_p99_deg, ".1f"),
            (lambda row: 100 * row.slivers, ".2f"),
        ]
        cells = [format(median(group, value), style) for value, style in numbers]
        cells[-1] += " %"
        closed = f"{sum(row.closed for row in group)} of {len(group)}"
        lines.append([str(group[0].resolution), f"{group[0].faces:,}", *cells, closed])
    return table(head, lines)


def texture_table(rows: Sequence[TextureRow]) -> str:
    """Texture size: cost, size of the picture and noise."""
    lines = [
        [
            str(group[0].size),
            f"{median(group, lambda row: row.seconds['bake']):.2f}",
            f"{median(group, lambda row: row.seconds['encode']):.2f}",
            f"{median(group, lambda row: row.peak_mb):.0f}",
            f"{median(group, lambda row: row.bytes) / 1e3:.0f}",
            f"{median(group, lambda row: row.psnr_db):.1f}",
        ]
        for group in grouped(rows, lambda row: row.size)
    ]
    return table(["texture", "bake s", "encode s", "peak MB", "kB", "PSNR dB"], lines)


def mapping_table(rows: Sequence[MappingRow]) -> str:
    """Neighbours of the generator's mapping."""
    lines = [
        [
            str(group[0].nearest),
            f"{median(group, lambda row: row.mapping_us):.2f}",
            f"{median(group, lambda row: row.mean_mm):.2f}",
            f"{median(group, lambda row: row.median_mm):.2f}",
            f"{median(group, lambda row: row.p95_mm):.1f}",
            f"{median(group, lambda row: row.stretch_p999):.1f}",
            f"{median(group, lambda row: row.stretch_max):.1f}",
        ]
        for group in grouped(rows, lambda row: row.nearest)
    ]
    return table(
        ["K", "µs a vertex", "posed error mm: mean", "median", "p95", "edges pulled ×: p99.9", "max"], lines
    )


def ray_table(rows: Sequence[RayRow]) -> str:
    """Steps of volume rendering."""
    lines = [
        [
            str(group[0].steps),
            f"{median(group, lambda row: row.seconds):.2f}",
            f"{median(group, lambda row: row.psnr_db):.1f}",
        ]
        for group in grouped(rows, lambda row: row.steps)
    ]
    return table(["steps a ray", "s", "PSNR dB"], lines)


def recipe_table(rows: Sequence[RecipeRow | Refusal]) -> str:
    """Meshers and simplifiers beside each other, ours first; one that refused a seed says so."""
    lines = []
    for group in grouped(rows, lambda row: (row.mesher, row.simplifier)):
        made = [row for row in group if isinstance(row, RecipeRow)]
        cells = ["-"] * 6
        if made:
            cells = [
                f"{median(made, lambda row: row.seconds):.2f}",
                f"{median(made, lambda row: row.peak_mb):.0f}",
                f"{median(made, lambda row: row.mean_mm):.3f}",
                f"{median(made, lambda row: row.p99_mm):.2f}",
                f"{median(made, lambda row: row.max_mm):.1f}",
                ", ".join(str(row.handles) for row in made),
            ]
        defects = [row.defects for row in made if row.defects]
        defects += [row.said for row in group if isinstance(row, Refusal)]
        lines.append([group[0].mesher, group[0].simplifier, *cells, "; ".join(defects) or "none"])
    head = ["mesher", "simplifier", "s", "peak MB", "mesh to field mm: mean", "p99", "max", "handles"]
    return table([*head, "defects"], lines)


def comparison_table(rows: Sequence[Comparison]) -> str:
    """Ours and the peers', with how many times their seconds and errors are ours."""
    ours = rows[0]
    lines = []
    for row in rows:
        numbers = [row.cpu_seconds, row.mean_mm, row.p99_mm, row.max_mm, row.back_mean_mm, row.back_p99_mm]
        own = [ours.cpu_seconds, ours.mean_mm, ours.p99_mm, ours.max_mm, ours.back_mean_mm, ours.back_p99_mm]
        cells = [
            f"{n:.3g}" if row is ours else f"{n:.3g} ({n / max(o, 1e-9):.1f}x)"
            for n, o in zip(numbers, own, strict=True)
        ]
        rest = [f"{row.seconds:.1f}", f"{row.peak_mb:.0f}", row.defects or "none"]
        lines.append([row.name, *cells, *rest])
    head = ["recipe", "processor s", "mesh to field mm: mean", "p99", "max", "field to mesh mm: mean", "p99"]
    return table([*head, "clock s", "peak MB", "defects"], lines)
