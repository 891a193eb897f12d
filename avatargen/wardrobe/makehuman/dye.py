"""Other colours and prints for an artist's texture.

Colours change in CIELAB: the mean becomes the one asked for and what differs from it stays, so folds, seams
and wear are kept. Prints are laid in the plane of the texture's pattern pieces, by their size in metres.
"""

import warnings

import numpy as np
from jaxtyping import Bool, Float, Float64, UInt8
from skimage.color import lab2rgb, rgb2lab

TRIM = 0.7  # of an artist's contrast of hue that stays


def dyed(
    texture: UInt8[np.ndarray, "H W 4"],
    used: Bool[np.ndarray, "H W"],
    colour: tuple[float, float, float],
) -> UInt8[np.ndarray, "H W 4"]:
    """The texture with its used texels' median made `colour` (sRGB); the others stay."""
    lab = rgb2lab(texture[..., :3])
    middle = np.median(lab[used], axis=0)
    wanted = rgb2lab(np.array(colour)[None, None])[0, 0]
    # dark cloth shows less of its folds, light cloth no more than white allows
    contrast = np.clip(0.35 + wanted[0] / max(middle[0], 25.0), 0.4, 1.2)
    new = wanted + (lab - middle) * np.array([contrast, TRIM, TRIM])
    out = texture.copy()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of colours beyond sRGB, which are clipped here
        out[used, :3] = (lab2rgb(new[used]).clip(0, 1) * 255).round().astype(np.uint8)
    return out


def printed(
    colour: Float64[np.ndarray, "N 3"],
    place: Float[np.ndarray, "N 2"],
    kind: str,
    ink: tuple[float, float, float],
    width: float,
) -> Float64[np.ndarray, "N 3"]:
    """Colours with a print over them at places in metres (along the garment, across it)."""
    if kind == "plain":
        return colour
    bands = [stripe(place[:, axis], width) for axis in (0, 1)]
    share = {"across": bands[0], "down": bands[1], "checks": 0.5 * bands[0] + 0.5 * bands[1]}[kind]
    shade = colour.mean(axis=1, keepdims=True) / max(float(np.median(colour.mean(axis=1))), 0.05)
    return colour + (np.array(ink) * shade.clip(0.5, 1.4) - colour) * (0.9 * share)[:, None]


def stripe(x: Float[np.ndarray, " N"], width: float) -> Float64[np.ndarray, " N"]:
    """1 on stripes of a width, 0 on gaps of twice that, with edges of a millimetre."""
    phase = np.abs((x / (3 * width)) % 1 - 0.5) * 3 * width  # m from the middle of a stripe
    return 1 - np.clip((phase - width / 2) / 0.001 + 0.5, 0, 1)
