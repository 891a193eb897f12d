"""avatargen eval baselines, ablations, tables: methods and choices trained alike, and measured.

avatargen eval baselines --preset cpu --data data/train --held-out data/held_out --out runs/baselines
avatargen eval tables --data ... --held-out ... --out runs/tables --phase make --minutes 9 --jobs 16
avatargen eval tables --data ... --held-out ... --out runs/tables --phase measure

The first phase, `make`, trains every run, asks it for pictures at held-out labels and packs these, below
`out`/packed; the second, `measure`, needs nothing else of the first and may be done on another machine.
"""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from avatargen.commands.learn.train import preset_of
from avatargen.commands.line import parse_options, run_command
from avatargen.training.adversarial_config import PRESETS, AdversarialConfig

if TYPE_CHECKING:
    from avatargen.comparison.measured import MeasuredTable
    from avatargen.comparison.packed import Result
    from avatargen.comparison.plan import Plan

BASELINES, ABLATIONS, TABLES = "avatargen eval baselines", "avatargen eval ablations", "avatargen eval tables"
ALL: tuple[str, ...] = ("all",)
LOG = "log.txt"


@dataclass(frozen=True, kw_only=True)
class Options:
    """What the command was asked for; `parse` says what each is."""

    data: Path
    held_out: Path
    out: Path
    models: tuple[str, ...]
    rows: tuple[str, ...]
    seeds: tuple[int, ...]
    phase: str
    minutes: float | None
    jobs: int
    megabytes: int
    people: int
    training: AdversarialConfig


def baselines(arguments: Sequence[str] | None = None) -> int:
    return command(BASELINES, arguments)


def ablations(arguments: Sequence[str] | None = None) -> int:
    return command(ABLATIONS, arguments)


def tables(arguments: Sequence[str] | None = None) -> int:
    return command(TABLES, arguments)


def command(program: str, arguments: Sequence[str] | None) -> int:
    import sys

    words = list(sys.argv[1:] if arguments is None else arguments)
    return run_command(program, lambda: run(program, parse(program, words)))


def parse(program: str, words: list[str]) -> Options:
    """The options, with the preset named among them as the default of every other setting."""
    chosen = PRESETS[preset_of(words)]

    def options(
        data: Path,
        held_out: Path,
        out: Path,
        preset: Literal["debug", "cpu", "gpu", "paper"] = "cpu",
        models: tuple[str, ...] = ALL,
        rows: tuple[str, ...] = ALL,
        seeds: tuple[int, ...] = (0, 1, 2),
        images: int | None = None,
        phase: Literal["all", "make", "measure"] = "all",
        minutes: float | None = None,
        jobs: int = 1,
        megabytes: int = 60,
        people: int = 300,
        training: AdversarialConfig = chosen,
    ) -> Options:
        """Train methods (Table 1) and choices (Table 2) of the paper for the same pictures, and measure them.
        Run the same command again to resume.

        Args:
            data: Pictures to learn from: a folder with dataset.json.
            held_out: Pictures of other people, to measure with.
            out: Folder of the runs, their packed pictures, and the tables.
            preset: Where the settings that all runs share start from; every one of them can be changed.
            models: Methods of Table 1; all if left out.
            rows: Choices of Table 2; all if left out. The first is always there.
            seeds: Each run is made once with each.
            images: Pictures shown to each; those of the preset if left out.
            phase: `make` the runs and pack their pictures, `measure` packed ones, or both.
            minutes: Stop in time: all runs at the same number of pictures, and packed.
            jobs: Processes that train side by side.
            megabytes: Of packed pictures, at most.
            people: That each run is judged by, at most; choices by 120.
        """
        return Options(
            data=data,
            held_out=held_out,
            out=out,
            models=models,
            rows=rows,
            seeds=seeds,
            phase=phase,
            minutes=minutes,
            jobs=jobs,
            megabytes=megabytes,
            people=people,
            training=with_images(training, images),
        )

    return parse_options(program, options, words)


def with_images(config: AdversarialConfig, images: int | None) -> AdversarialConfig:
    from dataclasses import replace

    return config if images is None else replace(config, images=images)


def run(program: str, options: Options) -> None:
    """Make, then measure."""
    from avatargen.extras import require_extra

    require_extra("accelerate")
    plan = plan_of(program, options)
    options.out.mkdir(parents=True, exist_ok=True)
    if options.phase != "measure":
        make(plan, options)
    if options.phase != "make":
        measure(plan, options)


def plan_of(program: str, options: Options) -> "Plan":
    """The runs that are asked for.

    Raises:
        InputError: a method or a row has an unknown name.
    """
    from avatargen.comparison.plan import TITLES, make_plan, table_of_ablations, table_of_baselines
    from avatargen.metrics.ablations import choices

    base, asked = options.training, []
    names = list(choices(base))
    if program != ABLATIONS:
        asked.append(table_of_baselines(known(options.models, list(TITLES), "--models"), options.people))
    if program != BASELINES:
        rows = known(options.rows, names, "--rows")
        asked.append(table_of_ablations(base, [names[0], *rows], options.people))
    return make_plan(base, asked, options.seeds)


def known(asked: Sequence[str], names: Sequence[str], option: str) -> Sequence[str]:
    """The names that are asked for. Raises InputError where one is unknown."""
    from avatargen.errors import InputError

    if tuple(asked) == ALL:
        return names
    if strange := [name for name in asked if name not in names]:
        raise InputError(f"found {option} {strange[0]!r}; choose among {', '.join(map(repr, names))}")
    return asked


def teller(options: Options) -> Any:
    """A function that adds a line to the log, and prints it."""

    def tell(line: str) -> None:
        print(line, flush=True)
        with (options.out / LOG).open("a") as log:
            log.write(line + "\n")

    return tell


def make(plan: "Plan", options: Options) -> None:
    """Train all runs and pack their pictures."""
    from avatargen.comparison.conduct import Conditions, Conductor, Places

    conditions = Conditions(jobs=options.jobs, minutes=options.minutes, megabytes=options.megabytes)
    places = Places(data=options.data, held_out=options.held_out, out=options.out)
    for path in Conductor(plan, places, conditions).run(teller(options)):
        print(path)


def measure(plan: "Plan", options: Options) -> None:
    """Measure the packed pictures; write the tables and the sheet."""
    from avatargen.atomic import write_together
    from avatargen.avatar import training_body
    from avatargen.comparison.conduct import PACKED
    from avatargen.comparison.measured import Held, measure_table
    from avatargen.comparison.packed import read_packed
    from avatargen.comparison.sheet import sheet
    from avatargen.comparison.tables import markdown
    from avatargen.data.dataset import open_pictures
    from avatargen.metrics.judges import judges_for

    results = dict(read_packed(options.out / PACKED))
    size, body = options.training.render.image_size, training_body()
    reference = open_pictures(options.data, size)
    held = Held(
        data=open_pictures(options.held_out, size),
        reference=reference,
        body=body,
        judges=judges_for(body, reference),
    )
    for table in plan.tables:
        found = measure_table(table, plan, results, held, options.out, teller(options))
        text = markdown(found)
        shown = first_seeds(found, results, options.seeds)
        files = [
            (options.out / f"{table.name}.json", as_json(found)),
            (options.out / f"{table.name}.md", text.encode() + b"\n"),
            (options.out / f"{table.name}.png", sheet(shown, held.data)),
        ]
        write_together(files)
        print(text)
        print(options.out / f"{table.name}.md")


def first_seeds(
    found: "MeasuredTable", results: "dict[str, Result]", seeds: Sequence[int]
) -> "dict[str, Result]":
    """A run of each row: of the first seed that left pictures."""
    keys = {row: [f"{found.table.rows[row]}/seed{seed}" for seed in seeds] for row in found.rows}
    return {row: results[next(key for key in own if key in results)] for row, own in keys.items()}


def as_json(found: "MeasuredTable") -> bytes:
    return json.dumps(asdict(found), indent=1).encode() + b"\n"
