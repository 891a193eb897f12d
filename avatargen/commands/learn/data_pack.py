"""avatargen data pack: a data set's pictures in one file, which training maps into memory."""

import sys
from collections.abc import Sequence
from pathlib import Path

from avatargen.commands.line import OneLineParser, run_command, whole_number
from avatargen.commands.progress import progress_line

PROGRAM = "avatargen data pack"
EXAMPLE = """\
example:
  avatargen data pack data/train --size 64 --out data/train64
"""


def main(arguments: Sequence[str] | None = None) -> int:
    parser = OneLineParser(PROGRAM, description=__doc__, examples=EXAMPLE)
    add = parser.add_argument
    add("folder", type=Path, metavar="DIR", help="a data set, packed or not")
    add("--size", type=whole_number(8, 2048), metavar="S", help="pixels a side (default: as they are)")
    add("--depth", action="store_true", help="pack the true depth too, which evaluation reads")
    add("--out", type=Path, required=True, metavar="DIR", help="where to write")

    def command() -> None:
        given = parser.parse_args(arguments)
        with progress_line() as show:
            show("loading libraries", 0.0)
            from avatargen.data.pack import pack
            from avatargen.data.packed import PACK_NAME

            pictures = pack(
                given.folder,
                given.out,
                size=given.size,
                depth=given.depth,
                report=lambda done, of: show(f"{done} of {of} pictures", done / of),
            )
        path = given.out / PACK_NAME
        megabytes = path.stat().st_size / 1e6
        said = f"{len(pictures)} pictures of {pictures.size} pixels a side, {megabytes:.1f} MB"
        print(said, file=sys.stderr)
        print(path)

    return run_command(PROGRAM, command)
