"""Emblems on MakeHuman's own textures, painted out: people who advertise nothing.

A box is filled from its four edges (Coons 1967) and with the grain of the cloth beside it.
"""

import numpy as np
from jaxtyping import Float, UInt8
from scipy.ndimage import gaussian_filter

Box = tuple[float, float, float, float]  # left, top, right, bottom as shares of the texture

EMBLEMS: dict[str, tuple[Box, ...]] = {
    "female_casualsuit01_diffuse": ((0.70, 0.15, 0.875, 0.32),),
    "female_casualsuit02_diffuse": ((0.705, 0.15, 0.88, 0.32),),
    "male_casualsuit02_diffuse": ((0.485, 0.095, 0.64, 0.245),),
    "male_casualsuit04_diffuse": ((0.485, 0.095, 0.64, 0.245),),
    "male_casualsuit06_diffuse": (
        (0.19, 0.095, 0.31, 0.18),
        (0.42, 0.095, 0.66, 0.225),
        (0.725, 0.14, 0.765, 0.19),
    ),
}
EDGE = 3.0  # texels that a border's colour is averaged over
GRAIN = 6.0  # texels: what is finer counts as grain


def paint_out(texture: UInt8[np.ndarray, "H W 4"], name: str) -> UInt8[np.ndarray, "H W 4"]:
    """The texture without the emblems that are known to be on the one of this name."""
    boxes = EMBLEMS.get(name, ())
    if not boxes:
        return texture
    painted = texture.astype(np.float64)
    height, width = texture.shape[:2]
    for left, top, right, bottom in boxes:
        x0, x1 = int(left * width), int(right * width)
        y0, y1 = int(top * height), int(bottom * height)
        colour = painted[..., :3]
        smooth = gaussian_filter(colour, (EDGE, EDGE, 0))
        fill = coons(smooth[y0:y1, x0:x1])
        beside = most_alike(colour, fill, x0, y0)
        grain = beside - gaussian_filter(beside, (GRAIN, GRAIN, 0))
        colour[y0:y1, x0:x1] = fill + grain.clip(-5, 5)
    return painted.clip(0, 255).astype(np.uint8)


def most_alike(
    colour: Float[np.ndarray, "H W 3"], fill: Float[np.ndarray, "h w 3"], x: int, y: int
) -> Float[np.ndarray, "h w 3"]:
    """Of the patches on the four sides, the one nearest to the fill."""
    h, w = fill.shape[:2]
    patches = [
        colour[y + dy : y + dy + h, x + dx : x + dx + w]
        for dx, dy in ((w, 0), (-w, 0), (0, h), (0, -h))
        if y + dy >= 0 and x + dx >= 0
    ]
    whole = [patch for patch in patches if patch.shape == fill.shape]
    return min(whole, key=lambda patch: float(np.abs(patch - fill).mean()), default=fill)


def coons(patch: Float[np.ndarray, "h w 3"]) -> Float[np.ndarray, "h w 3"]:
    """The patch refilled from its edges alone."""
    h, w = patch.shape[:2]
    v, u = np.linspace(0, 1, h)[:, None, None], np.linspace(0, 1, w)[None, :, None]
    across = (1 - u) * patch[:, :1] + u * patch[:, -1:]
    down = (1 - v) * patch[:1] + v * patch[-1:]
    corners = (1 - v) * ((1 - u) * patch[0, 0] + u * patch[0, -1]) + v * (
        (1 - u) * patch[-1, 0] + u * patch[-1, -1]
    )
    return across + down - corners
