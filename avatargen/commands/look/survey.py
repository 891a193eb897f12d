"""avatargen survey: many seeds in one process, a table of errors and sheets of pictures."""

import json
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
import tyro

from avatargen.commands.line import parse_options, run_command
from avatargen.errors import InputError

if TYPE_CHECKING:
    from assets import Asset
    from assets.build_config import AvatarFields

PROGRAM = "avatargen survey"
COLUMNS = 4  # people side by side on the sheet


@dataclass(frozen=True, kw_only=True)
class Options:
    """Build many seeds and say how well each came out."""

    out: Path
    """Folder for survey.json, sheet.png, faces.png, the GLB files and a picture beside each."""
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
    """Pixels of each picture; 0 leaves the sheets out."""
    files: bool = True
    """Keep the GLB files and the pictures beside them."""
    parts: Literal["merged", "separate"] = "merged"
    """One closed surface, or as --parts separate exports: every part by itself, and how far they come through
    one another in five poses."""


@dataclass(frozen=True, kw_only=True)
class Row:
    """One seed's outcome; errors in millimetres, mesh to field. `handles` are the surface's holes to see
    through, as between an arm and a hip that touch: 0 is a sphere's."""

    seed: int
    faces: int
    closed: bool
    handles: int
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
        InputError: people who are one field are to be built in parts.
    """
    from assets.errors import GeometryError
    from assets.picture.preview import PreviewConfig, render
    from avatargen.atomic import write_atomically
    from avatargen.commands.look.survey_parts import in_parts, summary_in_parts
    from avatargen.export.people import open_people
    from avatargen.export.request import ExportRequest
    from avatargen.ranges import require_ranges
    from exporters.png import encode_png

    require_ranges(options, "survey", {"first": (0, 2**62), "count": (1, 10**6)})
    if not (options.height == 0 or 32 <= options.height <= 4096):
        raise InputError(f"survey: found height {options.height}, wanted 0 or 32 to 4096")
    request = ExportRequest(
        seeds=options.first, source=options.source, wardrobe=options.wardrobe, weights=options.weights
    )
    people = open_people(request)
    options.out.mkdir(parents=True, exist_ok=True)
    made, summed = (whole, summary) if options.parts == "merged" else (in_parts, summary_in_parts)
    rows, figures, faces, failed = [], [], [], []
    for seed in range(options.first, options.first + options.count):
        try:
            asset, data, row = made(people.sample(seed))
        except GeometryError as error:
            print(f"seed {seed}: {error}", flush=True)
            failed.append(seed)
            continue
        rows.append(row)
        print(row, flush=True)
        if options.files:
            write_atomically(options.out / f"avatar_{seed}.glb", data)
        if options.height:
            figures.append(render(asset, PreviewConfig(height=options.height, views=("front", "back"))))
            faces.append(render(asset, PreviewConfig(height=options.height, views=("face",))))
        if options.files and options.height:
            picture = encode_png(np.concatenate([figures[-1], faces[-1]], axis=1))
            write_atomically(options.out / f"avatar_{seed}.png", picture)
    if rows:
        write_outcome(options.out, summed(rows), [asdict(row) for row in rows], figures, faces)
    if failed:
        raise GeometryError(
            f"survey: seeds {failed} of {options.count} could not be built; see the lines above"
        )


def write_outcome(
    out: Path,
    found: dict[str, object],
    rows: list[dict[str, Any]],
    figures: list[np.ndarray],
    faces: list[np.ndarray],
) -> None:
    """The table, and the sheets of what pictures there are; prints the summary."""
    from assets.picture.sheet import contact_sheet
    from avatargen.atomic import write_atomically
    from exporters.png import encode_png

    text = json.dumps(found | {"rows": rows}, indent=1) + "\n"
    write_atomically(out / "survey.json", text.encode())
    for name, pictures in {"sheet.png": figures, "faces.png": faces}.items():
        if pictures:
            write_atomically(out / name, encode_png(contact_sheet(pictures, COLUMNS)))
    print(found)


def whole(avatar: "AvatarFields") -> tuple["Asset", bytes, Row]:
    """A person as one closed surface, the file of it, and what its own report says."""
    from assets import build
    from assets.mesh.surface import euler_number, find_defects
    from assets.poke import surface_of
    from exporters.glb import encode

    started = time.perf_counter()
    asset = build(avatar)
    assert asset.report is not None  # only assets that were not built have none
    data, error, surface = encode(asset), asset.report.error, surface_of(asset)
    row = Row(
        seed=avatar.info.seed,
        faces=len(asset.faces),
        closed=not find_defects(surface),
        handles=1 - euler_number(surface) // 2,
        mean_mm=error.mean_mm,
        p99_mm=error.p99_mm,
        max_mm=error.max_mm,
        bytes=len(data),
        seconds=time.perf_counter() - started,
    )
    return asset, data, row


def summary(rows: list[Row]) -> dict[str, object]:
    """Means and worst cases over the seeds."""
    return {
        "seeds": len(rows),
        "closed": sum(row.closed for row in rows),
        "without_handles": sum(row.handles == 0 for row in rows),
        "mean_mm": float(np.mean([row.mean_mm for row in rows])),
        "p99_mm": float(np.mean([row.p99_mm for row in rows])),
        "worst_mean_mm": max(row.mean_mm for row in rows),
        "worst_p99_mm": max(row.p99_mm for row in rows),
        "worst_max_mm": max(row.max_mm for row in rows),
        "median_seconds": float(np.median([row.seconds for row in rows])),
    }
