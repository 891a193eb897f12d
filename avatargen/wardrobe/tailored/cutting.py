"""Cutting cloth along smooth curves: the zero sets of functions of the form.

A curve is given as a value at each vertex, in metres as nearly as it can be, positive on what is kept.
Vertices closer to the curve than a tenth of an edge are taken to lie on it, so that no slivers arise.
"""

import numpy as np
from jaxtyping import Bool, Float64, Int64

from avatargen.wardrobe.tailored.form import Sheet

NEAR = 0.12  # of an edge's change of value, under which a vertex lies on the curve


def snapped(faces: Int64[np.ndarray, "F 3"], value: Float64[np.ndarray, " V"]) -> Float64[np.ndarray, " V"]:
    """Values with those of vertices next to the curve made zero."""
    steps = np.abs(value[faces] - value[np.roll(faces, -1, axis=1)]).max(axis=1)
    largest = np.zeros(len(value))
    np.maximum.at(largest, faces.ravel(), np.repeat(steps, 3))
    return np.where(np.abs(value) < NEAR * largest, 0.0, value)


def split(sheet: Sheet, value: Float64[np.ndarray, " V"]) -> tuple[Sheet, Bool[np.ndarray, " F"]]:
    """The sheet with edges along a curve, and which of its faces lie on the positive side."""
    value = snapped(sheet.faces, value)
    sign = np.sign(value)[sheet.faces]
    mixed = (sign.max(axis=1) > 0) & (sign.min(axis=1) < 0)
    places, ats, count = [sheet.vertices], [sheet.at], len(sheet.vertices)
    between: dict[tuple[int, int], int] = {}

    def crossing(a: int, b: int) -> int:
        """The vertex where the curve crosses an edge."""
        nonlocal count
        a, b = min(a, b), max(a, b)
        if (a, b) not in between:
            share = value[a] / (value[a] - value[b])
            places.append(sheet.vertices[None, a] * (1 - share) + sheet.vertices[None, b] * share)
            ats.append(sheet.at[None, a] * (1 - share) + sheet.at[None, b] * share)
            between[a, b] = count
            count += 1
        return between[a, b]

    faces, part, positive = [sheet.faces[~mixed]], [sheet.part[~mixed]], [sign[~mixed].max(axis=1) > 0]
    for face, own in zip(sheet.faces[mixed].tolist(), sheet.part[mixed].tolist(), strict=True):
        for side in (1, -1):
            walk = []
            for a, b in zip(face, face[1:] + face[:1], strict=True):
                if side * value[a] >= 0:
                    walk.append(a)
                if value[a] * value[b] < 0:
                    walk.append(crossing(a, b))
            triangles = [(walk[0], walk[i], walk[i + 1]) for i in range(1, len(walk) - 1)]
            faces.append(np.array(triangles, dtype=np.int64).reshape(-1, 3))
            part.append(np.full(len(triangles), own))
            positive.append(np.full(len(triangles), side > 0))
    whole = Sheet(
        vertices=np.concatenate(places),
        at=np.concatenate(ats),
        faces=np.concatenate(faces),
        part=np.concatenate(part),
    )
    return whole, np.concatenate(positive)


def cut(sheet: Sheet, value: Float64[np.ndarray, " V"]) -> Sheet:
    """What lies on the positive side of a curve."""
    whole, positive = split(sheet, value)
    return whole.kept(positive)


def parted(sheet: Sheet, value: Float64[np.ndarray, " V"]) -> Sheet:
    """The sheet with its pattern pieces parted along a seam: numbers are doubled, and one more on the
    positive side."""
    whole, positive = split(sheet, value)
    return Sheet(
        vertices=whole.vertices,
        at=whole.at,
        faces=whole.faces,
        part=2 * whole.part + positive.astype(np.int64),
    )
