"""avatargen stress: stiff and extreme cases, each with what had to happen and what did."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from avatargen.commands.line import parse_options, run_command
from avatargen.errors import AvatarGenError

if TYPE_CHECKING:
    from avatargen.commands.stress.case import Case

PROGRAM = "avatargen stress"


@dataclass(frozen=True, kw_only=True)
class Options:
    """Run every extreme case; write stress.md and stress.json. Fails where one does not end as it must."""

    out: Path
    """Folder for the results."""
    quick: bool = False
    """Leave out the cases that take long."""


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """One case's end; seconds are the processor's."""

    group: str
    name: str
    expected: str
    happened: str
    right: bool
    seconds: float
    peak_mb: float


def main(arguments: Sequence[str] | None = None) -> int:
    return run_command(PROGRAM, lambda: run(parse_options(PROGRAM, Options, arguments)))


def run(options: Options) -> None:
    """Every case in turn, a line each.

    Raises:
        AvatarGenError: a case did not end as it must; the tables are written all the same.
    """
    from avatargen.atomic import check_writable, write_together

    options.out.mkdir(parents=True, exist_ok=True)
    check_writable(options.out / "stress.md")
    outcomes = []
    for group, case in all_cases():
        if not (options.quick and case.slow):
            outcomes.append(attempt(group, case))
            print(
                "ok   " if outcomes[-1].right else "WRONG", case.name, "-", outcomes[-1].happened, flush=True
            )
    data = json.dumps([asdict(outcome) for outcome in outcomes], indent=1).encode() + b"\n"
    write_together(
        [(options.out / "stress.json", data), (options.out / "stress.md", page(outcomes).encode())]
    )
    failed = [outcome.name for outcome in outcomes if not outcome.right]
    if failed:
        raise AvatarGenError(f"{len(failed)} of {len(outcomes)} cases went wrong: {', '.join(failed)}")
    print(options.out / "stress.md")


def all_cases() -> "list[tuple[str, Case]]":
    """Every case with the name of its group."""
    from avatargen.commands.stress import fields, losses, numbers, sizes, skeletons

    groups = {"Numbers": numbers, "Losses": losses, "Fields": fields, "Skinning": skeletons, "Sizes": sizes}
    return [(group, case) for group, module in groups.items() for case in module.cases()]


def attempt(group: str, case: "Case") -> Outcome:
    """Run one case and judge its end, its seconds and its memory."""
    from avatargen.commands.bench.cost import measured
    from avatargen.commands.stress.case import Wrong

    right = case.error is None
    with measured() as cost:
        try:
            happened = case.check()
        except Wrong as wrong:
            happened, right = str(wrong), False
        except AvatarGenError as error:
            happened = f"{type(error).__name__}: {error}"
            right = case.error is not None and isinstance(error, case.error[0]) and case.error[1] in happened
    if cost.cpu_seconds > case.seconds or cost.peak_mb > case.megabytes:
        happened, right = f"{happened}; beyond {case.seconds:g} s or {case.megabytes:g} MB", False
    return Outcome(
        group=group,
        name=case.name,
        expected=case.expected,
        happened=happened,
        right=right,
        seconds=cost.cpu_seconds,
        peak_mb=cost.peak_mb,
    )


def page(outcomes: Sequence[Outcome]) -> str:
    """The table as Markdown."""
    from avatargen.commands.bench.tables import table

    right = sum(outcome.right for outcome in outcomes)
    parts = [
        "# Stiff and extreme cases",
        f"Made by `avatargen stress`: {right} of {len(outcomes)} cases end as they must. Seconds are the "
        "processor's, MB the memory at the peak beyond the start's.",
    ]
    for group in dict.fromkeys(outcome.group for outcome in outcomes):
        rows = [row(outcome) for outcome in outcomes if outcome.group == group]
        parts += [f"## {group}", table(["case", "expected", "happened", "right", "s", "MB"], rows)]
    return "\n\n".join(parts) + "\n"


def row(outcome: Outcome) -> list[str]:
    """A line of the table."""
    right = "yes" if outcome.right else "**no**"
    costs = [f"{outcome.seconds:.1f}", f"{outcome.peak_mb:.0f}"]
    return [outcome.name, outcome.expected, outcome.happened, right, *costs]
