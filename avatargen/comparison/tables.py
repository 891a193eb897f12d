"""Rows of the tables: means over seeds, with intervals over seeds and people, and what they say.

The interval of a row has two parts, joined as independent errors are: that of the mean over seeds (Student's
t), and that over people and pictures, which seeds share. Of one seed there is only the second.

Letters: S seeds.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import t

from avatargen.comparison.measured import MeasuredRun, MeasuredTable
from avatargen.comparison.plan import OURS, TITLES
from avatargen.metrics.evaluate import DEPTH, WARP
from avatargen.metrics.report import Number

PAPER = {"frechet distance": 40, DEPTH: 49, WARP: 53}  # percent by which it leads the best baseline


@dataclass(frozen=True, kw_only=True)
class Cell:
    """A metric of a row: mean over seeds, 95 % interval, seeds."""

    value: float
    low: float
    high: float
    seeds: int

    def text(self, *, bold: bool = False) -> str:
        value = f"**{self.value:.3g}**" if bold else f"{self.value:.3g}"
        return f"{value} ({self.low:.3g} to {self.high:.3g})"


def cell(numbers: Sequence[Number]) -> Cell:
    """The mean of S runs that differ in their seed."""
    values = np.array([number.value for number in numbers])
    people = np.mean([(number.high - number.low) / 2 for number in numbers])
    among = 0.0
    if len(values) > 1:
        among = t.ppf(0.975, len(values) - 1) * values.std(ddof=1) / np.sqrt(len(values))
    half = float(np.hypot(people, among))
    mean = float(values.mean())
    return Cell(value=mean, low=mean - half, high=mean + half, seeds=len(values))


def cells(rows: dict[str, list[MeasuredRun]]) -> dict[str, dict[str, Cell]]:
    """By row and metric; a metric that no run of a row allowed to measure is left out there."""
    found: dict[str, dict[str, Cell]] = {}
    for row, runs in rows.items():
        names = dict.fromkeys(name for run in runs for name in run.numbers)
        found[row] = {
            name: cell([run.numbers[name] for run in runs if name in run.numbers]) for name in names
        }
    return found


def markdown(table: MeasuredTable) -> str:
    """The table in the paper's form, and what it says."""
    rows = cells(table.rows)
    names = list(dict.fromkeys(name for row in rows.values() for name in row))
    best = {name: min(row[name].value for row in rows.values() if name in row) for name in names}
    lines = [f"| {table.table.name} | {' | '.join(names)} |", "|---" * (len(names) + 1) + "|"]
    real = [f"{table.floors[name].value:.3g}" if name in table.floors else "" for name in names]
    lines.append(f"| real pictures against others | {' | '.join(real)} |")
    for row, own in rows.items():
        found = [own[name].text(bold=own[name].value == best[name]) if name in own else "-" for name in names]
        lines.append(f"| {row} | {' | '.join(found)} |")
    missing = [row for row in table.table.rows if row not in rows]
    said = [said_of_runs(table)]
    if missing:
        said.append(f"Not here, as their runs failed: {', '.join(missing)}.")
    says = against_best(rows) if table.table.name == "baselines" else against_first(rows)
    return "\n".join([*lines, "", *said, "", *says])


def said_of_runs(table: MeasuredTable) -> str:
    """How long the runs learned, and by how many pictures they were measured."""
    runs = [run for row in table.rows.values() for run in row]
    images = sorted({run.facts["images"] for run in runs})
    shown = f"{images[0]:,}" if len(images) == 1 else f"{images[0]:,} to {images[-1]:,}"
    seeds = sorted({len(row) for row in table.rows.values()})
    many = " to ".join(str(count) for count in {seeds[0]: 0, seeds[-1]: 0})
    devices = ", ".join(sorted({run.facts["device"] for run in runs}))
    return (
        f"Pictures shown in training: {shown}; seeds of a row: {many}; people that a run is judged by: "
        f"{table.pictures}, {table.turned} of them from two sides; trained on: {devices}."
    )


def against_best(rows: dict[str, dict[str, Cell]]) -> list[str]:
    """By how much ours leads the best of the others, beside what the paper has."""
    ours = rows.get(TITLES[OURS], {})
    lines = ["| metric | ours | best of the others | which | ours less by | in the paper |", "|---" * 6 + "|"]
    for name, own in ours.items():
        others = {row: values[name] for row, values in rows.items() if row != TITLES[OURS] and name in values}
        if not others:
            continue
        which = min(others, key=lambda row: others[row].value)
        best = others[which]
        less = f"{100 * (1 - own.value / best.value):.0f} %" if best.value > 0 else "-"
        apart = "" if own.high < best.low or best.high < own.low else ", intervals overlap"
        paper = next((f"{lead} %" for metric, lead in PAPER.items() if name.startswith(metric)), "")
        lines.append(f"| {name} | {own.value:.3g} | {best.value:.3g} | {which} | {less}{apart} | {paper} |")
    return lines


def against_first(rows: dict[str, dict[str, Cell]]) -> list[str]:
    """Which choices differ from the first row by more than both intervals."""
    first, *others = rows.items()
    lines = [f"| against `{first[0]}` | better | worse | intervals overlap |", "|---" * 4 + "|"]
    for row, own in others:
        shared = [name for name in own if name in first[1]]
        better = [name for name in shared if own[name].high < first[1][name].low]
        worse = [name for name in shared if own[name].low > first[1][name].high]
        same = [name for name in shared if name not in better and name not in worse]
        lines.append(f"| {row} | {', '.join(better)} | {', '.join(worse)} | {', '.join(same)} |")
    return lines
