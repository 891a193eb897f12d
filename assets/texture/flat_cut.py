"""A surface cut into charts that lie flat, and what is asked of it.

Letters: W vertices after the seams have split them, F faces, E directed edges, C charts, N some of them.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Complex128, Float64, Int64

from assets.mesh.surface import Surface, normals_of
from assets.texture.flatten import Sheets, areas_in_plane
from assets.texture.overlap import find_overlaps
from assets.texture.seams import Cut

RINGS = 2  # of vertices around those that are moved one by one, which are moved, too
FINE = 1024  # texels along the atlas's side at which charts are looked at,
FINEST = 3 * FINE  # or for the last time,
SHARED = 3  # pairs of a chart's faces that may share a texel or two, beside a seam
USED = 0.66  # when they cover so much of it
TINY = 1e-30


@dataclass(frozen=True, kw_only=True)
class FlatCut:
    """A surface cut into charts, and where these lie flat; metres."""

    cut: Cut
    z: Complex128[np.ndarray, " W"]


def sheets_of(
    surface: Surface, cut: Cut, which: Bool[np.ndarray, " C"], thickness: Float64[np.ndarray, " C"]
) -> tuple[Sheets, Int64[np.ndarray, " N"]]:
    """Some charts in space, each as thick as given along the direction that most of it faces or turns its
    back on; and their vertices among all."""
    mine = which[cut.chart]
    faces = cut.faces[mine]
    used = np.zeros(len(cut.vertex_map), dtype=bool)
    used[faces] = True
    vertices = np.flatnonzero(used)
    sheets = Sheets(
        vertices=surface.vertices[cut.vertex_map[vertices]],
        faces=(np.cumsum(used) - 1)[faces],
        chart=(np.cumsum(which) - 1)[cut.chart[mine]],
    )
    less = (1 - thickness[which])[sheets.owner]
    if less.any():
        axis = facing(sheets)[sheets.owner]
        off = np.einsum("wd,wd->w", sheets.vertices, axis)
        sheets = replace(sheets, vertices=sheets.vertices - (less * off)[:, None] * axis)
    return sheets, vertices


def facing(sheets: Sheets) -> Float64[np.ndarray, "C 3"]:
    """The direction in which, or against which, most of each chart faces."""
    normals = normals_of(sheets.vertices[sheets.faces])
    length = np.maximum(np.linalg.norm(normals, axis=1), TINY)
    product = np.einsum("fa,fb->fab", normals, normals) / length[:, None, None]
    columns = [np.bincount(sheets.chart, each, minlength=sheets.count) for each in product.reshape(-1, 9).T]
    return np.linalg.eigh(np.stack(columns, axis=1).reshape(-1, 3, 3))[1][:, :, 2]


def neighbours(
    cut: Cut, twin: Int64[np.ndarray, " E"]
) -> tuple[Int64[np.ndarray, " N"], Int64[np.ndarray, " N"]]:
    """Faces of one chart with an edge between them, each pair both ways."""
    inside = np.flatnonzero(~cut.open)
    return inside // 3, twin[inside] // 3


def around(sheets: Sheets, faces: Bool[np.ndarray, " F"]) -> Bool[np.ndarray, " W"]:
    """The vertices of some faces, and a few rings around them."""
    found = np.zeros(len(sheets.vertices), dtype=bool)
    found[sheets.faces[faces]] = True
    for _ in range(RINGS):
        found[sheets.faces[found[sheets.faces].any(axis=1)]] = True
    return found


def overlaps(
    flat: FlatCut, which: Bool[np.ndarray, " C"] | None = None, side: int = FINE
) -> Int64[np.ndarray, "N 2"]:
    """Pairs of faces of one chart, of some or all, that lie over each other."""
    faces, chart = flat.cut.faces, flat.cut.chart
    rows = np.arange(len(faces)) if which is None else np.flatnonzero(which[chart])
    fine = side * np.sqrt(USED / np.abs(areas_in_plane(faces, flat.z)).sum())
    corners = fine * flat.z[faces[rows]]
    return rows[find_overlaps(np.stack([np.real(corners), np.imag(corners)], axis=2), chart[rows])]


def means_at(
    faces: Int64[np.ndarray, "F 3"], corners: Complex128[np.ndarray, "F 3"], count: int
) -> Complex128[np.ndarray, " W"]:
    """The mean of what the faces' corners say of each vertex."""
    index, values = faces.reshape(-1), corners.reshape(-1)
    total = np.bincount(index, np.real(values), count) + 1j * np.bincount(index, np.imag(values), count)
    return total / np.bincount(index, minlength=count)
