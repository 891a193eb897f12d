"""avatargen eval photo: people found again in pictures of people whose pose, shape and surface are known.

avatargen eval photo --people 50 --out photo.json --sheet photo.png
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from avatargen.commands.line import parse_options, run_command
from avatargen.errors import InputError
from avatargen.extras import require_extra

PROGRAM = "avatargen eval photo"
FIRST_SEED = 700_000_000  # far from the people by whom anything was tuned
STRIPS = "people"  # in names of the folder beside a sheet


@dataclass(frozen=True, kw_only=True)
class Options:
    """Photograph people of the generator, in a pose and a light of their seed's, find each in the one picture
    as avatar-export --photo does, and measure how far off that is. The same command resumes."""

    out: Path
    """The .json file to write; it grows person by person."""
    people: int = 50
    """How many."""
    first_seed: int = FIRST_SEED
    """Of the people."""
    weights: Path | None = None
    """Other weights of dressed people than those that come with the package."""
    sheet: Path | None = None
    """The .png file of pictures to write: the photograph, who was found, and both from other sides. A
    folder beside it keeps each person's."""
    plot: Path | None = None
    """The .png file to draw errors against seconds into, stage by stage."""


def main(arguments: Sequence[str] | None = None) -> int:
    return run_command(PROGRAM, lambda: run(parse_options(PROGRAM, Options, arguments)))


def check(options: Options) -> None:
    """Raise InputError for a value out of range."""
    from avatargen.ranges import require_ranges

    require_ranges(options, "eval photo", {"people": (1, 10**6), "first_seed": (0, 2**62)})
    if options.out.suffix != ".json":
        raise InputError(f"found --out {options.out}; give a name that ends in .json")
    for name, path in (("sheet", options.sheet), ("plot", options.plot)):
        if path is not None and path.suffix != ".png":
            raise InputError(f"found --{name} {path}; give a name that ends in .png")
    if options.plot is not None:
        require_extra("matplotlib")


def run(options: Options) -> None:
    """Measure person by person, print, write."""
    from avatargen import load_generator
    from avatargen.atomic import check_writable, write_atomically, write_together
    from avatargen.commands.learn.photo_plot import draw
    from avatargen.commands.learn.photo_trial import Trial
    from avatargen.metrics.photo_error import from_json, summary, table, to_json
    from avatargen.photo.seeing.see import open_eyes
    from exporters.png import encode_png

    check(options)
    for path in (options.out, options.sheet, options.plot):
        if path is not None:
            check_writable(path)
    eyes = open_eyes()
    sampler = load_generator(options.weights)
    settings = {"weights_hash": sampler.weights_hash, "first_seed": options.first_seed}
    done = from_json(options.out.read_bytes(), settings, str(options.out)) if options.out.exists() else []
    people, trial = {person.seed: person for person in done}, Trial(sampler, eyes)
    seeds = range(options.first_seed, options.first_seed + options.people)
    for seed in seeds:
        if seed in people:
            continue
        people[seed], strip = trial.of(seed)
        files = [(options.out, to_json(settings, list(people.values())))]
        if options.sheet is not None and strip is not None:
            path = strip_of(options.sheet, seed)
            path.parent.mkdir(exist_ok=True)
            files.insert(0, (path, encode_png(strip)))
        write_together(files)
        print(people[seed].line(), flush=True)
    told = summary([people[seed] for seed in seeds])
    print(table(told))
    if options.plot is not None:
        write_atomically(options.plot, draw(told["stages"]))
    if options.sheet is not None:
        write_sheet(options.sheet, seeds)
    print(options.out)


def strip_of(sheet: Path, seed: int) -> Path:
    """Where a person's pictures are."""
    return sheet.parent / f"{sheet.stem}_{STRIPS}" / f"{seed}.png"


def write_sheet(sheet: Path, seeds: range) -> None:
    """All people that there are pictures of, one under the other."""
    import numpy as np
    from PIL import Image

    from avatargen.atomic import write_atomically
    from exporters.png import encode_png

    strips = [np.asarray(Image.open(path)) for seed in seeds if (path := strip_of(sheet, seed)).exists()]
    if strips:
        write_atomically(sheet, encode_png(np.concatenate(strips)))
