"""avatar-export: from a seed to a rigged, textured file.

Only what `--help` and bad arguments need is imported here; `export_run` brings torch and the rest.
"""

import argparse
import sys
from argparse import ArgumentTypeError, Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

from avatargen import __version__
from avatargen.atomic import check_writable
from avatargen.commands.export.scenes import DEFAULT, SCENES
from avatargen.commands.line import (
    FEWEST_FACES,
    LARGEST_SEED,
    MOST_FACES,
    OneLineParser,
    falling_numbers,
    leave,
    positive_number,
    quantity,
    run_command,
    seed_range,
    whole_number,
)
from avatargen.commands.progress import progress_line
from avatargen.errors import InputError
from avatargen.shadow import prefer_ours

PROGRAM = "avatar-export"
# what `exporters` writes, which takes seconds to ask
FORMATS = ("glb", "gltf", "vrm", "usda", "usdc", "usdz", "obj", "ply", "stl")
PICTURES = ("png", "jpeg", "webp")
DESCRIPTION = """\
Make one clothed, textured, rigged human from a seed and write it to a file.

The last line on standard output is the path written. Exit status 0 means the file is whole;
bad input ends in one line on standard error, status 2 and no file."""
EXAMPLES = """\
examples:
  avatar-export --seed 3 --format glb
  avatar-export --seed 3 --out person.glb --report person.json --preview person.png
  avatar-export --seed 3 --out person.usdz
  avatar-export --seed 3 --clip walk --clip idle --names mixamo
  avatar-export --seeds 0:1000 --jobs 4 --out crowd
  avatar-export --seed 3 --scene print
  avatar-export --seed 3 --tolerance 0.5mm
  avatar-export --seed 3 --lods 40000,20000,5000,1000
  avatar-export --seed 8 --faces 8000 --texture 512 --pose t --out small.glb
"""


def main(arguments: Sequence[str] | None = None) -> int:
    return run_command(PROGRAM, lambda: export_avatar(parse(arguments)))


def parse(arguments: Sequence[str] | None) -> Namespace:
    """The options as given; build settings that were left out stay None: BuildConfig has the defaults."""
    parser = OneLineParser(
        PROGRAM,
        description=DESCRIPTION,
        examples=EXAMPLES,
    )
    add = parser.add_argument
    add(
        "--seed",
        type=whole_number(0, LARGEST_SEED),
        metavar="N",
        help="which person; the same seed gives the same file",
    )
    add(
        "--seeds",
        type=seed_range,
        metavar="A:B",
        help="instead of one: seeds A to B - 1, into the folder --out; the same command resumes",
    )
    add("--jobs", type=whole_number(1, 1000), metavar="N", help="how many processes make them (1)")
    add("--ray", metavar="ADDRESS", help="make them on this Ray cluster (auto, HOST:PORT or ray://HOST:PORT)")
    add(
        "--format",
        type=format_name,
        metavar="NAME",
        help=f"file format: {', '.join(FORMATS)} (default: the suffix of --out, else glb)",
    )
    add(
        "--out",
        type=Path,
        metavar="FILE",
        help="where to write (default: avatar_SEED.FORMAT here); a folder with --seeds",
    )
    add(
        "--report",
        type=Path,
        metavar="FILE.json",
        help="also write sizes, seconds per stage and error in millimetres",
    )
    add("--preview", type=Path, metavar="FILE.png", help="also write a picture of the avatar")
    add("--dry-run", action="store_true", help="say what would be done and left out, and stop")
    shape = parser.add_argument_group("the asset")
    shape.add_argument(
        "--scene",
        choices=tuple(SCENES),
        default=DEFAULT,
        help=f"what it is for: sets format, resolution, faces, texture and content (default: {DEFAULT})",
    )
    shape.add_argument(
        "--tolerance",
        type=quantity("mm"),
        metavar="0.5mm",
        help="cheapest resolution and faces that keep 99 %% of the surface within it",
    )
    shape.add_argument(
        "--budget",
        type=quantity("s"),
        metavar="5s",
        help="most exact resolution and faces for so many seconds in all",
    )
    shape.add_argument(
        "--content",
        choices=("mesh", "textured", "rigged"),
        help="how much to make (default: as much as scene and format hold)",
    )
    shape.add_argument(
        "--joints",
        choices=("all", "24", "moving"),
        help="24: no fingers; moving: drop joints that move no vertex (default: all, or by --scene)",
    )
    shape.add_argument(
        "--faces",
        type=whole_number(FEWEST_FACES, MOST_FACES),
        metavar="N",
        help=f"triangles wanted, kept within 2 %% (default: {SCENES[DEFAULT].faces}, or by --scene)",
    )
    shape.add_argument(
        "--lods",
        type=falling_numbers,
        metavar="N,N,..",
        help="instead of --faces: triangles of each level of detail, finest first, all in one .glb or .gltf",
    )
    shape.add_argument(
        "--texture",
        type=whole_number(16, 8192),
        metavar="N",
        help=f"width and height of the texture (default: {SCENES[DEFAULT].texture}, or by --scene)",
    )
    shape.add_argument(
        "--normal-map",
        type=whole_number(0, 8192),
        metavar="N",
        help="width and height of a normal map of the finest folds, 0 for none (default: by --scene)",
    )
    shape.add_argument(
        "--ambient-occlusion",
        type=whole_number(0, 8192),
        metavar="N",
        help="width and height of a texture that darkens what little light reaches (default: 0, none)",
    )
    shape.add_argument(
        "--texture-format",
        choices=PICTURES,
        default="png",
        help="how pictures are stored: png (default), jpeg, or webp (glb and gltf alone)",
    )
    shape.add_argument(
        "--compress",
        choices=("none", "quantize"),
        default="none",
        help="quantize: round the mesh's numbers to 8 and 16 bits (glb and gltf alone; default: none)",
    )
    shape.add_argument(
        "--resolution",
        type=whole_number(32, 2048),
        metavar="N",
        help=f"fineness the field is sampled at (default: {SCENES[DEFAULT].resolution}, or by --scene)",
    )
    shape.add_argument(
        "--pose", metavar="x|t|a|FILE.npz", help="rest pose of the skeleton (default: a); vrm wants t"
    )
    add_rig_options(parser.add_argument_group("the rig"))
    model = parser.add_argument_group("the model")
    model.add_argument(
        "--weights", type=Path, metavar="FILE", help="other generator weights than the shipped ones"
    )
    model.add_argument(
        "--body", type=Path, metavar="FILE", help="another body in SMPL's format, .npz or .pkl"
    )
    model.add_argument("--device", default="cpu", metavar="NAME", help="cpu or cuda (default: cpu)")
    parser.add_argument("--version", action="version", version=f"avatargen {__version__}")
    given = parser.parse_args(arguments)
    chosen = [name for name in ("tolerance", "budget") if getattr(given, name) is not None]
    fixed = [name for name in ("resolution", "faces", "lods") if getattr(given, name) is not None]
    if len(chosen) > 1 or (chosen and fixed):
        names = " and ".join(f"--{name}" for name in [*chosen, *fixed])
        raise InputError(f"found {names}; --tolerance and --budget choose, so give one of them alone")
    if given.lods is not None and given.faces is not None:
        raise InputError("found --faces and --lods, whose first number is that of faces; leave out --faces")
    return given


def add_rig_options(group: argparse._ArgumentGroup) -> None:
    """Names, sliders and animations."""
    add = group.add_argument
    add(
        "--names",
        choices=("smpl", "mixamo", "unity", "unreal"),
        default="smpl",
        help="whose names the joints get (default: smpl)",
    )
    add(
        "--bones",
        choices=("along", "world"),
        default="along",
        help="joints' frames: +y along each bone, as modellers draw it, or the world's axes (default: along)",
    )
    add("--ends", action="store_true", help="add joints where head, toes and fingers end; they move nothing")
    add("--morphs", action="store_true", help="add ten body shape sliders, beta_0 to beta_9")
    add(
        "--clip",
        action="append",
        choices=("idle", "walk", "wave", "range"),
        default=[],
        help="add a built-in animation; may be repeated",
    )
    add(
        "--motion",
        action="append",
        type=Path,
        default=[],
        metavar="FILE.npz",
        help="add an animation from an AMASS-style file; may be repeated",
    )
    add("--fps", type=positive_number(1000.0), default=30.0, metavar="N", help="frames a second (30)")
    add(
        "--speed",
        type=positive_number(100.0),
        default=1.0,
        metavar="X",
        help="how fast to play (1)",
    )
    add("--mirror", action="store_true", help="swap left and right in the animations")
    add("--in-place", action="store_true", help="keep the animations over one spot")


def export_avatar(given: Namespace) -> None:
    """Check what can be checked at once, then build and write.

    Raises:
        AvatarGenError: an argument, file or field is bad; then nothing is written.
    """
    if (given.seed is None) == (given.seeds is None):
        raise InputError("the following arguments are required: --seed or --seeds, one of them")
    if given.seeds is not None:
        export_folder(given)
        return
    if given.jobs is not None or given.ray is not None:
        name = "--ray" if given.jobs is None else "--jobs"
        raise InputError(f"found {name} with one seed; give --seeds A:B, or leave it out")
    path = output_path(given)
    if given.preview is not None and given.preview.suffix.lower() != ".png":
        raise InputError(f"found --preview {given.preview}; give a name that ends in .png")
    for output in (path, given.report, given.preview):
        if output is not None:
            check_writable(output)
    check_sources(given)
    with progress_line() as show:
        show("loading libraries", 0.0)
        from avatargen.commands.export.run import run

        closing = run(given, path, show)
    print(closing, file=sys.stdout if given.dry_run else sys.stderr)
    if not given.dry_run:
        print(path)


def export_folder(given: Namespace) -> None:
    """Many seeds into a folder, with a manifest.

    Raises:
        AvatarGenError: an option or file is bad, or a seed has failed; the others' files are there.
    """
    if given.out is None or given.report is not None or given.preview is not None:
        raise InputError("found --seeds, which wants --out FOLDER and takes neither --report nor --preview")
    if given.dry_run or given.budget is not None:
        raise InputError("found --seeds with --dry-run or --budget; both are for one seed, so give --seed")
    check_sources(given)
    from avatargen.commands.export.manifest import NAME
    from avatargen.commands.export.many import export_many

    with progress_line() as show:
        show("starting", 0.0)
        closing = export_many(given, show)
    print(closing, file=sys.stderr)
    print(given.out / NAME)


def check_sources(given: Namespace) -> None:
    """Raises InputError where a file that is to be read is not there."""
    for source in (given.weights, given.body, *given.motion):
        if source is not None and not source.is_file():
            raise InputError(f"found no file {source}; check the path")


def format_name(text: str) -> str:
    """An argument type: a suffix, with or without its dot, in any case."""
    name = text.removeprefix(".").lower()
    if name not in FORMATS:
        raise ArgumentTypeError(f"found {text!r}, wanted one of {', '.join(FORMATS)}")
    return name


def output_path(given: Namespace) -> Path:
    """Where the asset goes: --out and --format must agree, and each can stand in for the other."""
    if given.out is None:
        return Path(f"avatar_{given.seed}.{given.format or SCENES[given.scene].format}")
    if given.out.suffix.lower().removeprefix(".") not in FORMATS:
        raise InputError(f"found --out {given.out}, wanted a name that ends in one of .{', .'.join(FORMATS)}")
    if given.format is not None and given.out.suffix.lower() != f".{given.format}":
        raise InputError(
            f"found --out {given.out} with --format {given.format}; give a name that ends in .{given.format}"
        )
    return given.out


def program() -> NoReturn:
    """The installed command."""
    prefer_ours()
    leave(main())


if __name__ == "__main__":
    program()
