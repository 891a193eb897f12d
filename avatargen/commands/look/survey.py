"""avatargen survey: many seeds in one process, a table of errors and sheets of pictures."""

import json
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
import tyro

from avatargen.commands.line import parse_options, run_command

if TYPE_CHECKING:
    from assets import Asset

PROGRAM = "avatargen survey"
COLUMNS = 4  # people side by side on the sheet


@dataclass(frozen=True, kw_only=True)
class Options:
    """Build many seeds and say how well each came out."""

    out: Path
    """Folder for survey.json, sheet.png, faces.png and the GLB files."""
    first: int = 0
    """First seed."""
    count: int = 20
    """How many seeds."""
    weights: Path | None = None
    """Other weights than those that come with the package."""
    source: Annotated[Literal["generator", "wardrobe"], tyro.conf.arg(name="from")] = "generator"
    """Whose people: the generator's, or the wardrobe's, which it learns from."""
    wardrobe: Path | None = None
    """With --from wardrobe: a folder of MakeHuman's assets to wear."""
    height: int = 384
    """Pixels of each picture."""
    files: bool = True
    """Keep the GLB files."""


@dataclass(frozen=True, kw_only=True)
class Row:
    """One seed's outcome; errors in millimetres, mesh to field."""

    seed: int
    faces: int
    closed: bool
    mean_mm: float
    p99_mm: float
    max_mm: float
    bytes: int
    seconds: float


def main(arguments: Sequence[str] | None = None) -> int:
    return run_command(PROGRAM, lambda: run(parse_options(PROGRAM, Options, arguments)))


def run(options: Options) -> None:
    """Every seed through the default pipeline; prints a line a seed and the worst of each column.

    Raises:
        GeometryError: some seeds could not be built; the others are written all the same.
    """
    from assets import build
    from assets.errors import GeometryError
    from assets.picture.preview import PreviewConfig, render
    from avatargen.atomic import write_atomically
    from avatargen.export.people import open_people
    from avatargen.export.request import ExportRequest
    from avatargen.ranges import require_ranges
    from exporters.glb import encode

    require_ranges(options, "survey", {"first": (0, 2**62), "count": (1, 10**6), "height": (32, 4096)})
    request = ExportRequest(
        seeds=options.first, source=options.source, wardrobe=options.wardrobe, weights=options.weights
    )
    people = open_people(request)
    options.out.mkdir(parents=True, exist_ok=True)
    rows, figures, faces, failed = [], [], [], []
    for seed in range(options.first, options.first + options.count):
        started = time.perf_counter()
        try:
            asset = build(people.sample(seed))
        except GeometryError as error:
            print(f"seed {seed}: {error}", flush=True)
            failed.append(seed)
            continue
        data = encode(asset)
        rows.append(outcome(seed, asset, len(data), time.perf_counter() - started))
        print(rows[-1], flush=True)
        if options.files:
            write_atomically(options.out / f"avatar_{seed}.glb", data)
        figures.append(render(asset, PreviewConfig(height=options.height, views=("front", "back"))))
        faces.append(render(asset, PreviewConfig(height=options.height, views=("face",))))
    if rows:
        write_outcome(options.out, rows, figures, faces)
    if failed:
        raise GeometryError(
            f"survey: seeds {failed} of {options.count} could not be built; see the lines above"
        )


def write_outcome(out: Path, rows: list[Row], figures: list[np.ndarray], faces: list[np.ndarray]) -> None:
    """The table and the sheets; prints the summary."""
    from assets.picture.sheet import contact_sheet
    from avatargen.atomic import write_atomically
    from exporters.png import encode_png

    write_atomically(out / "survey.json", json.dumps(summary(rows), indent=1).encode() + b"\n")
    write_atomically(out / "sheet.png", encode_png(contact_sheet(figures, COLUMNS)))
    write_atomically(out / "faces.png", encode_png(contact_sheet(faces, COLUMNS)))
    print({name: value for name, value in summary(rows).items() if name != "rows"})


def outcome(seed: int, asset: "Asset", size: int, seconds: float) -> Row:
    """A row from an asset and its own report."""
    from assets.mesh.surface import Surface, find_defects

    assert asset.report is not None  # only assets that were not built have neither
    assert asset.welded is not None
    vertices = np.zeros((asset.welded.max() + 1, 3))
    vertices[asset.welded] = asset.vertices
    error = asset.report.error
    return Row(
        seed=seed,
        faces=len(asset.faces),
        closed=not find_defects(Surface(vertices=vertices, faces=asset.welded[asset.faces])),
        mean_mm=error.mean_mm,
        p99_mm=error.p99_mm,
        max_mm=error.max_mm,
        bytes=size,
        seconds=seconds,
    )


def summary(rows: list[Row]) -> dict[str, object]:
    """Means and worst cases over the seeds, and the rows."""
    return {
        "seeds": len(rows),
        "closed": sum(row.closed for row in rows),
        "mean_mm": float(np.mean([row.mean_mm for row in rows])),
        "worst_mean_mm": max(row.mean_mm for row in rows),
        "worst_p99_mm": max(row.p99_mm for row in rows),
        "worst_max_mm": max(row.max_mm for row in rows),
        "median_seconds": float(np.median([row.seconds for row in rows])),
        "rows": [asdict(row) for row in rows],
    }
