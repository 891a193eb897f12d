"""avatargen eval metrics: do the metrics see what was done to real pictures?

avatargen eval metrics --data data/held_out --reference data/train --size 64 --out runs/metrics.md
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from avatargen.commands.line import parse_options, run_command

PROGRAM = "avatargen eval metrics"


@dataclass(frozen=True, kw_only=True)
class Options:
    """Measure real pictures as they are, and made worse by known amounts; prints a table and writes it."""

    data: Path
    """Held-out pictures with dataset.json."""
    out: Path
    """Where to write, .md."""
    reference: Path | None = None
    """Other real pictures; without them half of the held-out ones."""
    size: int = 64
    """Pixels a side."""
    raw_size: int = 32
    """Pixels a side of depth and of what warp compares."""
    pictures: int = 150
    """Pictures measured, at most."""
    inception: Path | None = None
    """Inception as a TorchScript file: adds the FID and the KID."""


def main(arguments: Sequence[str] | None = None) -> int:
    return run_command(PROGRAM, lambda: run(parse_options(PROGRAM, Options, arguments)))


def run(options: Options) -> None:
    """Load, measure row by row, print, write."""
    from avatargen.atomic import check_writable, write_atomically
    from avatargen.avatar import training_body
    from avatargen.metrics.evaluate import data_and_reference
    from avatargen.metrics.judges import judges_for
    from avatargen.metrics.shown import ShowConfig, choose_labels
    from avatargen.metrics.validation import table, validate

    check_writable(options.out)
    body = training_body()
    data, reference = data_and_reference(options.data, options.reference, options.size)
    rows = validate(
        data,
        reference,
        body,
        judges_for(body, reference, options.inception),
        choose_labels(data, ShowConfig(pictures=options.pictures)),
        options.raw_size,
        lambda row: print(f"{row.what} {row.amount:g}", flush=True),
    )
    write_atomically(options.out, table(rows).encode() + b"\n")
    print(table(rows))
    print(options.out)
