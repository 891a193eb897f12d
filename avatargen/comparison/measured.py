"""The metrics of every run, measured from its pictures: the same people for all runs of a table.

OUT/measured/TABLE/KEY.json     one run's numbers; measured again only where its pictures are others
"""

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from avatargen.atomic import write_atomically
from avatargen.body.model import Body
from avatargen.comparison.packed import Result, encode, with_counts
from avatargen.comparison.plan import Plan, Table
from avatargen.data.dataset import Pictures
from avatargen.errors import InputError
from avatargen.metrics.evaluate import measure, require_body
from avatargen.metrics.judges import Judges
from avatargen.metrics.report import Number, measured
from avatargen.metrics.truth import Truth, gather_truth


@dataclass(frozen=True, kw_only=True)
class MeasuredRun:
    """One run's numbers, and what is told of it."""

    facts: dict[str, Any]
    numbers: dict[str, Number]


@dataclass(frozen=True, kw_only=True)
class MeasuredTable:
    """All runs of a table: by row, one a seed. Rows of which no run left pictures are not here."""

    table: Table
    rows: dict[str, list[MeasuredRun]]
    floors: dict[str, Number]
    pictures: int  # each run was measured with
    turned: int


@dataclass(frozen=True, kw_only=True, eq=False)
class Held:
    """Held-out people, other real ones, the body, and who judges."""

    data: Pictures
    reference: Pictures
    body: Body
    judges: Judges


def measure_table(
    table: Table,
    plan: Plan,
    results: Mapping[str, Result],
    held: Held,
    out: Path,
    tell: Callable[[str], None],
) -> MeasuredTable:
    """Measure what is not measured yet.

    Raises:
        InputError: no run of the table left pictures, or runs were asked for other labels than one another.
    """
    require_body(held.body, held.data, held.reference)
    keys = {
        name: [run.key for run in plan.runs if run.name == name and run.key in results]
        for name in table.rows.values()
    }
    own = [results[key].shown for row in keys.values() for key in row]
    if not own:
        raise InputError(f"eval: no run of {table.title} left pictures; make some first")
    pictures = min(table.show.pictures, *(len(shown) for shown in own))
    turned = min(table.show.turned, *(len(shown.turned) for shown in own))
    chosen = own[0].chosen[:pictures]
    if any((shown.chosen[:pictures] != chosen).any() for shown in own):
        raise InputError("eval: the runs were asked for different labels; make them with the same command")
    tell(f"{table.title}: the real pictures at {pictures} labels")
    truth = gather_truth(
        held.data, held.reference, held.body, chosen, held.judges, own[0].first.depth.shape[1]
    )
    rows = {}
    for row, name in table.rows.items():
        runs = []
        for key in keys[name]:
            path = out / "measured" / table.name / f"{key}.json"
            runs.append(measure_run(results[key], pictures, turned, truth, held, path))
            tell(f"{table.title}: {row}, {key}: {in_words(runs[-1])}")
        if runs:
            rows[row] = runs
    return MeasuredTable(table=table, rows=rows, floors=truth.floors, pictures=pictures, turned=turned)


def measure_run(
    result: Result, pictures: int, turned: int, truth: Truth, held: Held, path: Path
) -> MeasuredRun:
    """From the file, if it is of these pictures and judges."""
    shown = result.shown.upto(pictures, turned)
    files = encode(with_counts(replace(result, shown=shown)))
    content = hashlib.sha256(b"".join(files[name] for name in sorted(files))).hexdigest()
    names = [judge.frechet for judge in held.judges.features] + [held.judges.joints.name]
    settings = {"pictures": content, "judges": names, "data": str(held.data.labels.names[:1])}
    if path.exists():
        found = json.loads(path.read_bytes())
        if found.get("settings") == settings:
            numbers = {name: Number(**number) for name, number in found["numbers"].items()}
            return MeasuredRun(facts=result.facts, numbers=numbers)
    numbers = measured(measure(shown, truth, held.judges))
    path.parent.mkdir(parents=True, exist_ok=True)
    facts = {
        "settings": settings,
        "facts": result.facts,
        "numbers": {name: asdict(each) for name, each in numbers.items()},
    }
    write_atomically(path, json.dumps(facts, indent=1).encode() + b"\n")
    return MeasuredRun(facts=result.facts, numbers=numbers)


def in_words(run: MeasuredRun) -> str:
    return ", ".join(f"{name} {number.value:.4g}" for name, number in run.numbers.items())
