"""The bench as a picture: error against run time with its Pareto front, against file size, and the textures'
noise."""

import io
from collections.abc import Sequence
from typing import Any

from avatargen.commands.bench.compare import Comparison
from avatargen.commands.bench.recipes import RecipeRow, Refusal
from avatargen.commands.bench.sweep import MappingRow, RayRow, SurfaceRow, TextureRow
from avatargen.commands.bench.tables import grouped, median


def front(points: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Of points (cost, error), those that no other beats in both, by rising cost."""
    kept: list[tuple[float, float]] = []
    for cost, error in sorted(points):
        if not kept or error < kept[-1][1]:
            kept.append((cost, error))
    return kept


def draw(
    surfaces: Sequence[SurfaceRow],
    textures: Sequence[TextureRow],
    mapping: Sequence[MappingRow],
    rays: Sequence[RayRow],
    comparison: Sequence[Comparison],
    recipes: Sequence[RecipeRow | Refusal],
) -> bytes:
    """A PNG of four panels."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13, 9.5), layout="constrained")
    axes = figure.subplots(2, 2)
    draw_surfaces(axes[0, 0], surfaces, comparison, [row for row in recipes if isinstance(row, RecipeRow)])
    draw_normals(axes[0, 1], surfaces)
    draw_textures(axes[1, 0], textures)
    draw_steps(axes[1, 1], mapping, rays)
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=110)
    return stream.getvalue()


def draw_surfaces(
    axes: Any, rows: Sequence[SurfaceRow], comparison: Sequence[Comparison], recipes: Sequence[RecipeRow]
) -> None:
    """99th percentile of the surface error against seconds."""
    points = []
    for group in grouped(rows, lambda row: row.resolution):
        line = [
            (median(same, lambda row: row.total), median(same, lambda row: row.p99_mm))
            for same in grouped(group, lambda row: row.faces)
        ]
        points += line
        axes.plot(*zip(*line, strict=True), "o", ms=5, label=f"resolution {group[0].resolution}")
    axes.plot(*zip(*front(points), strict=True), "-", color="0.4", lw=1, zorder=0, label="Pareto front")
    for row in comparison:
        axes.plot(row.cpu_seconds, row.p99_mm, "*" if row is comparison[0] else "X", ms=11, label=row.name)
    for group in grouped(recipes, lambda row: (row.mesher, row.simplifier)):
        place = median(group, lambda row: row.seconds), median(group, lambda row: row.p99_mm)
        axes.plot(*place, "P", ms=8, label=f"{group[0].mesher}, {group[0].simplifier}")
    axes.set(
        xscale="log",
        yscale="log",
        xlabel="processor seconds to mesh and charts (stars, crosses: to the file)",
    )
    axes.set(ylabel="mesh to field, 99th percentile, mm", title="Surface error against run time")
    axes.legend(fontsize=7, loc="upper left", ncols=1, bbox_to_anchor=(1.0, 1.0))  # beside, over no mark
    rule(axes, axes.xaxis, axes.yaxis)


def draw_normals(axes: Any, rows: Sequence[SurfaceRow]) -> None:
    """Mean error of the shading normals, and of the surface both ways, against faces."""
    finest = max(row.resolution for row in rows)
    groups = grouped([row for row in rows if row.resolution == finest], lambda row: row.faces)
    faces = [group[0].faces for group in groups]
    axes.plot(faces, [median(g, lambda row: row.mean_mm) for g in groups], "o-", label="mesh to field, mm")
    back = [median(g, lambda row: row.back_mean_mm) for g in groups]
    axes.plot(faces, back, "s-", label="field to mesh, mm")
    normal = [median(g, lambda row: row.normal_mean_deg) for g in groups]
    axes.plot(faces, normal, "^-", label="shading normals, degrees")
    axes.set(xscale="log", yscale="log", xlabel="faces", title=f"Mean errors at resolution {finest}")
    axes.legend(fontsize=8)
    rule(axes, axes.xaxis, axes.yaxis)


def draw_textures(axes: Any, rows: Sequence[TextureRow]) -> None:
    """Noise of the texture against its bytes."""
    groups = grouped(rows, lambda row: row.size)
    size = [median(group, lambda row: row.bytes) / 1e6 for group in groups]
    noise = [median(group, lambda row: row.psnr_db) for group in groups]
    axes.plot(size, noise, "o-")
    for group, x, y in zip(groups, size, noise, strict=True):
        seconds = median(group, lambda row: sum(row.seconds.values()))
        label(axes, f"{group[0].size}, {seconds:.1f} s", x, y)
    axes.set(xscale="log", xlabel="MB of the picture", ylabel="PSNR, dB", title="Texture against the field")
    rule(axes, axes.xaxis)


def draw_steps(axes: Any, mapping: Sequence[MappingRow], rays: Sequence[RayRow]) -> None:
    """Noise of volume rendering against its seconds; the mapping's neighbours in a corner."""
    groups = grouped(rays, lambda row: row.steps)
    seconds = [median(group, lambda row: row.seconds) for group in groups]
    noise = [median(group, lambda row: row.psnr_db) for group in groups]
    axes.plot(seconds, noise, "o-")
    for group, x, y in zip(groups, seconds, noise, strict=True):
        label(axes, f"{group[0].steps} steps", x, y)
    found = grouped(mapping, lambda row: row.nearest)
    lines = [f"K = {g[0].nearest}: {median(g, lambda row: row.median_mm):.2f}" for g in found]
    text = "\n".join(["median posed error, mm", *lines])
    axes.text(0.98, 0.04, text, transform=axes.transAxes, ha="right", fontsize=8)
    axes.set(xscale="log", xlabel="seconds a picture", ylabel="PSNR, dB", title="Steps a ray")
    rule(axes, axes.xaxis)


def rule(axes: Any, *logarithmic: Any) -> None:
    """A grid, with plain numbers at 1, 2 and 5 along logarithmic axes and room at the ends."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axes.margins(0.1)
    for axis in logarithmic:
        axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axis.set_major_formatter(FuncFormatter(lambda number, _: f"{number:,.10g}"))
        axis.set_minor_formatter(NullFormatter())
    axes.grid(which="both", alpha=0.25)


def label(axes: Any, text: str, x: float, y: float) -> None:
    """A word above a point."""
    axes.annotate(text, (x, y), ha="center", xytext=(0, 7), textcoords="offset points", fontsize=8)
