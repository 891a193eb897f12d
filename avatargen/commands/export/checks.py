"""What can be told of the options of avatar-export before libraries load: whether they go together, and
whether the files that they name can be read and written.
"""

from argparse import Namespace
from dataclasses import fields
from pathlib import Path
from typing import Any

from assets.scenes import SCENES
from avatargen.atomic import check_writable
from avatargen.errors import InputError
from avatargen.export.rules import (
    check_chosen,
    check_one_or_many,
    check_sheet,
    check_source,
    check_speech,
    check_text,
)
from avatargen.wardrobe.choosing import Traits, read_traits, traits_of

# what `exporters` writes, which takes seconds to ask
FORMATS = ("glb", "gltf", "vrm", "usda", "usdc", "usdz", "obj", "ply", "stl")
DESCRIBED = 0  # the seed of somebody who is described, where none is given
NAMED_POSES = ("x", "t", "a")
PHOTO_POSE = "photo"


def check_options(options: Namespace) -> None:
    """All that can be told before libraries load. Raises InputError."""
    check_who(options)
    many = options.seeds is not None
    fixed = tuple(name for name in ("resolution", "faces", "lods") if getattr(options, name) is not None)
    check_chosen(tolerance_mm=options.tolerance_mm, budget_s=options.budget_s, fixed=fixed)
    if options.lods is not None and options.faces is not None:
        raise InputError("found --faces and --lods, whose first number is that of faces; leave out --faces")
    check_one_or_many(
        many=many,
        jobs=options.jobs,
        ray=options.ray,
        out=options.out,
        report=options.report,
        preview=options.preview,
        dry_run=options.dry_run,
        budget_s=options.budget_s,
        sheet=options.sheet,
    )
    check_sheet(options.sheet, len(options.seeds) if many else 1)
    options.traits = chosen_traits(options)
    check_source(
        source=options.source,
        wardrobe=options.wardrobe,
        weights=options.weights,
        chosen=bool(options.traits.given()) or options.text is not None,
    )
    check_speech(options.clips or (), options.say, options.phonemes)
    options.format = output_format(options)
    sheet_inside = many and options.sheet is not None and options.sheet.parent == options.out
    files = [*(options.photos or ()), *([] if options.person is None else [options.person])]
    name = files[0].stem if files else f"avatar_{options.seed}"
    outputs = () if many else (options.out or Path(f"{name}.{options.format}"),)
    for output in (
        *outputs,
        options.report,
        options.preview,
        options.save_person,
        None if sheet_inside else options.sheet,
    ):
        if output is not None:
            check_writable(output)
    sources = (options.weights, options.body, options.mask, *(options.motions or ()), *files)
    for source in (*sources, options.phonemes):
        if source is not None and not source.is_file():
            raise InputError(f"found no file {source}; check the path")
    if (
        options.pose is not None
        and options.pose.lower() not in (*NAMED_POSES, PHOTO_POSE)
        and not Path(options.pose).is_file()
    ):
        raise InputError(
            f"found --pose {options.pose}, wanted one of {', '.join(NAMED_POSES)} or an .npz file that exists"
        )


def check_who(options: Namespace) -> None:
    """A seed, seeds, a line of text, photographs or a file say who it is. A text that changes somebody needs
    a seed, and a name that is not that of the seed's own file. Raises InputError.
    """
    check_text(options.text, change=options.change)
    if options.change and options.out is None:
        raise InputError("found no --out; name the file for the person who is changed")
    shown = options.photos or options.person is not None
    described = shown or (options.text is not None and not options.change)
    if described and options.seed is None and options.seeds is None:
        options.seed = DESCRIBED
    if options.seed is not None and options.seeds is not None:
        raise InputError("found --seed with --seeds; give one of them")
    if options.seed is None and options.seeds is None:
        others = "or --seeds" if options.change else "or --seeds, --text, --photo or --person"
        raise InputError(f"found nobody to make; give a seed, as in --seed 3, {others}")
    if options.photos and options.seed != DESCRIBED:
        raise InputError("found --photo with a seed; the photograph shows who it is, so leave the seed out")
    if options.person is not None and options.seed != DESCRIBED:
        raise InputError("found --person with a seed; the file says who it is, so leave the seed out")


def chosen_traits(options: Namespace) -> Traits:
    """The traits of the file, and over them those of the options. Raises InputError."""
    found = read_traits(options.traits_file).given() if options.traits_file else {}
    return traits_of(found | given(Traits, options))


def output_format(options: Namespace) -> str:
    """--out and --format must agree, and each can stand in for the other."""
    if options.out is None or options.seeds is not None:
        return options.format or SCENES[options.scene].format
    suffix = options.out.suffix.lower().removeprefix(".")
    if suffix not in FORMATS:
        raise InputError(
            f"found --out {options.out}, wanted a name that ends in one of .{', .'.join(FORMATS)}"
        )
    if options.format is not None and suffix != options.format:
        raise InputError(
            f"found --out {options.out} with --format {options.format}; give a name that ends in "
            f".{options.format}"
        )
    return suffix


def given(group: type, options: Namespace) -> dict[str, Any]:
    """The options that are fields of a group of settings and were not left out."""
    found = {each.name: getattr(options, each.name, None) for each in fields(group)}
    return {
        name: tuple(value) if isinstance(value, list) else value
        for name, value in found.items()
        if value is not None
    }
