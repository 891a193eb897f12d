"""The picture on the eyeballs: what the skin showed between the lids, seen from the front, and what was
hidden, made of that in rings around the pupil. The right eye shows it mirrored.

Letters: S texels along a texture's side, K along the picture's. Metres.
"""

import numpy as np
from jaxtyping import Float64, Int64, UInt8
from scipy.ndimage import map_coordinates

from assets.face.eyes import LEFT, RADIUS, RIGHT, Eyes
from assets.face.opened import OpenFace
from assets.face.swatch import Swatch
from assets.texture.raster import rasterise
from avatargen.smoothstep import smoothstep

FILLED = 0.96  # of the picture's width is the ball's
SHADED = (8e-4, 2e-3)  # m within a margin: lashes and their shade, which stay on the lids
BACK = 0.9  # of the ball's width: what is behind reads the white further in
WHITE = 0.42  # of a ball's width, from which all is white
CLEAN = 95  # percentile of the white that is seen: lids shade the rest
KEPT = 0.5  # of that shade, in the white


def eye_picture(texture: UInt8[np.ndarray, "S S 3"], face: OpenFace, size: int) -> UInt8[np.ndarray, "K K 3"]:
    """The left eye from the front, in a square of so many texels along a side."""
    centre = face.units.balls[0, :2]
    corners = (face.shown.places[:, :, :2] - centre) / RADIUS
    seen, share = np.zeros((size * size, 3)), np.zeros(size * size)
    flat = (0.5 + 0.5 * FILLED * corners * [1, -1]) * size
    for found in rasterise(flat, size, size):
        uv = np.einsum("nk,nka->na", found.barycentric, face.shown.uv[found.triangle])
        seen[found.pixel] = sampled(texture, uv)
        place = np.einsum("nk,nka->na", found.barycentric, face.shown.places[found.triangle])
        share[found.pixel] = smoothstep(-face.curves.outside(place, 0), *SHADED)
    y, x = np.divmod(np.arange(size * size), size)
    away = np.hypot(x + 0.5 - size / 2, y + 0.5 - size / 2)
    ring = np.rint(away).astype(np.int64)
    radius = 0.5 * FILLED * size
    hidden = rings(seen[share > 0.99], ring[share > 0.99], int(ring.max()) + 1, radius)
    share *= 1 - (1 - KEPT) * smoothstep(away / radius, 0.95 * WHITE, 1.05 * WHITE)
    return (
        np.rint(hidden[ring] + share[:, None] * (seen - hidden[ring])).astype(np.uint8).reshape(size, size, 3)
    )


def sampled(
    texture: UInt8[np.ndarray, "S S 3"], uv: Float64[np.ndarray, "N 2"]
) -> Float64[np.ndarray, "N 3"]:
    """The texture with bilinear filtering."""
    at = uv[:, ::-1].T * len(texture) - 0.5
    return np.stack(
        [map_coordinates(texture[..., k].astype(np.float64), at, order=1, mode="nearest") for k in range(3)],
        axis=1,
    )


def rings(
    seen: Float64[np.ndarray, "N 3"], ring: Int64[np.ndarray, " N"], count: int, radius: float
) -> Float64[np.ndarray, "R 3"]:
    """The colour of each ring of texels around the pupil: the median of what is seen of it; beyond the iris
    that of all the white."""
    white = seen[ring > WHITE * radius] if (ring > WHITE * radius).any() else seen
    found = np.tile(np.percentile(white, CLEAN, axis=0) if len(seen) else np.full(3, 200.0), (count, 1))
    for each in np.unique(ring[ring <= WHITE * radius]):
        found[each] = np.median(seen[ring == each], axis=0)
    return found


def eye_uv(eyes: Eyes, swatch: Swatch) -> Float64[np.ndarray, "E 2"]:
    """Where the balls' vertices read the picture; others at its middle."""
    found = np.full((len(eyes.places), 2), 0.5)
    for ball, sphere, kind in zip(eyes.balls, eyes.spheres, (LEFT, RIGHT), strict=True):
        off = (eyes.places[sphere] - ball.centre) / ball.radius
        across = off[:, :2] - ball.pupil[:2]
        away = np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)
        reach = np.where(off[:, 2:] > 0, np.minimum(away, 1), 1 - (1 - BACK) * np.minimum(-off[:, 2:], 1))
        side = 1 if kind == LEFT else -1
        found[sphere] += 0.5 * FILLED * across / away * reach * [side, -1]
    return np.array(swatch.corner) + swatch.side * found
