"""avatargen train people: learn the garments, hair and skins of an artist-made wardrobe; the same command
resumes."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from avatargen.commands.line import parse_options, run_command
from avatargen.training.dressed.run import PeopleConfig

PROGRAM = "avatargen train people"


@dataclass(frozen=True, kw_only=True)
class Options:
    """Learn a generator of dressed people from a folder of MakeHuman's assets. Run the same command again to
    resume; several may share a run, each with garments of its own."""

    wardrobe: Path
    """Folder of MakeHuman's assets: clothes, hair, eyebrows, eyelashes, eyes, skins."""
    out: Path
    """Folder of the run."""
    garments: tuple[str, ...] = ()
    """Learn these alone; all of them where none is named."""
    folder_alone: bool = False
    """Learn the folder's garments without those that are sewn in code."""
    training: PeopleConfig = field(default_factory=PeopleConfig)


def main(arguments: Sequence[str] | None = None) -> int:
    return run_command(PROGRAM, lambda: run(parse_options(PROGRAM, Options, arguments)))


def run(options: Options) -> None:
    """Fit the wardrobe to the default body and learn it."""
    from avatargen.body.load import load_body
    from avatargen.body.model import canonical_body
    from avatargen.shipped import shipped
    from avatargen.training.dressed.run import train
    from avatargen.wardrobe.makehuman.person import Wardrobe
    from avatargen.wardrobe.tailored.collection import PATTERNS

    patterns = {} if options.folder_alone else PATTERNS
    wardrobe = Wardrobe(options.wardrobe, canonical_body(load_body(shipped("body.npz"))), patterns)
    names = options.garments or None
    notes = {"licence": "CC0-1.0", "source": "MakeHuman assets (CC0)"}
    if train(wardrobe, options.training, options.out, names, print, notes):
        print(options.out / "generator.safetensors")
    else:
        print(f"{options.out}: some garments are not learned yet; run without --garments to learn all")
