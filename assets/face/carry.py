"""How displacements of the canonical body reach the vertices of any person's face: each takes them at the
closest body point on its own side of the lips and of the lids.

Letters: V welded vertices, N the units' vertices (the body's, then the mouth's own). Metres.
"""

import numpy as np
from jaxtyping import Bool, Float64, Int64
from scipy.sparse import coo_array, csr_array

from assets.face.curves import FRONT, Curves, nearest_segment
from avatargen.body.face import FaceUnits
from avatargen.mesh.closest import ClosestPoints

LIPS_REACH = 0.02  # m above and below the lips' line where sides are told apart
RIMS_AHEAD = 1e-3  # m beyond the corners


def carriers(
    points: Float64[np.ndarray, "V 3"],
    above: Bool[np.ndarray, " V"],
    upper: Int64[np.ndarray, " K"],
    lower: Int64[np.ndarray, " K"],
    margins: tuple[Int64[np.ndarray, " _"], ...],
    units: FaceUnits,
    body: Float64[np.ndarray, "B 3"],
    faces: Int64[np.ndarray, "F 3"],
    curves: Curves,
) -> csr_array:
    """V x N: times the displacements of the units' vertices, those of the skin's. `above` says on which side
    of the lips a vertex lies that is near them."""
    eye = np.isin(np.arange(len(body)), units.eyes)
    lips = np.isin(np.arange(len(body)), np.concatenate([units.upper_lip, units.lower_lip]))
    skin = ~eye[faces].any(axis=1) & ~lips[faces].all(axis=1)
    middle = body[faces].mean(axis=1)
    at_lips = near_lips(middle, curves)
    over = curves.above_lips(middle) > 0
    mouth = near_lips(points, curves)
    sets = (
        (mouth & above, skin & ~(at_lips & ~over)),
        (mouth & ~above, skin & ~(at_lips & over)),
        (~mouth, skin),
    )
    rows, columns, values = [], [], []
    for which, usable in sets:
        vertex = np.flatnonzero(which)
        kept = faces[usable]
        if not len(vertex):
            continue
        _, face, shares = ClosestPoints(body, kept).query(points[vertex])
        rows.append(np.repeat(vertex, 3))
        columns.append(kept[face].reshape(-1))
        values.append(np.asarray(shares, dtype=np.float64).reshape(-1))
    shape = (len(points), len(body) + len(units.inner))
    found = csr_array(
        coo_array((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=shape)
    )
    on_rims = [
        on_chain(points[:, 0], rim, chain, body[chain, 0])
        for rim, chain in ((upper, units.upper_lip), (lower, units.lower_lip))
    ]
    on_rims += [
        on_loop(points, margin, loop, curve)
        for margin, loop, curve in zip(margins, units.lids, curves.lids, strict=True)
    ]
    return replaced(found, on_rims)


def near_lips(points: Float64[np.ndarray, "V 3"], curves: Curves) -> Bool[np.ndarray, " V"]:
    """Where the closest body point may be that of the other lip."""
    return (
        (np.abs(points[:, 0]) < curves.lips[-1, 0] + RIMS_AHEAD)
        & (np.abs(curves.above_lips(points)) < LIPS_REACH)
        & (points[:, 2] > FRONT)
    )


Rows = tuple[Int64[np.ndarray, " _"], Int64[np.ndarray, "_ 2"], Float64[np.ndarray, "_ 2"]]


def on_chain(
    x: Float64[np.ndarray, " V"], rim: Int64[np.ndarray, " K"], chain: Int64[np.ndarray, " A"], at: np.ndarray
) -> Rows:
    """Vertices of a lip's rim between two of the body's, by x."""
    after = np.clip(np.searchsorted(at, x[rim]), 1, len(chain) - 1)
    share = np.clip((x[rim] - at[after - 1]) / np.maximum(at[after] - at[after - 1], 1e-9), 0, 1)
    return rim, np.stack([chain[after - 1], chain[after]], axis=1), np.stack([1 - share, share], axis=1)


def on_loop(
    points: Float64[np.ndarray, "V 3"],
    vertex: Int64[np.ndarray, " N"],
    loop: Int64[np.ndarray, " C"],
    curve: Float64[np.ndarray, "C 2"],
) -> Rows:
    """Vertices on a lid's margin between the two of the body's whose part of the curve is nearest."""
    ends = np.roll(loop, -1)
    side, share, _ = nearest_segment(points[vertex, :2], curve, np.roll(curve, -1, axis=0))
    return vertex, np.stack([loop[side], ends[side]], axis=1), np.stack([1 - share, share], axis=1)


def replaced(found: csr_array, rows: list[Rows]) -> csr_array:
    """The matrix with other rows for some vertices."""
    own = np.ones(len(found.indptr) - 1)
    vertex = np.concatenate([row[0] for row in rows])
    own[vertex] = 0
    columns = np.concatenate([row[1] for row in rows])
    shares = np.concatenate([row[2] for row in rows])
    added = coo_array((shares.reshape(-1), (np.repeat(vertex, 2), columns.reshape(-1))), shape=found.shape)
    return csr_array(found.multiply(own[:, None]).tocsr() + added.tocsr())
