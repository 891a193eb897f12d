"""What is painted on every face in code: brows, lashes and the eyes' light, in canonical space. One code
serves the artist-made skins and the learned ones.

Letters: N points. Metres; eyes are their centres and radii; shares are 0..1, colours sRGB.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from avatargen.smoothstep import smoothstep

# along a brow, outward from the middle of the eye, and above it: eyeball radii, 17 mm
INNER, OUTER = -1.1, 1.72
AT_NOSE = 0.53
PEAK = 0.6  # share of the length where a brow is highest
STRAND = 0.0011  # m between a brow's hairs
FRONT = 0.05  # m before the middle of the head
LASH_COLOUR = np.array([0.05, 0.035, 0.03])
IRIS_EDGE = 0.37  # of the eyeball's radius
BROW_SHADE = 0.55  # of the hair's colour
RIM = 0.3  # of `on_eye`, from which an eye shows
FADED, DEEPER = 0.5, 0.35  # of the hue of blue and green irises, and of their light: they glow otherwise
CATCH, CATCH_SIZE = (-0.1, 0.04), 0.08  # of the light on an eye, below the upper lid
WHITE = np.array([0.90, 0.86, 0.84])  # of an eye's white: it is neither as light as paper nor without blood
CORNER = np.array([0.80, 0.62, 0.58])  # and toward its corners


@dataclass(frozen=True, kw_only=True)
class FaceLines:
    """How one person's brows and lashes are drawn; each 0..1."""

    brow_width: float
    brow_arch: float
    lashes: float

    def __post_init__(self) -> None:
        assert all(0 <= x <= 1 for x in (self.brow_width, self.brow_arch, self.lashes)), self


def paint_face(
    colour: Float64[np.ndarray, "N 3"],
    foot: Float64[np.ndarray, "N 3"],
    on_eye: Float64[np.ndarray, " N"],
    eyes: Float64[np.ndarray, "2 4"],
    lines: FaceLines,
    hair: tuple[float, float, float],
    iris: Callable[[Float64[np.ndarray, "M 2"]], Float64[np.ndarray, "M 3"]],
) -> Float64[np.ndarray, "N 3"]:
    """The colours of skin at feet on the body's surface with brows, eyes and lashes over them.

    `on_eye` is 1 on eyeballs, 0 on skin, between at the rims of the lids. `hair` is the colour of the hair,
    of which brows are a darker shade. `iris` is an eye's own colour where the left eyeball is seen from the
    front, in radii from its middle, x outward from the nose.
    """
    brow = BROW_SHADE * np.array(hair) + 0.02
    colour = colour + (brow - colour) * brow_share(foot, eyes, lines)[:, None]
    seen = np.flatnonzero(on_eye > RIM)
    side = (foot[seen, 0] < 0).astype(np.int64)
    off = (foot[seen] - eyes[side, :3])[:, :2] / eyes[side, 3:]
    mirrored = off * np.stack([np.where(side == 0, 1, -1), np.ones(len(off))], axis=1)
    white = lit_eye(iris(mirrored), off) * (0.55 + 0.38 * smoothstep(on_eye[seen], 0.5, 0.95))[:, None]
    colour[seen] += (white - colour[seen]) * smoothstep(on_eye[seen], 0.4, 0.6)[:, None]
    return colour + (LASH_COLOUR - colour) * lash_share(foot, on_eye, eyes, lines)[:, None]


def brow_share(
    foot: Float64[np.ndarray, "N 3"], eyes: Float64[np.ndarray, "2 4"], lines: FaceLines
) -> Float64[np.ndarray, " N"]:
    """How far a brow covers the skin at points of the canonical body's surface.

    A brow is a band about an arc, wider at the nose, whose hairs lean outward and lie down towards its end.
    """
    radius = eyes[0, 3]
    along = (np.abs(foot[:, 0]) - eyes[0, 0]) / radius
    above = (foot[:, 1] - eyes[0, 1]) / radius
    share = np.zeros(len(foot))
    near = np.flatnonzero((foot[:, 2] > FRONT) & (np.abs(along - 0.3) < 1.8) & (np.abs(above - 0.7) < 0.7))
    if not len(near):
        return share
    x, y = along[near], above[near]
    t = (x - INNER) / (OUTER - INNER)
    rise = np.where(
        t < PEAK,
        np.sin(0.5 * np.pi * np.clip(t / PEAK, -0.2, 1)),
        np.cos(0.5 * np.pi * np.clip((t - PEAK) / (1.25 - PEAK), 0, 1)),
    )
    middle = AT_NOSE + (0.18 + 0.22 * lines.brow_arch) * rise
    half = (0.09 + 0.11 * lines.brow_width) * (1 - 0.8 * smoothstep(t, 0.35, 1.05))
    off = (y - middle) / np.maximum(half, 0.02)
    # hairs: strokes across the band that lean more the farther out they grow
    lean = 0.5 + 1.6 * smoothstep(t, 0.0, 0.7)
    stroke = (x - lean * (y - middle)) * radius / STRAND
    hair = 0.5 + 0.5 * np.sin(2 * np.pi * stroke + 2.2 * np.sin(1.7 * stroke + 9.0 * off))
    body = 1 - smoothstep(np.abs(off) / (1.15 + 0.15 * hair), 0.3, 1.0)
    ends = smoothstep(t + 0.05 * (hair - 0.5), 0.0, 0.16) * (1 - smoothstep(t, 0.8, 1.0))
    share[near] = (0.62 + 0.28 * hair) * body * ends * (0.72 + 0.28 * lines.brow_width)
    return share


def lash_share(
    foot: Float64[np.ndarray, "N 3"],
    on_eye: Float64[np.ndarray, " N"],
    eyes: Float64[np.ndarray, "2 4"],
    lines: FaceLines,
) -> Float64[np.ndarray, " N"]:
    """How far lashes darken the rims of the lids; see `paint_face`."""
    above = (foot[:, 1] - eyes[0, 1]) / eyes[0, 3]
    out = (np.abs(foot[:, 0]) - eyes[0, 0]) / eyes[0, 3]
    rim = smoothstep(on_eye, 0.06, 0.35) * (1 - smoothstep(on_eye, 0.5, 0.8))
    upper = smoothstep(above + 0.12 * np.clip(out, -1, 1), -0.06, 0.08)
    return rim * ((0.6 + 0.38 * lines.lashes) * upper + 0.25 * (1 - upper))


def lit_eye(
    colour: Float64[np.ndarray, "N 3"], off: Float64[np.ndarray, "N 2"]
) -> Float64[np.ndarray, "N 3"]:
    """An eye's own colour with what gives it depth: the dark ring about the iris, the upper lid's shadow and
    the light that the wet ball mirrors. `off` is from the middle of the eyeball, in radii.
    """
    grey = colour.mean(axis=1, keepdims=True)
    cool = np.clip((colour[:, 1:].max(axis=1, keepdims=True) - colour[:, :1]) / 0.1, 0, 1)
    out = np.linalg.norm(off, axis=1)
    ring = smoothstep(out, 0.24, IRIS_EDGE - 0.02) * (1 - smoothstep(out, IRIS_EDGE, IRIS_EDGE + 0.05))
    shadow = smoothstep(off[:, 1], -0.02, 0.2)
    iris = (1 - smoothstep(out, IRIS_EDGE - 0.03, IRIS_EDGE + 0.03))[:, None] * cool
    lit = (colour + FADED * cool * (grey - colour)) * (1 - DEEPER * iris)
    lit *= ((1 - 0.4 * ring) * (1 - 0.5 * shadow))[:, None]
    white = smoothstep(out, IRIS_EDGE, IRIS_EDGE + 0.06)[:, None]
    corner = smoothstep(np.abs(off[:, 0]), 0.45, 0.85)[:, None]
    lit *= 1 + white * (WHITE + corner * (CORNER - WHITE) - 1)
    catch = 0.85 * (1 - smoothstep(np.linalg.norm(off - CATCH, axis=1), 0.5 * CATCH_SIZE, CATCH_SIZE))
    return lit + (1 - lit) * catch[:, None]
