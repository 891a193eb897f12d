"""avatargen traits: what one may choose of a person, and what it looks like.

    avatargen traits
    avatargen traits --show hair --seed 3 --out hair.jpg

The list is what `avatar-export --hair long`, `--traits FILE.json` and `generator.sample(seed, traits={...})`
take. With --show, a picture of one seed with each value of a trait, side by side.
"""

import io
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from avatargen.commands.line import LARGEST_SEED, OneLineParser, run_command, whole_number
from avatargen.commands.progress import Show, progress_line
from avatargen.errors import InputError
from avatargen.wardrobe.choosing import HEIGHT, SHORTEST, SHOWN, TALLEST, shown, traits_of

if TYPE_CHECKING:
    from PIL.Image import Image

PROGRAM = "avatargen traits"
DESCRIPTION = "List what one may choose of a person; with --show, draw one seed with each value of a trait."
EXAMPLES = """\
examples:
  avatargen traits
  avatargen traits --show hair --seed 3 --out hair.jpg
"""
HEAD = ("hair", "hair_color", "beard", "hat")  # shown from close by
HEIGHTS = (1.50, 1.65, 1.80, 1.95)  # m, of those shown for the height
PIXELS = 320
GROUND = (238, 238, 238)
INK = (60, 60, 60)
PICTURES = {".png": "PNG", ".jpg": "JPEG", ".jpeg": "JPEG"}


def main(arguments: Sequence[str] | None = None) -> int:
    def command() -> None:
        parser = OneLineParser(PROGRAM, description=DESCRIPTION, examples=EXAMPLES)
        names = [HEIGHT, *map(shown, SHOWN)]
        parser.add_argument("--show", choices=names, help="draw one seed with each value of this trait")
        parser.add_argument("--seed", type=whole_number(0, LARGEST_SEED), default=3, help="whom (3)")
        parser.add_argument("--out", type=Path, default=Path("traits.png"), help="the picture (traits.png)")
        given = parser.parse_args(arguments)
        if given.show is None:
            print("\n".join(lines()))
        else:
            draw(given.show.replace("-", "_"), given.seed, given.out)

    return run_command(PROGRAM, command)


def lines() -> Iterator[str]:
    """A line a trait: its name and its values."""
    width = max(len(shown(name)) for name in SHOWN)
    for name, values in SHOWN.items():
        yield f"{shown(name):{width}}  {', '.join(values)}"
        if name == "age":
            yield f"{HEIGHT:{width}}  {SHORTEST:.2f} to {TALLEST:.2f}, in metres"


def draw(name: str, seed: int, out: Path) -> None:
    """A picture of the seed with each value of a trait; prints its path.

    Raises:
        InputError: the picture's name has no known suffix, or it cannot be written.
    """
    kind = PICTURES.get(out.suffix.lower())
    if kind is None:
        raise InputError(f"found --out {out}; give a name that ends in .png or .jpg")
    from avatargen.atomic import check_writable, write_atomically

    check_writable(out)
    stream = io.BytesIO()
    with progress_line(in_pipes=True) as show:
        sheet(name, seed, show).save(stream, kind, quality=88)
    write_atomically(out, stream.getvalue())
    print(out)


def sheet(name: str, seed: int, show: Show) -> "Image":
    """The people side by side on one ground at one scale, a word under each."""
    show("loading libraries", 0.0)
    import numpy as np
    from PIL import Image, ImageDraw

    import avatargen
    from assets import BuildConfig, build
    from assets.picture.preview import PreviewConfig, render

    generator, people = avatargen.load_generator(), []
    view = "face" if name in HEAD else "front"
    values = HEIGHTS if name == HEIGHT else SHOWN[name]
    for i, value in enumerate(values):
        show(f"{i} of {len(values)}", i / len(values))
        avatar = generator.sample(seed, traits=traits_of({name: value}))
        asset = build(avatar, BuildConfig(resolution=256, faces=8_000, texture=512))
        tall = PIXELS if view == "face" else round(PIXELS * float(np.ptp(asset.vertices[:, 1])) / 2)
        picture = render(asset, PreviewConfig(height=tall, views=(view,)))
        people.append((f"{value:.2f} m" if name == HEIGHT else value, Image.fromarray(picture)))
    width = max(picture.width for _, picture in people)
    height = max(picture.height for _, picture in people)
    whole = Image.new("RGB", (width * len(people), height + 20), GROUND)
    pen = ImageDraw.Draw(whole)
    for i, (word, picture) in enumerate(people):
        whole.paste(picture, (i * width + (width - picture.width) // 2, height - picture.height))
        pen.text((i * width + width // 2, height + 4), word, fill=INK, anchor="ma")
    return whole
