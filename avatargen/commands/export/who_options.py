"""The options of avatar-export that say who is made: a seed, traits, a line of text or photographs."""

from argparse import ArgumentTypeError, _ArgumentGroup
from dataclasses import fields
from pathlib import Path

from avatargen.commands.line import quantity
from avatargen.commands.near import did_you_mean
from avatargen.commands.seeds import LENT, borrowed, many_seeds, one_seed
from avatargen.wardrobe.choosing import ANY, CLOTH, HEIGHT, SHOWN, Traits, any_colour, shown, values_of
from avatargen.wardrobe.named_colours import named


def add_person_options(group: _ArgumentGroup) -> None:
    """Who is made."""
    add = group.add_argument
    add("seed_alone", nargs="?", type=one_seed, metavar="SEED", help="the same as --seed SEED")
    add(
        "--seed",
        type=one_seed,
        metavar="N",
        help="which person; the same seed gives the same file; random: one is drawn, and told",
    )
    add(
        "--seeds",
        type=many_seeds,
        metavar="A:B,N,..",
        help="instead of one: seeds A to B - 1, N, .., into the folder --out; the same command resumes",
    )
    add(
        "--from",
        dest="source",
        choices=("generator", "wardrobe"),
        help="whose person: the generator's, or the wardrobe's, which it learns from (default: generator)",
    )
    add(
        "--wardrobe",
        type=Path,
        metavar="DIR",
        help="with --from wardrobe: a folder of MakeHuman's assets to wear (default: the procedural clothes)",
    )
    add(
        "--wear",
        action="append",
        type=borrowed,
        metavar="SEED:GARMENT,..",
        help=f"garments of another seed, of {', '.join(LENT)}; may be repeated",
    )
    add(
        "--person",
        type=Path,
        metavar="FILE",
        help="instead of a seed: the person of a file that --save-person wrote",
    )
    add(
        "--save-person",
        type=Path,
        metavar="FILE.safetensors",
        help="also keep the person in a small file; of photographs with the pixels that are on the texture",
    )
    add("--weights", type=Path, metavar="FILE", help="other generator weights than the shipped ones")
    add("--body", type=Path, metavar="FILE", help="another body in SMPL's format, .npz or .pkl")


def add_photo_options(group: _ArgumentGroup) -> None:
    """Who is made, and how much of the photographs is taken over."""
    add = group.add_argument
    add(
        "--photo",
        dest="photos",
        action="append",
        type=Path,
        metavar="FILE",
        help="a photograph of one whole person; may be repeated for the same person; --gender, --age and "
        "--height can be told",
    )
    add(
        "--mask",
        type=Path,
        metavar="FILE.png",
        help="where the person is in the one photograph, white on black (default: found by the networks)",
    )
    add(
        "--texture-from",
        choices=("photo", "field"),
        help="photo: the photograph's own pixels where it shows the person well; field: its colours alone "
        "(default: photo)",
    )


def add_trait_options(group: _ArgumentGroup) -> None:
    """What is chosen of the person."""
    group.add_argument(
        "--text",
        metavar="LINE",
        help="a person in plain words; --seed (0 where none is given) varies who it is; traits beside it win",
    )
    for name in (each.name for each in fields(Traits) if each.name != HEIGHT):
        values, here = values_of(name), SHOWN.get(name, ())
        others = [value for value in values if value not in here]
        told = f"with the procedural people of other weights alone: {', '.join(others)}" if others else ""
        if name in ANY:
            told = f"{', '.join(here)}, or another colour's name or #rrggbb"
            group.add_argument(f"--{shown(name)}", type=colour, metavar="COLOR", help=told)
        else:
            group.add_argument(f"--{shown(name)}", choices=values, help=told)
    group.add_argument(
        "--height",
        type=quantity("m", "1.75m"),
        metavar="1.75m",
        help="of the body, crown of the head to the soles, 1.40 to 2.10 m",
    )
    group.add_argument(
        "--traits",
        dest="traits_file",
        type=Path,
        metavar="FILE.json",
        help='names and values, such as {"hair": "long"}; options beside it win',
    )


def colour(text: str) -> str:
    """An argument type: a colour's name, or #rrggbb."""
    name = text.lower()
    if not any_colour(name):
        hint = did_you_mean(name, (*CLOTH, *named()))
        raise ArgumentTypeError(
            f"found {text!r}, wanted a colour such as red, navy, olive green or #7a1f2b{hint}"
        )
    return name
