"""The options of avatar-export, and the request that they make.

An option goes to the field that has its `dest` as its name: of `ExportRequest`, or of the `BuildConfig`
inside. So an option more is a field there and an `add` here; help says the field's default, as options that
are left out stay None. Only what `--help` and bad arguments need is imported before the arguments are read.
"""

from argparse import ArgumentParser, ArgumentTypeError, Namespace, _ArgumentGroup
from collections.abc import Sequence
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

from assets.scenes import DEFAULT, SCENES
from avatargen import __version__
from avatargen.commands.export import PROGRAM
from avatargen.commands.export.checks import FORMATS, NAMED_POSES, PHOTO_POSE, check_options, given
from avatargen.commands.export.who_options import add_person_options, add_photo_options, add_trait_options
from avatargen.commands.line import (
    FEWEST_FACES,
    MOST_FACES,
    OneLineParser,
    clip_name,
    falling_numbers,
    positive_number,
    quantity,
    whole_number,
)
from avatargen.commands.seeds import RANDOM, draw_seed
from avatargen.errors import InputError
from avatargen.motion.names import BODY_CLIPS, FACE_CLIPS

if TYPE_CHECKING:
    from avatargen.export.request import ExportRequest

PICTURES = ("png", "jpeg", "webp")
DESCRIPTION = """\
Make one clothed, textured, rigged human from a seed and write it to a file.

The last line on standard output is the path written. Exit status 0 means the file is whole;
bad input ends in one line on standard error, status 2 and no file."""
EXAMPLES = """\
examples:
  avatar-export 3
  avatar-export --seed 3 --format glb
  avatar-export --seed random
  avatar-export --seed 3 --out person.glb --report person.json --preview person.png
  avatar-export --seed 3 --out person.usdz
  avatar-export --seed 3 --clip walk --clip idle --names mixamo
  avatar-export --seed 3 --face shapes --format vrm
  avatar-export --seed 3 --face shapes --say "Hello there" --clip idle,say
  avatar-export --seeds 0:1000 --jobs 4 --out crowd
  avatar-export --seeds 3,5,8,100:120 --out some --sheet some.png
  avatar-export --seed 3 --gender woman --hair long --bottom skirt --height 1.70m
  avatar-export --text "an old man in a grey suit and brown shoes" --format glb
  avatar-export --seed 3 --parts separate --out dressed.glb
  avatar-export --seed 3 --wear 33:top,outer --wear 5:shoes
  avatar-export --seed 3 --from wardrobe --wardrobe makehuman
  avatar-export --photo me.jpg --height 1.75m --clip walk
  avatar-export --photo me.jpg --save-person me.safetensors
  avatar-export --person me.safetensors --pose t --out me.vrm
  avatar-export --seed 3 --scene print
  avatar-export --seed 3 --tolerance 0.5mm
  avatar-export --seed 3 --lods 40000,20000,5000,1000
  avatar-export --seed 8 --faces 8000 --texture 512 --pose t --out small.glb
"""


EDIT = "avatargen edit"
ABOUT_EDITING = """\
Change a seed's person by a line of text, and write them to a file; what is not named stays as it is.

All else is as avatar-export has it."""
EDITS = """\
examples:
  avatargen edit --seed 3 --text "in a red shirt" --out red.glb
  avatargen edit --seed 3 --text "with black hair and a hat" --out black.glb
  avatargen edit --seeds 0:20 --text "taller, without a jacket" --out tall
"""


def parse(arguments: Sequence[str] | None) -> "ExportRequest":
    """What the arguments ask for.

    Raises:
        InputError: an argument is bad, a file is missing, or things are asked for that do not go together.
    """
    return make_request(read(arguments))


def read(arguments: Sequence[str] | None, *, change: bool = False) -> Namespace:
    """The options, checked as far as can be told before libraries load; a seed is drawn where none is named.
    With `change`, those of `avatargen edit`, whose text says what is to be otherwise of a seed's person.

    Raises:
        InputError: as `parse`.
    """
    options = make_parser(*((EDIT, ABOUT_EDITING, EDITS) if change else ())).parse_intermixed_args(arguments)
    options.change = change
    if options.seed_alone is not None:
        if options.seed is not None:
            raise InputError(f"found {options.seed_alone} and --seed {options.seed}; give one seed")
        options.seed = options.seed_alone
    options.drawn = options.seed == RANDOM
    if options.drawn:
        options.seed = draw_seed()
    check_options(options)
    return options


def make_parser(
    program: str = PROGRAM, description: str = DESCRIPTION, examples: str = EXAMPLES
) -> ArgumentParser:
    parser = OneLineParser(program, description=description, examples=examples)
    add_person_options(parser.add_argument_group("the person"))
    add_photo_options(parser.add_argument_group("a person of photographs instead"))
    add_trait_options(parser.add_argument_group("the person's traits, else as the seed has them"))
    add_file_options(parser.add_argument_group("the files"))
    add_asset_options(parser.add_argument_group("the asset"))
    add_part_options(parser.add_argument_group("its parts"))
    add_picture_options(parser.add_argument_group("its pictures"))
    add_rig_options(parser.add_argument_group("the rig"))
    add_animation_options(parser.add_argument_group("animations"))
    add_work_options(parser.add_argument_group("the work"))
    return parser


def add_file_options(group: _ArgumentGroup) -> None:
    """Where it goes, and how it is encoded."""
    add = group.add_argument
    add(
        "--out",
        type=Path,
        metavar="FILE",
        help="where to write; a folder with --seeds (default: avatar_SEED.FORMAT here)",
    )
    add(
        "--format",
        type=format_name,
        metavar="NAME",
        help=f"file format: {', '.join(FORMATS)} (default: the suffix of --out, else glb)",
    )
    add(
        "--compress",
        choices=("none", "quantize"),
        help="quantize: round the mesh's numbers to 8 and 16 bits, in glb and gltf alone (default: none)",
    )
    add(
        "--report",
        type=Path,
        metavar="FILE.json",
        help="also write sizes, seconds per stage and error in millimetres",
    )
    add("--preview", type=Path, metavar="FILE.png", help="also write a picture of the avatar")
    add(
        "--sheet",
        type=Path,
        metavar="FILE.png",
        help="with --seeds: also write a contact sheet of all, .png or .jpg; their pictures stay in --out",
    )


def add_asset_options(group: _ArgumentGroup) -> None:
    """How much is made, and how fine."""
    add = group.add_argument
    add(
        "--scene",
        choices=tuple(SCENES),
        default=DEFAULT,
        help=f"what it is for: sets format, resolution, faces, texture and content (default: {DEFAULT})",
    )
    add(
        "--content",
        choices=("mesh", "textured", "rigged"),
        help="how much to make (default: as much as scene and format hold)",
    )
    add(
        "--resolution",
        type=whole_number(32, 2048),
        metavar="N",
        help=f"fineness the field is sampled at (default: {SCENES[DEFAULT].resolution}, or by --scene)",
    )
    add(
        "--faces",
        type=whole_number(FEWEST_FACES, MOST_FACES),
        metavar="N",
        help=f"triangles wanted, kept within 2 %% (default: {SCENES[DEFAULT].faces}, or by --scene)",
    )
    add(
        "--lods",
        type=falling_numbers,
        metavar="N,N,..",
        help="instead of --faces: triangles of each level of detail, finest first, all in one .glb or .gltf",
    )
    add(
        "--mesher",
        choices=("adaptive", "marching-cubes"),
        help="how the surface is found; marching-cubes: by scikit-image, every cell (default: adaptive)",
    )
    add(
        "--simplifier",
        choices=("adaptive", "pymeshlab", "fast-simplification"),
        help="whose collapses leave --faces; pymeshlab cleans by its own filters too (default: adaptive)",
    )
    add(
        "--tolerance",
        dest="tolerance_mm",
        type=quantity("mm", "0.5mm"),
        metavar="0.5mm",
        help="cheapest resolution and faces that keep 99 %% of the surface within it",
    )
    add(
        "--budget",
        dest="budget_s",
        type=quantity("s", "5s"),
        metavar="5s",
        help="most exact resolution and faces for so many seconds in all",
    )


def add_part_options(group: _ArgumentGroup) -> None:
    """One mesh or several."""
    add = group.add_argument
    add(
        "--parts",
        choices=("merged", "separate"),
        help="separate: body, each garment and hair are meshes with textures of their own, in glb, vrm and "
        "usdz; the faces are shared out among them (default: merged, one closed mesh)",
    )
    add(
        "--hidden",
        choices=("drop", "keep"),
        help="with --parts separate, what clothes hide of the body: left out and closed up, or kept inside "
        "them (default: drop)",
    )

    add(
        "--part-names",
        choices=("own", "rpm"),
        help="with --parts separate, what its meshes are called; rpm: Wolf3D_Head, Wolf3D_Outfit_Top and so "
        "on, as pages made for Ready Player Me's avatars look for (default: own)",
    )


def add_picture_options(group: _ArgumentGroup) -> None:
    """Textures."""
    add = group.add_argument
    add(
        "--texture",
        type=whole_number(16, 8192),
        metavar="N",
        help=f"width and height of the texture (default: {SCENES[DEFAULT].texture}, or by --scene)",
    )
    add(
        "--normal-map",
        type=whole_number(0, 8192),
        metavar="N",
        help="width and height of a normal map of the finest folds, 0 for none (default: by --scene)",
    )
    add(
        "--ambient-occlusion",
        type=whole_number(0, 8192),
        metavar="N",
        help="width and height of a texture that darkens what little light reaches (default: 0, none)",
    )
    add(
        "--texture-format",
        choices=PICTURES,
        help="how pictures are stored; webp in glb and gltf alone (default: png)",
    )


def add_rig_options(group: _ArgumentGroup) -> None:
    """Skeleton, names and sliders."""
    add = group.add_argument
    add(
        "--pose",
        metavar="x|t|a|photo|FILE.npz",
        help="rest pose; photo: that of the first photograph; vrm wants t (default: a)",
    )
    add(
        "--joints",
        choices=("all", "24", "moving"),
        help="24: no fingers; moving: drop joints that move no vertex (default: all, or by --scene)",
    )
    add(
        "--names",
        choices=("smpl", "mixamo", "unity", "unreal", "rpm"),
        help="whose names the joints get (default: smpl)",
    )
    add(
        "--bones",
        choices=("along", "mixamo", "world"),
        help="joints' frames: +y along each bone, as modellers draw it; mixamo: so, and arms rolled as its "
        "animations want; world: the world's axes (default: along)",
    )
    add("--ends", action="store_true", help="add joints where head, toes and fingers end; they move nothing")
    add(
        "--root",
        action="store_true",
        help="add a bone on the ground that carries the clips' way, and an Armature node",
    )
    add(
        "--twist",
        action="store_true",
        help="add bones that share the roll of upper arms and hands, so that wrists keep their volume",
    )
    add(
        "--springs",
        action="store_true",
        help="add bones along skirts, dresses and long hair, which VRM's programs let sway",
    )
    add("--morphs", action="store_true", help="add ten body shape sliders, beta_0 to beta_9")
    add(
        "--face",
        choices=("none", "shapes"),
        help="shapes: lips and lids open; ARKit's 52 shapes, 15 visemes (default: none, or by --scene)",
    )


def add_animation_options(group: _ArgumentGroup) -> None:
    """What moves, and how it is played."""
    add = group.add_argument
    add(
        "--clip",
        dest="clips",
        action="append",
        type=clip_name,
        metavar="CLIP[,CLIP..]",
        help=f"add a built-in animation: {', '.join(BODY_CLIPS)}; with --face also {', '.join(FACE_CLIPS)}; "
        "several with commas between play at once, as walk,talk; may be repeated",
    )
    add(
        "--say",
        metavar="TEXT",
        help="with --face: add an animation `say` of a mouth that says this English text",
    )
    add(
        "--phonemes",
        type=Path,
        metavar="FILE.json",
        help="instead of --say: sounds with their times, as a speech program tells them",
    )
    add(
        "--motion",
        dest="motions",
        action="append",
        type=Path,
        metavar="FILE.npz",
        help="add an animation from an AMASS-style file, .npz or .pkl; may be repeated",
    )
    add(
        "--motion-up",
        choices=("y", "z"),
        help="upward axis of the motion files; left out, the one along which people stand in them",
    )
    add("--fps", type=positive_number(1000.0), metavar="N", help="frames a second (default: 30)")
    add("--speed", type=positive_number(100.0), metavar="X", help="how fast to play (default: 1)")
    add("--mirror", action="store_true", help="swap left and right in the animations")
    add("--in-place", action="store_true", help="keep the animations over one spot")


def add_work_options(group: _ArgumentGroup) -> None:
    """How it is made."""
    add = group.add_argument
    add("--device", metavar="NAME", help="cpu or cuda (default: cpu)")
    add(
        "--jobs",
        type=whole_number(1, 1000),
        metavar="N",
        help="how many processes make --seeds (default: 1, with --ray all)",
    )
    add(
        "--ray",
        metavar="ADDRESS",
        help="make --seeds on this Ray cluster (auto, HOST:PORT or ray://HOST:PORT)",
    )
    add("--quiet", action="store_true", help="say nothing but the path written and what went wrong")
    add("--dry-run", action="store_true", help="say what would be done and left out, and stop")
    add("--version", action="version", version=f"avatargen {__version__}")


def make_request(options: Namespace) -> "ExportRequest":
    """The request of checked options. Those that are no field by themselves are told what field they are."""
    from assets.build_config import BuildConfig
    from avatargen.export.request import ExportRequest
    from avatargen.export.settings import settings_for
    from exporters import find_format
    from exporters.encoding import Encoding

    options.seeds = options.seed if options.seeds is None else options.seeds
    if options.wear is not None:
        options.wear = tuple(sorted(chain(*options.wear)))
    if options.lods is not None:
        options.faces, *options.levels = options.lods
    options.photo_pose = options.pose is not None and options.pose.lower() == PHOTO_POSE
    if options.photo_pose:
        options.pose = None
    elif options.pose is not None and options.pose.lower() in NAMED_POSES:
        options.pose = options.pose.lower()
    elif options.pose is not None:
        options.pose, options.pose_file = None, Path(options.pose)
    units = find_format(f"avatar.{options.format}").units
    return ExportRequest(
        build=settings_for(options.scene, options.format, **given(BuildConfig, options)),
        encoding=Encoding(
            pictures=options.texture_format or "png",
            quantize=options.compress == "quantize",
            for_slicers=SCENES[options.scene].for_slicers and not units,
        ),
        **given(ExportRequest, options),
    )


def format_name(text: str) -> str:
    """An argument type: a suffix, with or without its dot, in any case."""
    name = text.removeprefix(".").lower()
    if name not in FORMATS:
        raise ArgumentTypeError(f"found {text!r}, wanted one of {', '.join(FORMATS)}")
    return name
