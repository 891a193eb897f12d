"""Painting: colours of the texels of a sheet, from where on the form each lies.

Garments are dyed later, in CIELAB about their median, so cloth is painted light grey and what is sewn into it
as darker and lighter. What is finer than some 5 mm does not survive learning and is not painted.

Letters: N texels that lie on the cloth, F faces.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float64, Int64, UInt8
from scipy.ndimage import distance_transform_edt

from avatargen.compiled import compiled
from avatargen.wardrobe.tailored.draping import membrane, normals_of
from avatargen.wardrobe.tailored.form import Sheet

SIDE = 1024  # texels
HOLLOW = 26.0  # share of light that a hollow of a metre's depth would lose, over some 2 cm
ROUNDS = 6  # of averaging that say what is hollow


@dataclass(frozen=True, kw_only=True, eq=False)
class Texels:
    """The texels on the cloth."""

    row: Int64[np.ndarray, " N"]
    column: Int64[np.ndarray, " N"]
    at: Float64[np.ndarray, "N 3"]  # on the form, m
    part: Int64[np.ndarray, " N"]
    light: Float64[np.ndarray, " N"]  # factor, about 1: less in the folds
    flat: Float64[np.ndarray, "N 2"]  # m across and down the flat pieces


@compiled
def fill_texels(uv, face_at, weights):
    """Fill in which face [S S] lies on each texel's middle, and the weights [S S 3] of its corners; uv
    [F 3 2] in texels."""
    side = face_at.shape[0]
    for f in range(len(uv)):
        ax, ay, bx, by, cx, cy = uv[f, 0, 0], uv[f, 0, 1], uv[f, 1, 0], uv[f, 1, 1], uv[f, 2, 0], uv[f, 2, 1]
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if abs(area) < 1e-9:
            continue
        low_x, high_x = max(int(min(ax, bx, cx) - 1), 0), min(int(max(ax, bx, cx) + 1), side - 1)
        low_y, high_y = max(int(min(ay, by, cy) - 1), 0), min(int(max(ay, by, cy) + 1), side - 1)
        for y in range(low_y, high_y + 1):
            for x in range(low_x, high_x + 1):
                px, py = x + 0.5, y + 0.5
                wb = ((px - ax) * (cy - ay) - (py - ay) * (cx - ax)) / area
                wc = ((bx - ax) * (py - ay) - (by - ay) * (px - ax)) / area
                wa = 1 - wb - wc
                if wa >= -1e-6 and wb >= -1e-6 and wc >= -1e-6:
                    face_at[y, x] = f
                    weights[y, x, 0], weights[y, x, 1], weights[y, x, 2] = wa, wb, wc


def texels_of(sheet: Sheet, uv: Float[np.ndarray, "F 3 2"]) -> Texels:
    """The texels that faces lie on."""
    face_at, weights = np.full((SIDE, SIDE), -1, dtype=np.int64), np.zeros((SIDE, SIDE, 3))
    fill_texels(uv.astype(np.float64) * SIDE, face_at, weights)
    row, column = np.nonzero(face_at >= 0)
    face, share = face_at[row, column], weights[row, column]
    corners = sheet.faces[face]
    metres = np.sqrt(area(sheet.vertices[sheet.faces]) / max(area(uv.astype(np.float64)), 1e-9))
    return Texels(
        row=row,
        column=column,
        at=np.einsum("nk,nka->na", share, sheet.at[corners]),
        part=sheet.part[face],
        light=np.einsum("nk,nk->n", share, folds(sheet)[corners]),
        flat=np.stack([column, row], axis=1) * (metres / SIDE),
    )


def area(corners: Float64[np.ndarray, "F 3 d"]) -> float:
    """Of all triangles."""
    sides = corners[:, 1:] - corners[:, :1]
    square = np.einsum("fia,fja->fij", sides, sides)
    return float(np.sqrt((square[:, 0, 0] * square[:, 1, 1] - square[:, 0, 1] ** 2).clip(0)).sum() / 2)


def folds(sheet: Sheet) -> Float64[np.ndarray, " V"]:
    """How light cloth is: less where it is hollow, a little more on its ridges."""
    average = membrane(sheet.faces, len(sheet.vertices))
    flat = sheet.vertices
    for _ in range(ROUNDS):
        flat = average @ flat
    raised = ((sheet.vertices - flat) * normals_of(sheet)).sum(axis=1)
    raised = average @ (average @ raised)
    return (1 + HOLLOW * raised).clip(0.72, 1.1)


def texture_of(found: Texels, color: Float64[np.ndarray, "N 3"]) -> UInt8[np.ndarray, "S S 4"]:
    """A texture of the texels' colours, sRGB 0..1; others are as the nearest of them."""
    texture = np.full((SIDE, SIDE, 4), 255, dtype=np.uint8)
    texture[found.row, found.column, :3] = np.rint(255 * color.clip(0, 1)).astype(np.uint8)
    bare = np.ones((SIDE, SIDE), dtype=bool)
    bare[found.row, found.column] = False
    nearest = np.asarray(distance_transform_edt(bare, return_distances=False, return_indices=True))
    return texture[nearest[0], nearest[1]]


def cloth(
    found: Texels, base: tuple[float, float, float], uneven: float = 0.012
) -> Float64[np.ndarray, "N 3"]:
    """Plain cloth of a colour, sRGB 0..1, a little uneven and darker in its folds."""
    return np.array(base) * (knit(found.at, uneven) * found.light)[:, None]


def shaded(
    color: Float64[np.ndarray, "N 3"], share: Float64[np.ndarray, " N"], factor: float
) -> Float64[np.ndarray, "N 3"]:
    """Colours, by their share times a factor: darker below 1, lighter above."""
    return color * (1 + (factor - 1) * share)[:, None]


def within(value: Float64[np.ndarray, " N"], low: float, high: float, soft: float = 0.0015) -> np.ndarray:
    """1 where a value is between two others, with soft edges (m)."""
    return rising(value, low, soft) * (1 - rising(value, high, soft))


def rising(value: Float64[np.ndarray, " N"], place: float, soft: float = 0.0015) -> np.ndarray:
    """0 below a place, 1 above it, smooth over some metres."""
    share = ((value - place) / (2 * soft) + 0.5).clip(0, 1)
    return share * share * (3 - 2 * share)


def line(value: Float64[np.ndarray, " N"], width: float = 0.0035) -> np.ndarray:
    """1 on a curve, fading within a width (m): a seam."""
    return np.exp(-((value / width) ** 2))


def knit(at: Float64[np.ndarray, "N 3"], strength: float, seed: int = 5) -> np.ndarray:
    """A factor about 1: cloth is never quite even."""
    rng = np.random.default_rng(seed)
    total = np.zeros(len(at))
    for size in (0.02, 0.035, 0.07):
        for _ in range(3):
            total += np.sin(at @ rng.normal(size=3) * 2 * np.pi / size + rng.uniform(0, 6))
    return 1 + strength * total / 9
