"""avatargen body convert: an SMPL body file, .pkl or .npz, saved as the .npz that everything here reads."""

from collections.abc import Sequence
from pathlib import Path

from avatargen.commands.line import OneLineParser, run_command
from avatargen.errors import InputError

PROGRAM = "avatargen body convert"


def main(arguments: Sequence[str] | None = None) -> int:
    def command() -> None:
        parser = OneLineParser(PROGRAM, description=__doc__)
        parser.add_argument("source", type=Path, metavar="MODEL.pkl", help="a body in SMPL's format")
        parser.add_argument("target", type=Path, metavar="BODY.npz", help="where to write")
        given = parser.parse_args(arguments)
        convert(given.source, given.target)

    return run_command(PROGRAM, command)


def convert(source: Path, target: Path) -> None:
    """Read, check and save one body file.

    Raises:
        InputError: the source is no body or holds code, or the target is no writable .npz path.
    """
    from avatargen.atomic import check_writable
    from avatargen.body.load import load_body, save_body

    if target.suffix.lower() != ".npz":
        raise InputError(f"found the target {target}; give a name that ends in .npz")
    check_writable(target)
    body = load_body(source)
    save_body(body, target)
    print(target)
