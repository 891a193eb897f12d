"""avatargen eval runs: what training reached, snapshot by snapshot, and which one is best.

avatargen eval runs --runs runs/a runs/b --data data/held_out --reference data/train --out runs/compared
"""

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from avatargen.commands.line import parse_options, run_command
from avatargen.errors import InputError
from avatargen.metrics.shown import ShowConfig
from avatargen.ranges import require_ranges

if TYPE_CHECKING:
    from avatargen.metrics.evaluate import Exam

PROGRAM = "avatargen eval runs"
COLUMNS = 3  # plots side by side


@dataclass(frozen=True, kw_only=True)
class Options:
    """Measure every snapshot of training runs; prints a table, writes it as JSON, Markdown and a plot.
    Run the same command again to resume."""

    runs: tuple[Path, ...]
    """Folders of runs."""
    data: Path
    """Held-out pictures with dataset.json."""
    out: Path
    """Folder for runs.json, runs.md and, where matplotlib is installed, runs.png."""
    reference: Path | None = None
    """Other real pictures, for what real pictures reach and, where no pose network is installed, to learn
    where joints are; without them half of the held-out ones."""
    body: Path | None = None
    """The body that the labels are of, where it is not the shipped one."""
    every: int = 1
    """Take each so many-th snapshot, and the last."""
    samples: int | None = 48
    """Samples along rays; `None`: those that each run was trained with."""
    measure: ShowConfig = field(default_factory=ShowConfig)

    def __post_init__(self) -> None:
        require_ranges(self, "eval", {"samples": (2, 4096)})


@dataclass(frozen=True, kw_only=True)
class Row:
    """One snapshot's metrics, as `avatargen eval` measures them; `floors` are real pictures'."""

    run: str
    images: int  # pictures shown to the discriminator
    weights_hash: str
    measure: dict[str, Any]
    numbers: dict[str, dict[str, float]]
    floors: dict[str, dict[str, float]]


def main(arguments: Sequence[str] | None = None) -> int:
    return run_command(PROGRAM, lambda: run(parse_options(PROGRAM, Options, arguments)))


def run(options: Options) -> None:
    """Measure what is not measured yet, writing the table after each; then draw."""
    from importlib.util import find_spec

    from avatargen.atomic import write_atomically, write_together
    from avatargen.avatar import training_body
    from avatargen.data.dataset import open_pictures
    from avatargen.metrics.evaluate import data_and_reference, set_exam
    from avatargen.metrics.judges import judges_for
    from avatargen.run_folder import digest_arrays

    @cache
    def exam(size: int, raw_size: int) -> "Exam":
        data, reference = data_and_reference(options.data, options.reference, size)
        judges = judges_for(body, reference)
        return set_exam(data, reference, body, judges, options.measure, raw_size)

    chosen = [(folder, path) for folder in options.runs for path in snapshots(folder, options.every)]
    body = training_body(options.body)
    settings = {
        **asdict(options.measure),
        "samples": options.samples,
        "data": open_pictures(options.data, 1).contents(),
        "reference": options.reference and open_pictures(options.reference, 1).contents(),
        "body": digest_arrays(vars(body)),
    }
    options.out.mkdir(parents=True, exist_ok=True)
    known, rows = read_rows(options.out / "runs.json"), []
    for folder, path in chosen:
        rows.append(measure(folder, path, exam, settings, known))
        print(one_line(rows[-1]), flush=True)
        rest = [row for row in known if row not in rows]
        write_atomically(options.out / "runs.json", as_json([*rows, *rest]))
    files = [(options.out / "runs.md", table(rows).encode() + b"\n")]
    if find_spec("matplotlib"):
        files.append((options.out / "runs.png", plot(rows)))
    write_together(files)
    print(table(rows))
    print(options.out / "runs.json")


def snapshots(folder: Path, every: int) -> list[Path]:
    """A run's snapshots in order.

    Raises:
        InputError: it has none, or `every` is not positive.
    """
    if every < 1:
        raise InputError(f"found --every {every}; give 1 or more")
    found = sorted((folder / "snapshots").glob("*.safetensors"))
    if not found or not all(path.stem.isdecimal() for path in found):
        raise InputError(
            f"{folder}: wanted a run's folder with snapshots/PICTURES.safetensors; train one first"
        )
    return [path for i, path in enumerate(found) if i % every == 0 or path == found[-1]]


def read_rows(path: Path) -> list[Row]:
    """What an earlier call of the command measured.

    Raises:
        InputError: the file is damaged.
    """
    if not path.exists():
        return []
    try:
        return [Row(**row) for row in json.loads(path.read_bytes())]
    except (ValueError, TypeError, RecursionError) as error:
        raise InputError(
            f"{path}: is no table of this command ({str(error)[:200]}); remove it or name another folder"
        ) from error


def as_json(rows: Sequence[Row]) -> bytes:
    return json.dumps([asdict(row) for row in rows], indent=1).encode() + b"\n"


def measure(
    folder: Path,
    path: Path,
    exam: "Callable[[int, int], Exam]",
    settings: dict[str, Any],
    known: Sequence[Row],
) -> Row:
    """The row of a snapshot, measured unless it is known under the same settings."""
    from avatargen.generator.checkpoint import load_checkpoint
    from avatargen.metrics.evaluate import examine
    from avatargen.metrics.finer import model_of

    checkpoint = load_checkpoint(path)
    for row in known:
        if row.weights_hash == checkpoint.weights_hash and row.measure == settings and row.run == folder.name:
            return row
    render = checkpoint.generator.config.render
    questions = exam(render.image_size, render.raw_size)
    report = examine(model_of(checkpoint.generator, questions.truth.body, settings["samples"]), questions)
    return Row(
        run=folder.name,
        images=int(path.stem),
        weights_hash=checkpoint.weights_hash,
        measure=settings,
        numbers={name: asdict(number) for name, number in report.numbers.items()},
        floors={name: asdict(number) for name, number in report.floors.items()},
    )


def one_line(row: Row) -> str:
    numbers = ", ".join(f"{name} {number['value']:.4g}" for name, number in row.numbers.items())
    return f"{row.run} {row.images}: {numbers}"


def table(rows: Sequence[Row]) -> str:
    """Markdown; the best number of each column and run is bold."""
    names = list(dict.fromkeys(name for row in rows for name in row.numbers))
    lines = [f"| run | pictures shown | {' | '.join(names)} |", "|" + "---|" * (len(names) + 2)]
    floors = rows[0].floors
    real = [f"{floors[name]['value']:.3g}" if name in floors else "" for name in names]
    lines.append(f"| real pictures against others | | {' | '.join(real)} |")
    for row in rows:
        cells = []
        for name in names:
            number = row.numbers.get(name)
            if number is None:
                cells.append("-")
                continue
            own = [r.numbers[name]["value"] for r in rows if r.run == row.run and name in r.numbers]
            value = f"{number['value']:.3g}"
            value = f"**{value}**" if number["value"] == min(own) else value
            cells.append(f"{value} ({number['low']:.3g} to {number['high']:.3g})")
        lines.append(f"| {row.run} | {row.images:,} | {' | '.join(cells)} |")
    return "\n".join(lines)


def plot(rows: Sequence[Row]) -> bytes:
    """PNG: each metric over the pictures shown, a line a run with its 95 % band; dashes are real pictures."""
    import io
    import math

    from matplotlib.figure import Figure

    names = list(dict.fromkeys(name for row in rows for name in row.numbers))
    height = math.ceil(len(names) / COLUMNS)
    figure = Figure(figsize=(4 * COLUMNS, 3 * height), layout="constrained")
    panels = figure.subplots(height, COLUMNS, squeeze=False).flatten()
    for axes, name in zip(panels, names, strict=False):
        for run_name in dict.fromkeys(row.run for row in rows):
            own = [row for row in rows if row.run == run_name and name in row.numbers]
            shown = [row.images for row in own]
            axes.plot(shown, [row.numbers[name]["value"] for row in own], ".-", label=run_name)
            ends = [[row.numbers[name][end] for row in own] for end in ("low", "high")]
            axes.fill_between(shown, *ends, alpha=0.2)
        if name in rows[0].floors:
            axes.axhline(rows[0].floors[name]["value"], color="gray", linestyle="--", linewidth=1)
        axes.set_title(name)
        axes.set_xlabel("pictures shown")
        if name.startswith(("frechet", "FID")):
            axes.set_yscale("log")
    for axes in panels[len(names) :]:
        axes.axis("off")
    panels[0].legend()
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=90)
    return stream.getvalue()
