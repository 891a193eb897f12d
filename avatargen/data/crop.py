"""From a photograph and its mask to a square picture of one person on white, and the camera that took it.

The square is centred on the person's keypoints and as large as makes their span `fill` of it; larger where
the mask would be cut. Beyond the photograph it is white. What a crop does to a camera is exact: its
intrinsics change, its place does not.

Letters: H W pixels of the photograph, S pixels a side of the square. Places are in pixels from the top left.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float32, Float64, UInt8
from PIL import Image

from avatargen.data.keypoints import Keypoints
from avatargen.errors import InputError

MARGIN = 0.02  # of the square, kept free around the mask
FULL = 128  # of 255, from which a pixel counts as the person
SMALLEST = 0.005  # of the photograph that a person covers


@dataclass(frozen=True, kw_only=True)
class Square:
    """A square of a photograph."""

    x: float
    y: float
    side: float


def check_mask(mask: UInt8[np.ndarray, "H W"]) -> None:
    """Raises InputError where the mask shows nobody, or a person that leaves the photograph."""
    person = mask >= FULL
    if person.mean() < SMALLEST:
        raise InputError(
            f"mask: a person on {100 * person.mean():.2f} % of the photograph; none is seen there"
        )
    edges = {"top": person[0], "bottom": person[-1], "left": person[:, 0], "right": person[:, -1]}
    touched = [name for name, edge in edges.items() if edge.any()]
    if touched:
        raise InputError(f"partial body: the mask touches the {' and '.join(touched)} of the photograph")


def square_around(points: Keypoints, mask: UInt8[np.ndarray, "H W"], fill: float) -> Square:
    """The square that shows the whole person."""
    low, high = points.box()
    center, side = (low + high) / 2, (high - low).max() / fill
    rows, columns = (np.flatnonzero((mask >= FULL).any(axis=axis)) for axis in (1, 0))
    ends = np.array([[columns[0], rows[0]], [columns[-1] + 1, rows[-1] + 1]])
    reach = np.abs(ends - center).max()
    side = max(side, 2 * reach / (1 - 2 * MARGIN))
    return Square(x=float(center[0] - side / 2), y=float(center[1] - side / 2), side=float(side))


def cut(
    photo: UInt8[np.ndarray, "H W 3"], mask: UInt8[np.ndarray, "H W"], square: Square, size: int
) -> tuple[UInt8[np.ndarray, "S S 3"], UInt8[np.ndarray, "S S"]]:
    """The person on white, and the coverage, at `size` pixels a side."""
    cover = mask[..., None].astype(np.float32) / 255
    on_white = np.rint(photo * cover + 255 * (1 - cover)).astype(np.uint8)
    return resized(on_white, square, size, 255), resized(mask, square, size, 0)


def resized(pixels: UInt8[np.ndarray, "H W *c"], square: Square, size: int, beyond: int) -> np.ndarray:
    """One square of a picture, to a fraction of a pixel, filtered as its new size asks."""
    H, W = pixels.shape[:2]
    low = np.floor([square.y, square.x]).astype(int)
    high = np.ceil([square.y + square.side, square.x + square.side]).astype(int)
    before, after = np.maximum(-low, 0), np.maximum(high - [H, W], 0)
    part = pixels[max(low[0], 0) : max(high[0], 0), max(low[1], 0) : max(high[1], 0)]
    border = [(int(b), int(a)) for b, a in zip(before, after, strict=True)] + [(0, 0)] * (pixels.ndim - 2)
    whole = Image.fromarray(np.pad(part, border, constant_values=beyond))
    x, y = square.x - low[1], square.y - low[0]
    box = (x, y, min(x + square.side, whole.width), min(y + square.side, whole.height))
    return np.asarray(whole.resize((size, size), Image.Resampling.BICUBIC, box=box))


def cropped_camera(
    camera: Float[np.ndarray, "25"], width: int, height: int, square: Square
) -> Float32[np.ndarray, "25"]:
    """The camera of the square part of a photograph of so many pixels."""
    T_pixels_shares = np.diag([width, height, 1.0])
    T_square_pixels = np.array([[1, 0, -square.x], [0, 1, -square.y], [0, 0, square.side]]) / square.side
    intrinsics = T_square_pixels @ T_pixels_shares @ camera[16:].reshape(3, 3).astype(np.float64)
    return np.concatenate([camera[:16], intrinsics.ravel()]).astype(np.float32)


def agreement(
    joints: dict[str, Float64[np.ndarray, "2"]], points: Keypoints, names: tuple[str, ...]
) -> float:
    """Mean distance between the label's joints and the keypoints, as a share of the keypoints' span."""
    common = [name for name in names if name in points.places and name in joints]
    if not common:
        return float("inf")
    low, high = points.box()
    apart = [np.linalg.norm(joints[name] - points.places[name]) for name in common]
    return float(np.mean(apart) / max((high - low).max(), 1e-6))


def share_inside(joints: Float64[np.ndarray, "J 2"], mask: UInt8[np.ndarray, "H W"]) -> float:
    """Share of the label's joints that lie on the person."""
    column, row = np.floor(joints).astype(np.int64).T
    within = (row >= 0) & (row < mask.shape[0]) & (column >= 0) & (column < mask.shape[1])
    row, column = row.clip(0, mask.shape[0] - 1), column.clip(0, mask.shape[1] - 1)
    return float((within & (mask[row, column] >= FULL)).mean())
