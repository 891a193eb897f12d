"""A garment as a closed volume: where a point lies from its surface, and where on its texture.

Cloth is an open sheet. Each of its openings is closed by a lid, so that the body within counts as inside; the
sign is the winding number (Jacobson et al. 2013, Barill et al. 2018), which is right also where pieces of
cloth overlap. A lid joins every vertex of the edge to a point level with it in the middle: flat where the
edge lies in a plane, and between the halves of an open front there is a gap as deep as that, in which a shirt
is seen. What lids add is inside the body or in the shadow of a hem.
"""

from dataclasses import dataclass
from functools import cached_property

import igl
import numpy as np
from jaxtyping import Bool, Float32, Float64, Int64
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from avatargen.mesh.closest import ClosestPoints
from avatargen.wardrobe.makehuman.load import FittedGarment

ARM_X = 0.1  # m from the middle, farther than which openings are those of arms
UPRIGHT = 0.7  # of an edge's unit normal upward, under which it stands upright
PROBED = 2e-4  # m before and behind faces
PROBES = ((0.34, 0.33, 0.33), (0.8, 0.1, 0.1), (0.1, 0.8, 0.1), (0.1, 0.1, 0.8))  # weights of places on them
WITHIN = 0.01  # least weight of a corner, for a point within a face
CELLS = (0.04, 0.02, 0.01)  # m


@dataclass(frozen=True, kw_only=True)
class GarmentHit:
    """Points as a garment sees them."""

    distance: Float32[np.ndarray, " N"]  # m, negative inside
    rim: Float32[np.ndarray, " N"]  # m along the cloth from the closest point to an edge; 0 on the lids
    face: Int64[np.ndarray, " N"]  # of the sheet, the closest one
    barycentric: Float64[np.ndarray, "N 3"]


def boundary_loops(faces: Int64[np.ndarray, "F 3"]) -> list[Int64[np.ndarray, " n"]]:
    """The closed walks along edges that one face alone has, in the faces' direction."""
    ends = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    count = int(faces.max()) + 1
    there, back = ends[:, 0] * count + ends[:, 1], ends[:, 1] * count + ends[:, 0]
    open_ends = ends[~np.isin(there, back)]
    following: dict[int, list[int]] = {}
    for start, end in open_ends:
        following.setdefault(int(start), []).append(int(end))
    loops = []
    while following:
        start = next(iter(following))
        walk = [start]
        while True:
            steps = following.get(walk[-1])
            if not steps:
                break
            step = steps.pop()
            if not steps:
                del following[walk[-1]]
            if step == start:
                break
            walk.append(step)
        if len(walk) > 2:
            loops.append(np.array(walk))
    return loops


def lid(edge: Float64[np.ndarray, "n 3"]) -> Float64[np.ndarray, "n 3"]:
    """Where each vertex of an opening's edge is joined to: level with it, on the upright line in the edge's
    middle. About an arm that line leans as the edge does, so that nothing stands out over the shoulder."""
    middle = (edge.min(axis=0) + edge.max(axis=0)) / 2
    found = np.stack([np.full(len(edge), middle[0]), edge[:, 1], np.full(len(edge), middle[2])], axis=1)
    normal = np.linalg.svd(edge - edge.mean(axis=0), full_matrices=False)[2][2]
    if abs(middle[0]) > ARM_X and abs(normal[1]) < UPRIGHT:
        found[:, 0] -= (edge[:, 1] - middle[1]) * normal[1] / normal[0] if abs(normal[0]) > UPRIGHT else 0.0
    return found


@dataclass(frozen=True, kw_only=True, eq=False)
class Solid:
    """A fitted garment as a volume."""

    garment: FittedGarment

    @cached_property
    def loops(self) -> list[Int64[np.ndarray, " n"]]:
        return boundary_loops(self.garment.faces)

    @cached_property
    def closed(self) -> tuple[Float64[np.ndarray, "W 3"], Int64[np.ndarray, "G 3"]]:
        """Vertices of the sheet, then of the lids; faces likewise."""
        vertices, faces = self.garment.vertices.astype(np.float64), [self.garment.faces]
        parts, count = [vertices], len(vertices)
        for loop in self.loops:
            parts.append(lid(vertices[loop]))
            inner = count + np.arange(len(loop))
            after, inner_after = np.roll(loop, -1), np.roll(inner, -1)
            faces += [np.stack([after, loop, inner], axis=1), np.stack([after, inner, inner_after], axis=1)]
            count += len(loop)
        return np.concatenate(parts), np.concatenate(faces)

    @cached_property
    def rims(self) -> Float64[np.ndarray, " W"]:
        """Each vertex's way along the cloth to its nearest edge, m; 0 in the lids."""
        vertices, _ = self.closed
        faces = self.garment.faces
        ends = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
        length = np.linalg.norm(vertices[ends[:, 0]] - vertices[ends[:, 1]], axis=1) + 1e-9
        graph = csr_matrix((length, (ends[:, 0], ends[:, 1])), shape=(len(vertices),) * 2)
        if not self.loops:
            return np.full(len(vertices), 1.0)
        way = dijkstra(graph, directed=False, indices=np.concatenate(self.loops), min_only=True)
        way[len(self.garment.vertices) :] = 0.0
        return np.minimum(np.nan_to_num(way, posinf=1.0), 1.0)

    @cached_property
    def opening(self) -> tuple[Float64[np.ndarray, "3"], Float64[np.ndarray, "3"]]:
        """The plane of the longest edge: a point of it and its unit normal, which points upward."""
        rims = [self.garment.vertices[loop].astype(np.float64) for loop in self.loops]
        rim = max(rims, key=lambda each: float(np.ptp(each, axis=0).sum()), default=self.garment.vertices)
        centre = rim.mean(axis=0)
        normal = np.linalg.svd(rim - centre, full_matrices=False)[2][2]
        return centre, normal * (1 if normal[1] >= 0 else -1)

    def above_opening(self, points: Float32[np.ndarray, "N 3"]) -> Float64[np.ndarray, " N"]:
        """Metres that points lie above the plane of the longest edge."""
        centre, normal = self.opening
        return (points - centre) @ normal

    def wound(self, points: Float64[np.ndarray, "N 3"]) -> Bool[np.ndarray, " N"]:
        """Whether the closed surface goes around points."""
        if len(points) == 0:
            return np.zeros(0, dtype=bool)
        return np.asarray(igl.fast_winding_number(*self.closed, points)) > 0.5

    @cached_property
    def normals(self) -> Float64[np.ndarray, "G 3"]:
        """Unit normals of the closed surface's faces."""
        corners = self.closed[0][self.closed[1]]
        found = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        return found / np.maximum(np.linalg.norm(found, axis=1, keepdims=True), 1e-15)

    @cached_property
    def parting(self) -> Bool[np.ndarray, " G"]:
        """The faces that have the inside behind them and the outside before them: not those that lie within,
        as where pieces of cloth overlap."""
        corners = self.closed[0][self.closed[1]]
        found = np.ones(len(corners), dtype=bool)
        for weights in PROBES:
            at = np.einsum("k,gka->ga", np.array(weights), corners)
            found &= ~self.wound(at + PROBED * self.normals) & self.wound(at - PROBED * self.normals)
        return found

    def inside(
        self,
        points: Float64[np.ndarray, "N 3"],
        distance: Float64[np.ndarray, " N"],
        face: Int64[np.ndarray, " N"],
        barycentric: Float64[np.ndarray, "N 3"],
    ) -> Bool[np.ndarray, " N"]:
        """Whether points lie inside, given the closest point of the closed surface.

        Where that is within a face which parts inside from outside, the side of the face says so. Of points
        farther off than a cell of space is wide, one of a cell speaks for all. Winding numbers, which take
        eight times as long as closest points, say it of the rest.
        """
        vertices, faces = self.closed
        found = np.zeros(len(points), dtype=bool)
        plain = self.parting[face] & (barycentric.min(axis=1) > WITHIN)
        corner = vertices[faces[face[plain], 0]]
        found[plain] = ((points[plain] - corner) * self.normals[face[plain]]).sum(axis=1) < 0
        left = np.flatnonzero(~plain)
        for side in CELLS:
            far = distance[left] > np.sqrt(3) * side
            cells = np.floor(points[left[far]] / side).astype(np.int64)
            key = (cells[:, 0] * 4096 + cells[:, 1]) * 4096 + cells[:, 2]
            _, first, cell = np.unique(key, return_index=True, return_inverse=True)
            found[left[far]] = self.wound(points[left[far][first]])[cell]
            left = left[~far]
        found[left] = self.wound(points[left])
        return found

    @cached_property
    def sheet_tree(self) -> ClosestPoints:
        return ClosestPoints(self.garment.vertices.astype(np.float64), self.garment.faces)

    @cached_property
    def closed_tree(self) -> ClosestPoints:
        return ClosestPoints(*self.closed)

    def distance(self, points: Float32[np.ndarray, "N 3"]) -> Float32[np.ndarray, " N"]:
        """Signed distance to the closed volume, m."""
        return self.hit(points, self.garment.vertices.max()).distance

    def hit(self, points: Float32[np.ndarray, "N 3"], reach: float = 0.05) -> GarmentHit:
        """Distances and closest points. Further than `reach` (m) off the garment's box, the distance to the
        box stands for it."""
        low, high = self.garment.vertices.min(axis=0), self.garment.vertices.max(axis=0)
        off = np.linalg.norm(points - np.clip(points, low, high), axis=1)
        near = np.flatnonzero(off < reach)
        distance = np.maximum(off, 0.8 * reach).astype(np.float32)
        rim = np.zeros(len(points), dtype=np.float32)
        face = np.zeros(len(points), dtype=np.int64)
        barycentric = np.tile(np.array([1.0, 0, 0]), (len(points), 1))
        if len(near):
            asked = np.ascontiguousarray(points[near], dtype=np.float64)
            squared, closest, corners = self.closed_tree.query(asked)
            inside = self.inside(asked, np.sqrt(squared), closest, corners)
            distance[near] = np.where(inside, -1, 1) * np.sqrt(squared)
            on_lid = closest >= len(self.garment.faces)
            rim[near] = np.where(on_lid, 0, (self.rims[self.closed[1][closest]] * corners).sum(axis=1))
            if on_lid.any():  # colours are those of the cloth nearest by
                _, again, weights = self.sheet_tree.query(asked[on_lid])
                closest[on_lid], corners[on_lid] = again, weights
            face[near], barycentric[near] = closest, corners
        return GarmentHit(distance=distance, rim=rim, face=face, barycentric=barycentric)
