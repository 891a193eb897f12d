"""Pattern pieces laid flat: texture coordinates of a sheet, a chart a piece.

Each piece is flattened conformally (Levy et al. 2002, least squares conformal maps), turned upright, given
its size in metres and packed into the unit square in rows, so that a texel is as large everywhere.

Letters: F faces, f of one piece, n its vertices. uv from the top left.
"""

import igl
import numpy as np
from jaxtyping import Float32, Float64, Int64
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from avatargen.wardrobe.tailored.form import Sheet

GUTTER = 0.012  # m between pieces


def flat(vertices: Float64[np.ndarray, "n 3"], faces: Int64[np.ndarray, "f 3"]) -> Float64[np.ndarray, "n 2"]:
    """A disk laid flat, upright, in metres."""
    far = vertices - vertices.mean(axis=0)
    one = int(np.argmax(np.linalg.norm(far, axis=1)))
    other = int(np.argmax(np.linalg.norm(vertices - vertices[one], axis=1)))
    apart = float(np.linalg.norm(vertices[one] - vertices[other]))
    pinned = np.array([one, other], dtype=np.int64)
    found = igl.lscm(vertices, faces, pinned, np.array([[0.0, 0.0], [apart, 0.0]]))
    uv = np.asarray(found[0] if isinstance(found, tuple) else found)
    sides = vertices[faces[:, 1:]] - vertices[faces[:, :1]]
    area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1).sum()
    laid = uv[faces[:, 1:]] - uv[faces[:, :1]]
    turned = laid[:, 0, 0] * laid[:, 1, 1] - laid[:, 0, 1] * laid[:, 1, 0]
    uv = uv * np.sqrt(area / max(np.abs(turned).sum(), 1e-12))
    slope = np.linalg.lstsq(np.column_stack([uv, np.ones(len(uv))]), -vertices[:, 1], rcond=None)[0][:2]
    down = slope / max(float(np.linalg.norm(slope)), 1e-9)
    return uv @ np.stack([[down[1], -down[0]], down], axis=1)


def pieces(sheet: Sheet) -> list[Int64[np.ndarray, " f"]]:
    """The faces of each pattern piece: those of one number that hang together."""
    found = []
    for number in np.unique(sheet.part):
        mine = np.flatnonzero(sheet.part == number)
        faces = sheet.faces[mine]
        ends = np.concatenate([faces[:, :2], faces[:, 1:]])
        size = len(sheet.vertices)
        graph = coo_matrix((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(size, size))
        label = connected_components(graph, directed=False)[1][faces[:, 0]]
        found += [mine[label == each] for each in np.unique(label)]
    return found


def laid_out(sheet: Sheet) -> Float32[np.ndarray, "F 3 2"]:
    """Texture coordinates at each face's corners."""
    charts = []
    for mine in pieces(sheet):
        used, corners = np.unique(sheet.faces[mine], return_inverse=True)
        corners = corners.reshape(-1, 3).astype(np.int64)
        uv = flat(sheet.vertices[used], corners)
        charts.append((mine, uv[corners] - uv.min(axis=0), np.ptp(uv, axis=0)))
    charts.sort(key=lambda chart: -chart[2][1])
    side = packed_side([chart[2] for chart in charts])
    places = rows([chart[2] for chart in charts], side)[0]
    found = np.zeros((len(sheet.faces), 3, 2))
    for (mine, uv, _), place in zip(charts, places, strict=True):
        found[mine] = (uv + place) / side
    return found.astype(np.float32)


def rows(sizes: list[np.ndarray], width: float) -> tuple[list[np.ndarray], float]:
    """Where boxes, tallest first, lie in rows of a width, and how high they are together."""
    places, x, y, tall = [], GUTTER, GUTTER, 0.0
    for size in sizes:
        if x + size[0] + GUTTER > width and x > GUTTER:
            x, y, tall = GUTTER, y + tall + GUTTER, 0.0
        places.append(np.array([x, y]))
        x, tall = x + size[0] + GUTTER, max(tall, float(size[1]))
    return places, y + tall + GUTTER


def packed_side(sizes: list[np.ndarray]) -> float:
    """The side of a small square that holds all boxes, m."""
    side = max(max(float(size.max()) for size in sizes) + 2 * GUTTER, 0.2)
    while rows(sizes, side)[1] > side:
        side *= 1.03
    return side
