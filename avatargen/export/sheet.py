"""One picture of many people, a contact sheet. Each person is drawn by the worker that makes the person, as
OUT/pictures/avatar_SEED.png, so a run that goes on has the pictures of those who are there already.
"""

import math
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from PIL import Image

from assets.asset.asset import PlainAsset
from assets.picture.preview import PreviewConfig, render
from assets.picture.sheet import contact_sheet
from avatargen.atomic import check_writable, unwritable, write_atomically
from avatargen.errors import InputError
from avatargen.export.request import ExportRequest
from exporters import files_of
from exporters.encoding import Encoding
from exporters.png import encode_png

FOLDER = "pictures"
PICTURE = PreviewConfig(height=256, views=("front",))
SHAPE = 4 / 3  # length by height of a sheet


def picture_of(out: Path, seed: int) -> Path:
    """Where a person's picture is."""
    return out / FOLDER / f"avatar_{seed}.png"


def draw(asset: PlainAsset) -> bytes:
    """A person's picture as PNG."""
    return encode_png(render(asset, PICTURE))


def open_sheet(request: ExportRequest, out: Path, seeds: Iterable[int]) -> None:
    """Make the pictures' folder, and see that the sheet can be written and takes the place of no person.

    Raises:
        InputError: it cannot, or the folder cannot be made.
    """
    assert request.sheet is not None
    folder = out / FOLDER
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise unwritable(folder, error) from error
    check_writable(request.sheet)
    for seed in seeds:
        files = [picture_of(out, seed), *files_of(request.path_of(seed), request.encoding)]
        if request.sheet.resolve() in [file.resolve() for file in files]:
            raise InputError(f"cannot write {request.sheet}: it is of seed {seed}; give another --sheet")


def write_sheet(path: Path, out: Path, seeds: Iterable[int]) -> None:
    """The pictures of the seeds in rows, each seed under its own.

    Raises:
        InputError: a picture is damaged, or the sheet cannot be written.
    """
    pictures = {seed: read_picture(picture_of(out, seed)) for seed in seeds}
    if not pictures:
        return
    width = max(picture.shape[1] for picture in pictures.values())
    rows = max(1, round(math.sqrt(len(pictures) * width / (SHAPE * PICTURE.height))))
    columns = math.ceil(len(pictures) / rows)
    sheet = contact_sheet(list(pictures.values()), columns, [str(seed) for seed in pictures])
    encoding = Encoding(pictures="png" if path.suffix.lower() == ".png" else "jpeg")
    write_atomically(path, encoding.picture("sheet", sheet))


def read_picture(path: Path) -> np.ndarray:
    """Raises InputError where it is none."""
    try:
        with Image.open(path, formats=("PNG",)) as image:
            if image.height != PICTURE.height or image.width > 8 * PICTURE.height:
                raise ValueError(f"it is {image.width} x {image.height} pixels")
            return np.asarray(image.convert("RGB"))
    except (OSError, ValueError, SyntaxError) as error:
        raise InputError(
            f"{path} is no picture of ours ({error}); remove it, and the same command draws it again"
        ) from error
