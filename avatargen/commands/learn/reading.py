"""avatargen eval reading: what people's pictures say they wear, against what their files say.

avatargen survey --out survey --count 200 --height 512
avatargen eval reading --people survey --out reading.json
"""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from avatargen.commands.line import parse_options, run_command
from avatargen.errors import InputError

if TYPE_CHECKING:
    from avatargen.metrics.reading import Pictured

PROGRAM = "avatargen eval reading"


@dataclass(frozen=True, kw_only=True)
class Options:
    """Read garments, patterns, hair and eyes off pictures by a linear reader on features of a pretrained
    network, ten times, each time a tenth of the people by a reader made from the others. Prints how many are
    right, and writes it as JSON."""

    people: tuple[Path, ...]
    """Folders of `avatargen survey`."""
    out: Path
    """The .json file to write."""


def main(arguments: Sequence[str] | None = None) -> int:
    return run_command(PROGRAM, lambda: run(parse_options(PROGRAM, Options, arguments)))


def run(options: Options) -> None:
    """Load, read, print, write.

    Raises:
        InputError: the network is not installed, a folder holds no pictures beside files, or too few.
    """
    from avatargen.atomic import check_writable, write_atomically
    from avatargen.metrics.pretrained import dino_places, network_path, read_network
    from avatargen.metrics.reading import read_all

    check_writable(options.out)
    read_network(network_path())
    people = [person for folder in options.people for person in pictured(folder)]
    found = read_all(people, dino_places)
    for name, trait in found.items():
        wrong = ", ".join(f"{a} for {b}" for a, b in trait.taken)
        print(f"{name}: {100 * trait.right.value:.1f} % of {trait.right.count} right; took {wrong or 'none'}")
    facts = {"people": len(people), "traits": {name: asdict(trait) for name, trait in found.items()}}
    write_atomically(options.out, json.dumps(facts, indent=1).encode() + b"\n")
    print(options.out)


def pictured(folder: Path) -> "list[Pictured]":
    """The people of a survey, by seed."""
    import numpy as np
    from PIL import Image

    from avatargen.metrics.reading import Pictured
    from exporters.read_glb import read_glb

    found: list[Pictured] = []
    for path in sorted(folder.glob("avatar_*.glb")):
        picture = path.with_suffix(".png")
        if picture.exists():
            words = {name: str(value) for name, value in read_glb(path).info.facts}
            found.append(Pictured(picture=np.asarray(Image.open(picture).convert("RGB")), words=words))
    if not found:
        raise InputError(
            f"eval: found no picture beside a file in {folder}; make both by survey with --height 512"
        )
    return found
