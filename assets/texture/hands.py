"""Flat hands mended: fingers that would lie over each other are spread, and the two sides of a hand are
joined to one piece.

Letters: W vertices after the seams have split them, F faces, E directed edges, C charts.
"""

import numpy as np
from jaxtyping import Bool, Complex128, Int64

from assets.mesh.surface import Surface
from assets.texture.flat_cut import FlatCut, around, means_at, overlaps, sheets_of
from assets.texture.flatten import Sheets, singular_values
from assets.texture.relax import relax
from assets.texture.seams import cut_open

SPREAD = (8, 16, 24)  # degrees between neighbouring fingers more than they have
TURNS = (0.0, 8.0, -8.0, 16.0, -16.0, 25.0, -25.0, 40.0, -40.0, 60.0, -60.0)  # degrees about a hinge
MOST_OVER = 8  # pairs of faces of two joined sides that may lie over each other, and become charts


def spread_fingers(
    surface: Surface, flat: FlatCut, finger: Int64[np.ndarray, " F"], which: Bool[np.ndarray, " C"]
) -> FlatCut:
    """The plane, where fingers of some charts that lay over each other are turned about their knuckles, as
    far as it takes; `finger` numbers them across the hand from 1, and is 0 elsewhere."""
    for chart in np.unique(flat.cut.chart[(finger > 0) & which[flat.cut.chart]]):
        one = np.arange(flat.cut.count) == chart
        least = len(overlaps(flat, one))
        if not least:
            continue
        sheets, vertices = sheets_of(surface, flat.cut, one, np.ones(flat.cut.count))
        flat_hand, number = flat.z[vertices], finger[flat.cut.chart == chart]
        for degrees in SPREAD:
            z = flat.z.copy()
            z[vertices] = with_fingers_turned(sheets, flat_hand, number, np.radians(degrees))
            found = FlatCut(cut=flat.cut, z=z)
            left = len(overlaps(found, one))
            if left < least:
                flat, least = found, left
            if not left:
                break
    return flat


def with_fingers_turned(
    sheets: Sheets, z: Complex128[np.ndarray, " W"], finger: Int64[np.ndarray, " F"], angle: float
) -> Complex128[np.ndarray, " W"]:
    """One hand with its fingers turned away from the middle one, each by so much more than the one before."""
    of_palm = np.zeros(len(z), dtype=bool)
    of_palm[sheets.faces[finger == 0]] = True
    numbers = np.unique(finger[finger > 0])
    mine, knuckles = {}, {}
    for number in numbers:
        here = np.zeros(len(z), dtype=bool)
        here[sheets.faces[finger == number]] = True
        if (here & of_palm).any() and (here & ~of_palm).any():
            mine[number], knuckles[number] = here & ~of_palm, here & of_palm
    if len(mine) < 2:
        return z
    base = {number: z[knuckle].mean() for number, knuckle in knuckles.items()}
    middle = sorted(mine)[len(mine) // 2]
    along = z[mine[middle]].mean() - base[middle]
    turned = z.copy()
    for number, own in mine.items():
        left = np.sign((np.conj(along) * (base[number] - base[middle])).imag)
        turn = np.exp(1j * left * abs(int(number - middle)) * angle)
        turned[own] = (z[own] - base[number]) * turn + base[number]
    at_knuckles = np.isin(sheets.faces, np.flatnonzero(np.any(list(knuckles.values()), axis=0)))
    return relax(sheets, turned, around(sheets, np.asarray(at_knuckles.any(axis=1))))


def joined_at(
    surface: Surface, flat: FlatCut, twin: Int64[np.ndarray, " E"], hinges: Int64[np.ndarray, " N"]
) -> FlatCut:
    """The chart beyond one of some edges laid beside the one before it, joined along that edge alone, and
    turned about it so that neither lies over the other, but for a few faces; or as it was."""
    cut, best, least = flat.cut, flat, MOST_OVER + 1
    sides = cut.chart[[hinges[0] // 3, twin[hinges[0]] // 3]]
    if sides[0] == sides[1]:
        return flat
    enough = len(overlaps(flat, np.isin(np.arange(cut.count), sides)))
    for hinge in hinges:
        if not np.array_equal(cut.chart[[hinge // 3, twin[hinge] // 3]], sides):
            continue
        for degrees in TURNS:
            found, over = turned_about(surface, flat, twin, int(hinge), degrees)
            if over < least:
                best, least = found, over
            if over <= enough:
                return found
    return best


def turned_about(
    surface: Surface, flat: FlatCut, twin: Int64[np.ndarray, " E"], hinge: int, degrees: float
) -> tuple[FlatCut, int]:
    """The charts on both sides of an edge joined there, one turned by so much from where they would be
    continued straight, and how many pairs of faces lie over each other or are turned over."""
    cut, other = flat.cut, int(twin[hinge])
    beyond = cut.chart == cut.chart[other // 3]
    opened = cut.open.copy()
    opened[[hinge, other]] = False
    whole = cut_open(surface.faces, twin, opened)
    which = np.arange(whole.count) == whole.chart[hinge // 3]
    sheets, vertices = sheets_of(surface, whole, which, np.ones(whole.count))
    ends = np.isin(vertices[sheets.faces], whole.faces.reshape(-1)[[hinge, ahead_of(hinge)]])
    at, corners = flat.z[cut.faces].reshape(-1), flat.z[cut.faces]
    start, end, other_end, other_start = at[[hinge, ahead_of(hinge), other, ahead_of(other)]]
    turn = (end - start) / (other_end - other_start) * np.exp(1j * np.radians(degrees))
    corners[beyond] = (corners[beyond] - (other_start + other_end) / 2) * (turn / abs(turn))
    corners[beyond] += (start + end) / 2
    z = means_at(whole.faces, corners, len(whole.vertex_map))
    z[vertices] = relax(sheets, z[vertices], around(sheets, np.asarray(ends.any(axis=1))))
    found = FlatCut(cut=whole, z=z)
    return found, len(overlaps(found, which)) + int((singular_values(sheets, z[vertices])[1] <= 0).sum())


def ahead_of(edge: int) -> int:
    """The edge after this one around its face."""
    return edge - 2 if edge % 3 == 2 else edge + 1
