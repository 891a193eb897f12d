"""Numbers at nodes, of a lattice on a body's surface or of a grid in space, that fit what was seen at points
between them: least squares.

Letters: P points, M nodes around each, K numbers each, N nodes. Metres.
"""

import numpy as np
import torch
from jaxtyping import Float, Float32, Float64, Int
from scipy.sparse import csr_matrix
from scipy.spatial import KDTree

from avatargen.body.distance import BodyHit
from avatargen.body.model import CanonicalBody
from avatargen.generator.dressed.lattice import Lattice, at_points, node_places

ROUNDS = 12  # of conjugate gradients: few, so that nodes seen by few points stay near their neighbours'
SEEN = 1e-3  # least share of a point's weight by which a node counts as seen


def fit_nodes(
    nodes: Int[np.ndarray, "P M"],
    weights: Float[np.ndarray, "P M"],
    certain: Float[np.ndarray, " P"],
    values: Float[np.ndarray, "P K"],
    places: Float64[np.ndarray, "N 3"],
    rounds: int = ROUNDS,
) -> Float32[np.ndarray, "N K"]:
    """The nodes' numbers whose weighted sums come nearest to the points' values; `certain` says how much each
    point counts, `places` where the nodes lie. Nodes unseen take the nearest one's; node 0 is zero.
    Fewer `rounds` of conjugate gradients follow single points less.
    """
    rows = np.repeat(np.arange(len(nodes)), nodes.shape[1])
    reading = csr_matrix((weights.ravel(), (rows, nodes.ravel())), shape=(len(nodes), len(places)))
    weighed = reading.multiply(certain[:, None]).tocsr()
    total = np.asarray(weighed.sum(axis=0)).ravel()
    total[0] = 0
    seen = total > SEEN
    seen[0] = False
    found = np.zeros((len(places), values.shape[1]))
    found[seen] = (weighed.T @ values)[seen] / total[seen, None]
    if seen.any() and not seen[1:].all():
        blank = np.flatnonzero(~seen)
        known = np.flatnonzero(seen)
        found[blank] = found[known[KDTree(places[known]).query(places[blank])[1]]]
    found[0] = 0
    normal = (reading.T @ weighed).tocsr()
    scale = np.where(seen, 1 / np.maximum(total, 1e-9), 0.0)  # Jacobi's; nodes unseen stay
    residual = weighed.T @ values - normal @ found
    ahead = scale[:, None] * residual
    way, old = ahead.copy(), (residual * ahead).sum(axis=0)
    for _ in range(rounds):
        pushed = normal @ way
        step = old / np.maximum((way * pushed).sum(axis=0), 1e-12)
        found += step * way
        residual -= step * pushed
        ahead = scale[:, None] * residual
        new = (residual * ahead).sum(axis=0)
        way = ahead + new / np.maximum(old, 1e-12) * way
        old = new
    found[0] = 0
    return found.astype(np.float32)


def fitted(
    body: CanonicalBody, table: Lattice, hit: BodyHit, values: Float[np.ndarray, "P C"]
) -> Float32[np.ndarray, "N C"]:
    """The table's numbers that come nearest to values at body points."""
    nodes, weights = at_points(
        torch.from_numpy(table.face_nodes),
        table.segments,
        torch.from_numpy(hit.face),
        torch.from_numpy(hit.barycentric),
    )
    places = node_places(body.vertices, body.faces, table)
    return fit_nodes(nodes.numpy(), weights.numpy(), np.ones(len(hit.face)), values, places)
