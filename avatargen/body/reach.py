"""How far each point of a closed surface owns the space outside it: to the medial axis.

The closest body point to a point at distance d moves smoothly until d reaches the radius of the largest
ball that touches the body there from outside and holds no other body point. At that radius the closest point
jumps: between toes, under arms, between the legs. What is read at the closest point must have faded out by
then, or it jumps too. Above each shallow dent of a mesh there is a jump that grows with d; balls that touch
twice within a small angle do not count, and `largest` bounds how far those jumps can get.

The balls are found by shrinking (Ma, Bae and Choi 2012): start large, move the far side to the vertex found
inside, until none is. float64. Letters: V vertices, F faces. Metres.
"""

import numpy as np
from jaxtyping import Float, Float64, Int64
from scipy.spatial import KDTree

ROUNDS = 30
SHALLOW = np.cos(np.radians(30))  # a ball that touches twice within this angle met the mesh's own roughness


def outer_reach(
    vertices: Float[np.ndarray, "V 3"], faces: Int64[np.ndarray, "F 3"], largest: float
) -> Float64[np.ndarray, " V"]:
    """Radius of the largest empty ball outside a closed surface at each vertex, at most `largest` metres."""
    p = vertices.astype(np.float64)
    n = unit_normals(p, faces)
    tree = KDTree(p)
    radius = np.full(len(p), largest)
    active = np.arange(len(p))
    for _ in range(ROUNDS):
        center = p[active] + radius[active, None] * n[active]
        distance, index = tree.query(center)
        gap = p[index] - p[active]
        height = (gap * n[active]).sum(axis=1)
        hit = (index != active) & (distance < radius[active] * (1 - 1e-6)) & (height > 0)
        active, gap, height = active[hit], gap[hit], height[hit]
        shrunk = (gap**2).sum(axis=1) / (2 * height)  # height > 0 where hit
        cosine = 1 - height / shrunk  # of the angle between the two touching points, seen from the centre
        deep = (cosine < SHALLOW) & (shrunk < radius[active])
        active, shrunk = active[deep], shrunk[deep]
        radius[active] = shrunk
        if not len(active):
            break
    return radius


def unit_normals(
    vertices: Float64[np.ndarray, "V 3"], faces: Int64[np.ndarray, "F 3"]
) -> Float64[np.ndarray, "V 3"]:
    """Outward normals at the vertices; zero where a vertex has no face."""
    corners = vertices[faces]
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    total = np.zeros((len(vertices), 3))
    np.add.at(total, faces, area[:, None])
    return total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-300)
