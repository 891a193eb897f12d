"""Exact signed distance to a closed body mesh, with the closest face and where on it.

The closest point comes from `avatargen.body.closest`; the sign from the angle-weighted pseudonormal of the
feature it lies on (face, edge or vertex: Baerentzen and Aanaes 2005), which is right everywhere for a closed,
consistently oriented mesh. float64 inside.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float32, Float64, Int64

from avatargen.errors import FieldError, InputError

ON_EDGE = 1e-9  # barycentric coordinate under which a closest point counts as on the opposite edge
CELL = 0.02  # metres; points nearer than this to their predecessor count as coherent
COHERENCE_SAMPLE = 4096


@dataclass(frozen=True, kw_only=True)
class BodyHit:
    """Signed distance (metres, negative inside) and closest point: a face, and its corners' weights."""

    distance: Float32[np.ndarray, " N"]
    face: Int64[np.ndarray, " N"]
    barycentric: Float32[np.ndarray, "N 3"]


class BodyDistance:
    """Signed distances to one closed triangle mesh; the tree and the pseudonormals are built once.

    Raises:
        InputError: fewer than one face, or not finite.
    """

    def __init__(self, vertices: Float[np.ndarray, "V 3"], faces: Int64[np.ndarray, "F 3"]) -> None:
        from avatargen.body.closest import ClosestPoints

        self.vertices = np.ascontiguousarray(vertices, dtype=np.float64)
        self.faces = np.ascontiguousarray(faces, dtype=np.int64)
        if len(self.faces) == 0 or not np.isfinite(self.vertices).all():
            raise InputError(
                "body distance: the mesh has no faces or is not finite; give a closed triangle mesh"
            )
        self.features = pseudonormals(self.vertices, self.faces)  # F 7 3
        self.closest = ClosestPoints(self.vertices, self.faces)

    def query(self, points: Float[np.ndarray, "N 3"]) -> BodyHit:
        """Closest points and signed distances.

        Raises:
            FieldError: a point is NaN or infinite.
        """
        points = np.ascontiguousarray(points, dtype=np.float64)
        if not np.isfinite(points).all():
            raise FieldError("body distance: points hold NaN or infinity; ask at finite points")
        if len(points) == 0:
            return BodyHit(
                distance=np.zeros(0, np.float32),
                face=np.zeros(0, np.int64),
                barycentric=np.zeros((0, 3), np.float32),
            )
        order = coherent_order(points)
        if order is None:
            return self.query_in_order(points)
        hit = self.query_in_order(points[order])
        back = np.empty_like(order)
        back[order] = np.arange(len(order))
        return BodyHit(distance=hit.distance[back], face=hit.face[back], barycentric=hit.barycentric[back])

    def query_in_order(self, points: Float64[np.ndarray, "N 3"]) -> BodyHit:
        """`query` without its checks, in the given order."""
        squared, face, barycentric = self.closest.query(points)
        foot = np.einsum("nc,ncd->nd", barycentric, self.vertices[self.faces[face]])
        normal = self.features.reshape(-1, 3)[7 * face + feature(barycentric)]
        inside = dot(points - foot, normal) < 0
        distance = np.sqrt(squared)
        return BodyHit(
            distance=np.where(inside, -distance, distance).astype(np.float32),
            face=face,
            barycentric=barycentric.astype(np.float32),
        )


def coherent_order(points: Float64[np.ndarray, "N 3"]) -> Int64[np.ndarray, " N"] | None:
    """An order in which neighbours follow each other, or None where they already do.

    The search begins where the last one ended: about twice as fast as points in random order.
    """
    sample = points[: COHERENCE_SAMPLE + 1]
    if len(points) <= COHERENCE_SAMPLE or np.median(np.abs(np.diff(sample, axis=0)).max(axis=1)) < CELL:
        return None
    cell = np.clip((points - points.min(axis=0)) / CELL, 0, 1023).astype(np.int32)
    return np.argsort((cell[:, 0] * 1024 + cell[:, 1]) * 1024 + cell[:, 2], kind="stable")


def dot(a: Float64[np.ndarray, "N 3"], b: Float64[np.ndarray, "N 3"]) -> Float64[np.ndarray, " N"]:
    return np.einsum("nd,nd->n", a, b)


def feature(barycentric: Float64[np.ndarray, "N 3"]) -> Int64[np.ndarray, " N"]:
    """What a point of a face lies on: 0 the face, 1-3 the edge opposite corner 0-2, 4-6 corner 0-2."""
    zero = barycentric <= ON_EDGE
    code = zero @ np.array([1, 2, 4])
    return np.array([0, 1, 2, 6, 3, 5, 4, 0])[code]


def pseudonormals(
    vertices: Float64[np.ndarray, "V 3"], faces: Int64[np.ndarray, "F 3"]
) -> Float64[np.ndarray, "F 7 3"]:
    """Outward pseudonormals of each face's seven features, in the order of `feature`; not of unit length."""
    corners = vertices[faces]  # F 3 3
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    return np.concatenate(
        [normal[:, None], edge_normals(faces, normal), vertex_normals(corners, faces, normal, len(vertices))],
        axis=1,
    )


def edge_normals(
    faces: Int64[np.ndarray, "F 3"], normal: Float64[np.ndarray, "F 3"]
) -> Float64[np.ndarray, "F 3 3"]:
    """Sum of the normals of the faces at each edge; edge i lies opposite corner i."""
    edges = np.sort(
        np.stack([faces[:, [1, 2]], faces[:, [2, 0]], faces[:, [0, 1]]], axis=1).reshape(-1, 2), axis=1
    )
    _, index = np.unique(edges[:, 0] * (faces.max() + 1) + edges[:, 1], return_inverse=True)
    total = np.zeros((index.max() + 1, 3))
    np.add.at(total, index, np.repeat(normal, 3, axis=0))
    return total[index].reshape(-1, 3, 3)


def vertex_normals(
    corners: Float64[np.ndarray, "F 3 3"],
    faces: Int64[np.ndarray, "F 3"],
    normal: Float64[np.ndarray, "F 3"],
    count: int,
) -> Float64[np.ndarray, "F 3 3"]:
    """Sum of the normals of the faces at each corner, weighted by their angles there."""
    forward = np.roll(corners, -1, axis=1) - corners
    backward = np.roll(corners, 1, axis=1) - corners
    sine = np.linalg.norm(np.cross(forward, backward), axis=2)
    angle = np.arctan2(sine, (forward * backward).sum(axis=2))  # F 3
    total = np.zeros((count, 3))
    np.add.at(total, faces, angle[..., None] * normal[:, None])
    return total[faces]
