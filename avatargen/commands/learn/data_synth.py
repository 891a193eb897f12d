"""avatargen data synth: labelled pictures of the wardrobe's people; the same command resumes."""

import os
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from avatargen.commands.line import OneLineParser, run_command, whole_number
from avatargen.commands.progress import progress_line

PROGRAM = "avatargen data synth"
EXAMPLE = """\
example:
  avatargen data synth --people 200 --size 128 --out data/train
  avatargen data synth --people 40 --size 128 --seed 1 --out data/held_out
"""


def main(arguments: Sequence[str] | None = None) -> int:
    parser = OneLineParser(
        PROGRAM,
        description=__doc__,
        examples=EXAMPLE,
    )
    add = parser.add_argument
    add("--people", type=whole_number(1, 99999), required=True, metavar="N", help="how many people")
    add("--size", type=whole_number(8, 2048), default=128, metavar="S", help="pixels a side (default: 128)")
    add("--views", type=whole_number(1, 1000), default=8, metavar="V", help="pictures of each (default: 8)")
    add("--seed", type=whole_number(0, 2**31), default=0, metavar="N", help="another seed, other people")
    add(
        "--cell",
        type=whole_number(4, 30),
        default=18,
        metavar="MM",
        help="fineness of the people in millimetres (default: 18, a pixel of 128); finer takes longer",
    )
    add("--workers", type=whole_number(1, 256), metavar="N", help="processes (default: one a core)")
    add("--packed", action="store_true", help="all pictures in one file, see avatargen data pack")
    add("--out", type=Path, required=True, metavar="DIR", help="where to write")

    def command() -> None:
        given = parser.parse_args(arguments)
        with progress_line() as show:
            show("loading libraries", 0.0)
            from avatargen.data.pack import pack_in_place
            from avatargen.data.synth import SynthConfig, synthesize

            config = SynthConfig(size=given.size, views=given.views, seed=given.seed, cell=given.cell / 1000)
            workers = given.workers or cores()
            started = time.monotonic()
            labels = synthesize(
                given.out,
                given.people,
                config,
                workers,
                lambda done, of: show(f"{done} of {of} people", done / of),
            )
            if given.packed:
                pack_in_place(given.out, lambda done, of: show(f"{done} of {of} packed", done / of))
        seconds = time.monotonic() - started
        print(f"{given.people} people, {len(labels)} pictures, {seconds:.1f} s", file=sys.stderr)
        print(given.out / "dataset.json")

    return run_command(PROGRAM, command)


def cores() -> int:
    """Processor cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
