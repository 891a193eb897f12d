"""avatargen eval likeness: a generator's people against the wardrobe's own of the same seeds.

avatargen eval likeness --wardrobe makehuman --out likeness.json --people 16
"""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from avatargen.commands.line import parse_options, run_command
from avatargen.errors import InputError

if TYPE_CHECKING:
    import numpy as np

    from assets.build_config import AvatarFields
    from avatargen.metrics.likeness import FieldLikeness, PictureLikeness

PROGRAM = "avatargen eval likeness"
VIEWS = ("front", "back", "face")
Rows = list[list[Any]]  # pictures by view, of the learned person and of the wardrobe's own
FIRST_SEED = 500_000_000  # training draws its people from small seeds: these it has never seen
POOL_SEED = 991  # of places that no training has


@dataclass(frozen=True, kw_only=True)
class Options:
    """Measure people by their fields near the surface and by pictures, on the body of the wardrobe's own
    person."""

    out: Path
    """The .json file to write."""
    wardrobe: Path | None = None
    """Folder of the artist-made wardrobe that dressed people were learned from; the procedural one where none
    is given."""
    weights: Path | None = None
    """Other weights than those that come with the package for that wardrobe."""
    people: int = 16
    """How many."""
    first_seed: int = FIRST_SEED
    """Of the people; small seeds may be people that training has met."""
    points: int = 30_000
    """Around the body, at which fields are compared."""
    height: int = 512
    """Of the pictures, pixels; 0 leaves them out."""
    pictures: Path | None = None
    """Folder for the pictures themselves: learned above the wardrobe's own."""


def main(arguments: Sequence[str] | None = None) -> int:
    return run_command(PROGRAM, lambda: run(parse_options(PROGRAM, Options, arguments)))


def check(options: Options) -> None:
    """Raise InputError for a value out of range."""
    if options.out.suffix != ".json":
        raise InputError(f"found --out {options.out}; give a name that ends in .json")
    if (
        options.people < 1
        or options.points < 1000
        or not (options.height == 0 or 32 <= options.height <= 4096)
    ):
        raise InputError(
            f"found --people {options.people}, --points {options.points}, --height {options.height}; "
            "give at least 1, at least 1000, and 0 or 32 to 4096"
        )


def run(options: Options) -> None:
    """Measure person by person, print, write."""
    from avatargen import load_generator
    from avatargen.artist_wardrobe import ArtistWardrobe
    from avatargen.atomic import check_writable, write_together
    from avatargen.metrics.likeness import field_likeness
    from avatargen.shipped import shipped
    from avatargen.training.pool import make_pool
    from avatargen.wardrobe.procedural import ProceduralWardrobe
    from exporters.png import encode_png

    check(options)
    check_writable(options.out)
    shipped_for = shipped("generator.safetensors" if options.wardrobe is None else "people.safetensors")
    sampler = load_generator(options.weights or shipped_for)
    wardrobe = (
        ProceduralWardrobe(sampler.body)
        if options.wardrobe is None
        else ArtistWardrobe(options.wardrobe, sampler.body)
    )
    points = make_pool(sampler.body, options.points, POOL_SEED).p
    people: list[tuple[FieldLikeness, list[PictureLikeness]]] = []
    files: list[tuple[Path, bytes]] = []
    seen: list[Rows] = []
    for seed in range(options.first_seed, options.first_seed + options.people):
        truth, learned = wardrobe.sample(seed), sampler.sample(seed)
        fields, pictures = field_likeness(learned, truth, points), []
        if options.height:
            same_body = replace(learned, betas=truth.betas)
            pictures, rows = compared(same_body, truth, options.height)
            seen.append(rows)
            if options.pictures is not None:
                files.append((options.pictures / f"{seed}.png", encode_png(laid_out(rows))))
        people.append((fields, pictures))
        print(line_of(fields, pictures), flush=True)
    facts = {"weights_hash": sampler.weights_hash, "people": len(people), "first_seed": options.first_seed}
    if options.pictures is not None:
        options.pictures.mkdir(parents=True, exist_ok=True)
    text = json.dumps(facts | summary(people) | {"realism": as_sets(seen)}, indent=1) + "\n"
    write_together([*files, (options.out, text.encode())])
    print(options.out)


def compared(
    learned: "AvatarFields", truth: "AvatarFields", height: int
) -> "tuple[list[PictureLikeness], Rows]":
    """Both people built and seen by the cameras of the wardrobe's own; and the pictures, learned first."""
    from assets import BuildConfig, build
    from assets.picture.camera import view_camera
    from assets.picture.preview import PreviewConfig, light_up, render_view
    from avatargen.metrics.likeness import picture_likeness

    config = PreviewConfig(height=height, views=VIEWS, transparent=True)
    assets = [build(avatar, BuildConfig()) for avatar in (learned, truth)]
    cameras = [view_camera(assets[1], view) for view in VIEWS]
    rows = [[render_view(lit, camera, config) for camera in cameras] for lit in map(light_up, assets)]
    found = [picture_likeness(view, a, b) for view, a, b in zip(VIEWS, *rows, strict=True)]
    return found, rows


def laid_out(rows: Rows) -> "np.ndarray":
    """One picture of all, learned above."""
    import numpy as np

    return np.concatenate([np.concatenate(row, axis=1) for row in rows], axis=0)


def as_sets(seen: list[Rows]) -> dict[str, Any]:
    """By view, network and distance how far the learned pictures are from the wardrobe's, and how far its own
    are from one another; nothing of too few people."""
    from avatargen.metrics.judges import feature_judges
    from avatargen.metrics.realism import FEWEST, realism

    found: dict[str, Any] = {}
    if len(seen) < FEWEST:
        return found
    for column, view in enumerate(VIEWS):
        learned, truth = ([rows[who][column] for rows in seen] for who in (0, 1))
        for judge in feature_judges():
            for name, two in realism(judge, learned, truth).items():
                told = {who: number and asdict(number) for who, number in two.items()}
                found.setdefault(view, {})[name] = told
    return found


def line_of(fields: "FieldLikeness", pictures: "list[PictureLikeness]") -> str:
    """What is printed of a person."""
    seen = "  ".join(f"{p.view} {p.psnr_db:.1f} dB" for p in pictures)
    return f"seed {fields.seed}: {fields.sdf_mm:.3f} mm, colour {fields.colour_l1:.4f}  {seen}".rstrip()


def summary(people: "list[tuple[FieldLikeness, list[PictureLikeness]]]") -> dict[str, Any]:
    """Means over people, by view and by pattern, and each person's own."""
    from statistics import fmean

    from avatargen.metrics.likeness import by_pattern

    fields = [person for person, _ in people]
    pictures = [picture for _, of_one in people for picture in of_one]

    def means(chosen: "list[PictureLikeness]") -> dict[str, float | None]:
        return {
            "psnr_db": fmean(p.psnr_db for p in chosen) if chosen else None,
            "ssim": fmean(p.ssim for p in chosen) if chosen else None,
        }

    whole = means([p for p in pictures if p.view != "face"])
    return {
        "sdf_mm": fmean(person.sdf_mm for person in fields),
        "colour_l1": fmean(person.colour_l1 for person in fields),
        "picture_psnr_db": whole["psnr_db"],
        "picture_ssim": whole["ssim"],
        "views": {view: means([p for p in pictures if p.view == view]) for view in VIEWS},
        "patterns": by_pattern(fields),
        "each": [
            asdict(person) | {p.view: {"psnr_db": p.psnr_db, "ssim": p.ssim} for p in of_one}
            for person, of_one in people
        ],
    }
