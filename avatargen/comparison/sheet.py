"""The methods side by side: a row of pictures and a row of depth each, every column the same camera, pose and
shape; above them the real pictures.

Depth is painted from near (light) to far (dark), 60 cm about the middle of each person.
"""

import io
from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float, UInt8
from PIL import Image, ImageDraw

from avatargen.comparison.packed import Result
from avatargen.data.dataset import Pictures
from avatargen.metrics.clothes import SOLID

COLUMNS, TILE, LEFT = 10, 128, 110  # pictures, pixels a side, pixels of names


def sheet(results: Mapping[str, Result], data: Pictures) -> bytes:
    """PNG: `results` by the names that stand beside them."""
    some = next(iter(results.values()))
    chosen = some.shown.chosen[:COLUMNS]
    real = [(255 * data.image(int(i)).permute(1, 2, 0).numpy()).astype(np.uint8) for i in chosen]
    rows: list[tuple[str, Sequence[np.ndarray]]] = [("real", real)]
    if data.holds("depth"):
        true = [data.depth(int(i)).numpy() for i in chosen]
        rows.append(("", [paint(depth, depth > 0) for depth in true]))
    for name, result in results.items():
        views = result.shown.first.part(slice(COLUMNS))
        solid = views.mask > 255 * SOLID
        rows.append((name, list(views.image)))
        rows.append(("", [paint(*each) for each in zip(views.metres().numpy(), solid, strict=True)]))
    whole = Image.new("RGB", (LEFT + COLUMNS * TILE, len(rows) * TILE), "white")
    draw = ImageDraw.Draw(whole)
    for y, (name, pictures) in enumerate(rows):
        draw.text((6, y * TILE + TILE // 2 - 6), name, fill="black")
        for x, pixels in enumerate(pictures):
            tile = Image.fromarray(pixels).resize((TILE, TILE), Image.Resampling.NEAREST)
            whole.paste(tile, (LEFT + x * TILE, y * TILE))
    stream = io.BytesIO()
    whole.save(stream, format="png", optimize=True)
    return stream.getvalue()


def paint(depth: Float[np.ndarray, "r r"], there: np.ndarray) -> UInt8[np.ndarray, "r r 3"]:
    """Gray where somebody is, white elsewhere; contrast about the person's own distance."""
    middle = float(np.median(depth[there])) if there.any() else 0.0
    share = np.clip((depth - middle) / 0.6 + 0.5, 0, 1)
    gray = np.where(there, 230 - 200 * share, 255).astype(np.uint8)
    return np.repeat(gray[..., None], 3, axis=2)
