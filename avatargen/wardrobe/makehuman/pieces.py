"""Splitting an outfit into garments: MakeHuman's suits hold shirt, trousers, jacket and tie in one mesh.

Pieces that hang together by edges are one garment; a piece too small to be worn alone (buttons, buckles)
belongs to the nearest larger one. What a piece is, follows from how much of the body it spans.
"""

import numpy as np
from jaxtyping import Float, Int64
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

SMALL = 130  # vertices; MakeHuman's ties and collars have more, its buckles and buttons fewer


def pieces_of(vertices: Float[np.ndarray, "V 3"], faces: Int64[np.ndarray, "F 3"]) -> list[np.ndarray]:
    """The faces of each garment of a mesh, large ones first."""
    ends = np.concatenate([faces[:, :2], faces[:, 1:]])
    graph = coo_matrix((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(len(vertices),) * 2)
    _, label = connected_components(graph, directed=False)
    used = np.unique(faces)
    names, counts = np.unique(label[used], return_counts=True)
    large = names[counts >= min(SMALL, counts.max())]
    tree = KDTree(vertices[used[np.isin(label[used], large)]])
    owner = label[used[np.isin(label[used], large)]]
    for name in names[~np.isin(names, large)]:
        mine = used[label[used] == name]
        label[mine] = owner[tree.query(vertices[mine].mean(axis=0))[1]]
    groups = [np.flatnonzero(label[faces[:, 0]] == name) for name in large]
    return sorted(groups, key=len, reverse=True)


def kind_of(height: Float[np.ndarray, " V"]) -> str:
    """What a piece is, from its vertices' heights at rest as shares of the body's height."""
    low, high = float(height.min()), float(height.max())
    if high < 0.25:
        return "shoes" if low < 0.02 else "socks"
    if low > 0.85:
        return "hat"
    if high < 0.72:
        return "bottom"
    if low > 0.3:
        return "top"
    return "overall"
