"""avatargen photo-models: get the networks that read photographs, once; nothing is downloaded afterwards."""

from collections.abc import Sequence
from pathlib import Path

from avatargen.commands.line import OneLineParser, run_command

PROGRAM = "avatargen photo-models"


def main(arguments: Sequence[str] | None = None) -> int:
    def command() -> None:
        parser = OneLineParser(PROGRAM, description=__doc__)
        parser.add_argument(
            "--wheel", type=Path, metavar="FILE.whl", help="mediapipe 0.10.21's (default: pip downloads it)"
        )
        parser.add_argument(
            "--folder",
            type=Path,
            metavar="DIR",
            help="where to keep them, which AVATARGEN_PHOTO_MODELS then has to name (default: in the "
            "user's folder for data)",
        )
        given = parser.parse_args(arguments)
        from avatargen.photo.models import install_models

        print(install_models(given.wheel, given.folder))

    return run_command(PROGRAM, command)
