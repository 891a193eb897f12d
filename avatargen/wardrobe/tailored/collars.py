"""Collars: cloth that stands up from the edge of a neckline, and may fall over outward.

Letters: n vertices of the edge, R rows of the collar.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from avatargen.smoothstep import smoothstep
from avatargen.wardrobe.makehuman.solid import boundary_loops
from avatargen.wardrobe.tailored.draping import cleared
from avatargen.wardrobe.tailored.form import Sheet

NECK_Z = 0.015  # m, of the line around which a collar lies
STEPS = 7  # rows standing, or lying over
UP = np.array([0.0, 1.0, 0.0])


@dataclass(frozen=True, kw_only=True)
class Collar:
    """How a collar stands and falls. Metres."""

    stand: float  # upward
    fall: float = 0.0  # outward and down again
    gap: float = 0.0  # half of its opening in front
    off: float = 0.0085  # from what it falls on
    thick: float = 0.006  # between stand and fall
    points: float = 0.0  # how much longer it falls beside its opening


def collared(sheet: Sheet, collar: Collar, ease: float) -> Sheet:
    """A sheet with a collar on its highest edge, whose two pattern pieces are numbered after its own."""
    edge = max(boundary_loops(sheet.faces), key=lambda loop: float(sheet.at[loop, 1].mean()))
    rim = sheet.vertices[edge]
    rows = falling(rim, collar, ease) if collar.fall else standing(rim, collar)
    width = len(edge)
    new = len(sheet.vertices) + np.arange((len(rows) - 1) * width).reshape(-1, width)
    number = np.concatenate([edge[None], new])
    gone = (np.abs(rim[:, 0]) < collar.gap) & (rim[:, 2] > NECK_Z)
    columns = np.flatnonzero(~(gone | np.roll(gone, -1)))
    front = (rim[columns, 2] > NECK_Z).astype(np.int64)
    faces = []
    for row in range(len(rows) - 1):
        a, b = number[row, columns], number[row, (columns + 1) % width]
        c, d = number[row + 1, columns], number[row + 1, (columns + 1) % width]
        faces += [np.stack([b, a, c], axis=1), np.stack([b, c, d], axis=1)]
    added = np.concatenate(faces)
    whole = Sheet(
        vertices=np.concatenate([sheet.vertices, rows[1:].reshape(-1, 3)]),
        at=np.concatenate([sheet.at, rows[1:].reshape(-1, 3)]),
        faces=np.concatenate([sheet.faces, added]),
        part=np.concatenate([sheet.part, sheet.part.max() + 1 + np.tile(front, 2 * (len(rows) - 1))]),
    )
    return whole.kept(np.ones(len(whole.faces), dtype=bool))


def outward(rim: Float64[np.ndarray, "n 3"]) -> Float64[np.ndarray, "n 3"]:
    """Level directions away from the neck."""
    away = (rim - (0, 0, NECK_Z)) * (1, 0, 1)
    return away / np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-9)


def standing(rim: Float64[np.ndarray, "n 3"], collar: Collar) -> Float64[np.ndarray, "R n 3"]:
    """Rows of a collar that stands up, leaning toward the neck."""
    share = np.linspace(0, 1, STEPS + 1)[:, None, None]
    return rim[None] + collar.stand * share * (UP - 0.15 * outward(rim))[None]


def falling(rim: Float64[np.ndarray, "n 3"], collar: Collar, ease: float) -> Float64[np.ndarray, "R n 3"]:
    """Rows of a collar that falls over: from the edge out under it to its tips, then up to the fold."""
    out = outward(rim)
    beside = smoothstep(1 - np.abs(rim[:, 0]) / 0.07)[:, None] * (out[:, 2:] > 0)
    falls = collar.fall + collar.points * beside
    fold = rim + collar.stand * (UP - 0.1 * out)
    tip = rim + 0.8 * falls * out - 0.75 * falls * UP
    tip = cleared(cleared(tip, np.full(len(rim), ease + 0.002)), np.full(len(rim), ease + 0.002))
    under = [rim + share * (tip - rim) for share in np.linspace(0, 1, 4)]
    over = []
    for share in np.linspace(0, 1, STEPS + 1)[1:]:
        place = (
            tip + share * (fold - tip) + collar.thick * np.sin(np.pi * share) ** 0.5 * (0.7 * out + 0.7 * UP)
        )
        over.append(cleared(place, np.full(len(rim), ease + collar.off * min(1.0, 6 * (1 - share)))))
    return np.stack([*under, *over])
