"""avatargen data prepare: photographs with SMPL estimates to a data set; the same command resumes."""

import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from avatargen.commands.learn.data_synth import cores
from avatargen.commands.line import OneLineParser, positive_number, run_command, whole_number
from avatargen.commands.progress import progress_line
from avatargen.errors import InputError

if TYPE_CHECKING:
    from avatargen.data.conventions import Convention
    from avatargen.data.photograph import Settings

PROGRAM = "avatargen data prepare"
EXAMPLE = """\
examples:
  avatargen data prepare --images photos --masks masks --keypoints openpose --labels dataset.json \\
      --convention ag3d --body smpl.npz --size 256 --out data/people
  avatargen data prepare --images photos --segment my_matting:person --labels smplify --convention eva3d \\
      --out data/people
"""


@dataclass(frozen=True, kw_only=True)
class Options:
    """Photographs and what is known of them, how they are made pictures of a data set, and where."""

    images: Path
    masks: Path | None
    segment: str | None  # module:function
    keypoints: Path | None
    labels: Path
    smpl: Path | None
    body: Path | None
    convention: "Convention"
    size: int  # pixels a side
    focal: float | None  # share of the height
    shape: str | None  # given or mean
    no_mirror: bool
    no_balance: bool
    workers: int | None
    packed: bool
    out: Path


def main(arguments: Sequence[str] | None = None) -> int:
    return run_command(PROGRAM, lambda: run(parse(arguments)))


def parse(arguments: Sequence[str] | None) -> Options:
    """Raises InputError where an argument is bad."""
    parser = OneLineParser(
        PROGRAM,
        description=__doc__,
        examples=EXAMPLE,
    )
    add_sources(parser)
    add_settings(parser)
    add = parser.add_argument
    add("--workers", type=whole_number(1, 256), metavar="N", help="processes (default: one a core)")
    add("--packed", action="store_true", help="all pictures in one file, see avatargen data pack")
    add("--out", type=Path, required=True, metavar="DIR", help="where to write")
    return Options(**vars(parser.parse_args(arguments)))


def add_sources(parser: OneLineParser) -> None:
    add = parser.add_argument
    add("--images", type=Path, required=True, metavar="DIR", help="photographs, one person each")
    masks = parser.add_mutually_exclusive_group()
    masks.add_argument(
        "--masks", type=Path, metavar="DIR", help="NAME.png a photograph (default: its alpha channel)"
    )
    masks.add_argument(
        "--segment",
        metavar="MODULE:FUNCTION",
        help="make masks: a function of yours, imported from here or the Python path, that takes [H W 3] "
        "sRGB in 8 bits and returns the person's coverage [H W]",
    )
    add("--keypoints", type=Path, metavar="PATH", help="OpenPose's folder, or COCO's JSON (default: labels)")
    add("--labels", type=Path, required=True, metavar="PATH", help="JSON, or for eva3d a folder of pickles")
    add("--smpl", type=Path, metavar="FILE", help=".npz of poses, for eg3d labels that are cameras alone")
    add("--body", type=Path, metavar="FILE", help="the SMPL body that was fitted (default: the shipped body)")


def add_settings(parser: OneLineParser) -> None:
    add = parser.add_argument
    add(
        "--convention",
        choices=("eg3d", "getavatar", "ag3d", "eva3d"),
        required=True,
        help="whose form the labels have",
    )
    add("--size", type=whole_number(8, 2048), default=256, metavar="S", help="pixels a side (default: 256)")
    add("--focal", type=positive_number(1000.0), metavar="F", help="focal length, share of the height")
    add(
        "--shape",
        choices=("given", "mean"),
        help="use the labels' betas, or the mean shape (default: given with --body, else mean: betas of SMPL "
        "mean nothing to the shipped body)",
    )
    add("--no-mirror", action="store_true", help="leave the mirrored pictures out")
    add("--no-balance", action="store_true", help="show all pictures alike, whatever side they show")


def run(given: Options) -> None:
    """Prepare, and say what came of it."""
    with progress_line() as show:
        show("loading libraries", 0.0)
        from avatargen.data.pack import pack_in_place
        from avatargen.data.prepare import Sources, prepare

        started = time.monotonic()
        summary = prepare(
            Sources(
                images=given.images,
                labels=given.labels,
                body=given.body,
                masks=given.masks,
                keypoints=given.keypoints,
                smpl=given.smpl,
            ),
            given.out,
            settings_of(given),
            given.workers or cores(),
            lambda done, of: show(f"{done} of {of} photographs", done / of),
            function_named(given.segment) if given.segment else None,
        )
        if given.packed:
            pack_in_place(given.out, lambda done, of: show(f"{done} of {of} packed", done / of))
    used = summary.photographs - len(summary.skipped)
    said = f"{used} of {summary.photographs} photographs, {len(summary.labels)} pictures"
    if summary.skipped:
        reasons = ", ".join(f"{count} {reason}" for reason, count in summary.reasons().items())
        said += f"; skipped: {reasons} (names in {given.out / 'skipped.jsonl'})"
    print(f"{said}; {time.monotonic() - started:.1f} s", file=sys.stderr)
    print(given.out / "dataset.json")


def settings_of(given: Options) -> "Settings":
    from avatargen.data.photograph import Settings

    return Settings(
        convention=given.convention,
        size=given.size,
        mirror=not given.no_mirror,
        balance=not given.no_balance,
        keep_betas=(given.shape or ("given" if given.body else "mean")) == "given",
        focal=given.focal,
    )


def function_named(text: str) -> Callable[..., Any]:
    """The function `module:name`, from the working directory or the Python path.

    Raises:
        InputError: there is none.
    """
    module, _, name = text.partition(":")
    if "" not in sys.path:
        sys.path.insert(0, "")  # as `python -m` does; a command's own path lacks it
    try:
        found = getattr(import_module(module), name)
    except (ImportError, AttributeError, ValueError) as error:
        raise InputError(f"--segment {text}: {error}; give MODULE:FUNCTION that can be imported") from error
    if not callable(found):
        raise InputError(f"--segment {text}: it is no function; give MODULE:FUNCTION")
    return found


if __name__ == "__main__":
    sys.exit(main())
