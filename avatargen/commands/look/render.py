"""avatargen render: pictures of a person by seed or file, from chosen sides, in a pose, turning or moving.

Only what bad arguments need is imported at the top.
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from assets.content import MOVING_FACE
from avatargen.atomic import check_writable
from avatargen.commands.line import OneLineParser, clip_name, run_command, whole_number
from avatargen.commands.progress import progress_line
from avatargen.commands.seeds import RANDOM, draw_seed, is_seed
from avatargen.errors import InputError
from avatargen.export.rules import PERSON, check_speech
from avatargen.extras import require_extra
from avatargen.motion.names import BODY_CLIPS, FACE_CLIPS, SAID, animation_name, of_a_face

if TYPE_CHECKING:
    from assets import BuildConfig
    from assets.asset.asset import PlainAsset
    from assets.picture.preview import PreviewConfig

PROGRAM = "avatargen render"
RESTS = ("a", "t", "x")
FILMS = (".gif", ".mp4", ".webp")
EXAMPLES = """\
examples:
  avatargen render 3                                    # avatar_3.png: front, back and face
  avatargen render 3 --pose wave --views quarter --out wave.png
  avatargen render avatar_3.glb --turntable avatar_3.gif
  avatargen render 3 --clip walk --views quarter --out walk.mp4
  avatargen render 3 --say "Hello there" --views face --out hello.webp
  avatargen render me.safetensors --pose wave
"""


@dataclass(frozen=True, kw_only=True)
class Options:
    """Who is drawn, how, and into which files."""

    source: str  # a seed, a .glb file, or one of --save-person
    out: Path | None  # still picture, or film of a clip
    turntable: Path | None
    pose: str | None  # a name, or an .npz file
    clip: str | None
    say: str | None
    rest: str  # pose in which a file rests
    views: str  # names with commas between them
    height: int | None  # pixels
    frames: int  # of a turn
    seconds: int  # of a turn
    fps: int  # of a clip
    wireframe: bool
    transparent: bool
    weights: Path | None
    body: Path | None


def main(arguments: Sequence[str] | None = None) -> int:
    return run_command(PROGRAM, lambda: run(parse(arguments)))


def parse(arguments: Sequence[str] | None) -> Options:
    """Raises InputError where an argument is bad."""
    parser = OneLineParser(
        PROGRAM,
        description="Draw a person, given by seed or as a file, into a picture, a turntable or a film.",
        examples=EXAMPLES,
    )
    add = parser.add_argument
    add(
        "source",
        metavar="SEED|FILE",
        help="which person, random, or a file of avatar-export: .glb, or that of --save-person",
    )
    add(
        "--out",
        type=Path,
        metavar="FILE.png",
        help="still picture, or film with --clip (default: avatar_SEED.png or FILE.png here)",
    )
    add("--turntable", type=Path, metavar="FILE.gif|webp|mp4", help="one turn around the person, as a film")
    add(
        "--pose",
        metavar="NAME|FILE.npz",
        help="a, t, x, stand, walk, wave, sit, fist, spread, point, or a pose file (default: as it rests)",
    )
    add(
        "--clip",
        type=clip_name,
        metavar="CLIP[,CLIP..]",
        help=f"play a built-in clip, on the spot: {', '.join((*BODY_CLIPS, *FACE_CLIPS))}; several at once "
        "as walk,talk",
    )
    add("--say", metavar="TEXT", help="let the mouth say an English text, alone or as --clip idle,say")
    add("--rest", choices=RESTS, default="a", help="the pose a file rests in (default: a)")
    add("--views", default="front,back,face", metavar="LIST", help="front, quarter, left, back, right, face")
    add("--height", type=whole_number(32, 4096), metavar="N", help="pixels (default: 768; turntable: 480)")
    add("--frames", type=whole_number(2, 360), default=36, metavar="N", help="of a turn (default: 36)")
    add("--seconds", type=whole_number(1, 60), default=4, metavar="N", help="of a turn (default: 4)")
    add("--fps", type=whole_number(1, 60), default=25, metavar="N", help="pictures a second (default: 25)")
    add("--wireframe", action="store_true", help="show the triangles")
    add("--transparent", action="store_true", help="no background; the shadow stays")
    add("--weights", type=Path, metavar="FILE", help="other weights than the shipped ones")
    add("--body", type=Path, metavar="FILE", help="another body in SMPL's format")
    options = Options(**vars(parser.parse_args(arguments)))
    check_speech((options.clip,) if options.clip else (), options.say, None)
    return options if options.say is None else replace(options, clip=options.clip or SAID)


def run(given: Options) -> None:
    """Check, get the asset, draw, write; the paths written are printed.

    Raises:
        AvatarGenError: an argument, a file or a field is bad; then nothing is written.
    """
    seed = read_seed(given.source)
    still, film = outputs(given, seed)
    if given.clip and given.pose:
        raise InputError("found --clip and --pose, of which each decides how the person stands; give one")
    check_output(still, FILMS if given.clip else (".png",))
    check_output(film, FILMS)
    from assets.picture.preview import PreviewConfig, render, turntable
    from avatargen.atomic import write_together
    from exporters.film import FILMS as ENCODERS
    from exporters.png import encode_png

    def config(height: int) -> PreviewConfig:
        return PreviewConfig(
            height=given.height or height,
            views=tuple(given.views.split(",")),
            wireframe=given.wireframe,
            transparent=given.transparent,
        )

    config(32)  # complains before the work
    files: list[tuple[Path, bytes]] = []
    with progress_line() as show:
        show("reading" if seed is None else "building", 0.0)
        asset = in_pose(load(given, seed), given)
        show("drawing", 0.5)
        if still is not None and given.clip:
            files.append((still, play(asset, given.clip, given, still.suffix.lower(), config(480))))
        elif still is not None:
            files.append((still, encode_png(render(asset, config(768)))))
        if film is not None:
            frames = turntable(asset, given.frames, config(480))
            files.append((film, ENCODERS[film.suffix.lower()](frames, float(given.seconds))))
    write_together(files)
    for path, _ in files:
        print(path)


def check_output(path: Path | None, suffixes: Sequence[str]) -> None:
    """Raises InputError where a file of that name cannot be made, or not there."""
    if path is None:
        return
    if path.suffix.lower() not in suffixes:
        raise InputError(f"found {path}; give a name that ends in {' or '.join(suffixes)}")
    if path.suffix.lower() == ".mp4":
        require_extra("av")
    check_writable(path)


def read_seed(source: str) -> int | None:
    """The seed, or None where the source is a file.

    Raises:
        InputError: it is neither.
    """
    if source == RANDOM:
        return draw_seed()
    if is_seed(source):
        return int(source)
    if Path(source).suffix.lower() not in (".glb", PERSON) or not Path(source).is_file():
        raise InputError(f"found {source!r}, which is no seed and no .glb file; give one of them")
    return None


def outputs(given: Options, seed: int | None) -> tuple[Path | None, Path | None]:
    """Where the still picture and the film go; with neither named, a still picture here."""
    if given.out is None and given.turntable is None:
        stem = Path(given.source).stem if seed is None else f"avatar_{seed}"
        return Path(f"{stem}_{animation_name(given.clip)}.webp" if given.clip else f"{stem}.png"), None
    return given.out, given.turntable


def load(given: Options, seed: int | None) -> "PlainAsset":
    """The person, built or read."""
    if seed is None:
        path = Path(given.source)
        return read_kept(given, path) if path.suffix.lower() == PERSON else read_rigged(given, path)
    from assets import build
    from avatargen import load_generator

    if given.source == RANDOM:
        print(f"seed {seed} was drawn", file=sys.stderr)
    sampler = load_generator(given.weights, body=given.body)
    return build(sampler.sample(seed), settings(given))


def settings(given: Options) -> "BuildConfig":
    """What is built: a face that moves where one is to."""
    from assets import BuildConfig

    face = MOVING_FACE if of_a_face([given.clip] if given.clip else []) else "none"
    return BuildConfig(pose=given.rest, face=face)


def read_rigged(given: Options, path: Path) -> "PlainAsset":
    """The person of a .glb file."""
    from exporters.read_glb import read_glb

    return read_glb(path, given.rest)


def read_kept(given: Options, path: Path) -> "PlainAsset":
    """The person of a file that --save-person wrote, built."""
    from assets import build
    from avatargen.export.people import Photographed
    from avatargen.export.request import ExportRequest
    from avatargen.export.saved_people import open_saved

    people = open_saved(ExportRequest(seeds=0, person=path, weights=given.weights, body=given.body), path)
    asset = build(people.sample(0), settings(given))
    return people.painted(asset) if isinstance(people, Photographed) else asset


def play(asset: "PlainAsset", clip: str, given: Options, suffix: str, config: "PreviewConfig") -> bytes:
    """The clip as a film. Its last moment is its first and is left out, so that it plays for ever.

    Raises:
        InputError: there is no skeleton, or it lacks a joint or the face a shape that the clip moves.
    """
    import numpy as np

    from assets.asset.animate import animate
    from assets.asset.asset import Asset
    from assets.picture.play import pictures
    from avatargen.export.motions import make_clips, what_is_said
    from avatargen.motion.motion import in_place, sampled
    from exporters.film import FILMS as ENCODERS

    if not isinstance(asset, Asset):
        raise InputError(f"found --clip for {given.source}, which has no skeleton; leave the clip out")
    (motion,) = make_clips([clip], what_is_said(given.say, None), asset)
    times = np.linspace(0, motion.seconds, max(2, round(motion.seconds * given.fps) + 1))
    motion = sampled(in_place(motion), times, times)
    (animation,) = animate(asset, [motion], on_ground=False).animations
    frames = pictures(asset, animation, config)[:-1]
    return ENCODERS[suffix](frames, motion.seconds)


def in_pose(asset: "PlainAsset", given: Options) -> "PlainAsset":
    """The person in the pose asked for.

    Raises:
        InputError: no such pose, or no skeleton.
    """
    if given.pose is None:
        return asset
    from assets.asset.asset import Asset
    from assets.asset.posed import posed
    from avatargen.body.pose import load_pose
    from avatargen.body.stance import limb_rotations, stance

    if not isinstance(asset, Asset):
        raise InputError(f"found --pose for {given.source}, which has no skeleton; leave the pose out")
    names = asset.skeleton.joint_names
    if given.pose.lower().endswith(".npz"):
        return posed(asset, load_pose(given.pose, names))
    return posed(asset, limb_rotations(stance(given.pose.lower()), names))
