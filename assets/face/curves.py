"""Where a face opens, as curves in canonical space seen from the front: the line of the lips and the margins
of the lids; and a mesh whose edges follow them.

Letters: N points, V welded vertices. Metres.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int64
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components, dijkstra

from assets.errors import GeometryError
from assets.face.cut import CutMesh, insert, split_edges
from assets.mesh.surface import directed_edges
from avatargen.body.face import FaceUnits

FRONT = 0.105  # m: the face's surface lies before
SNAP = 0.15  # of an edge: a vertex so near to a curve counts as on it
FINEST = 0.0022  # m of edge at a curve
GROWTH = 0.6  # m of edge more for a metre away from it
ROUNDS = 6
RIM = 0.5  # of the way from a lid to the eye: where the eye's paint begins
NEAR = 0.010  # m from a curve up to which edges are split
FAR = 0.03  # m from a curve, beyond which nobody asks how far it is
CORNER = 0.06  # barycentric: a point so near to a vertex or an edge is put there


@dataclass(frozen=True, kw_only=True)
class Curves:
    """The lips' line from the right corner to the left one, and the margin of each lid, left eye first; x and
    y."""

    lips: Float64[np.ndarray, "K 2"]
    lids: tuple[Float64[np.ndarray, "_ 2"], ...]

    def above_lips(self, points: Float64[np.ndarray, "N 3"]) -> Float64[np.ndarray, " N"]:
        """Metres above the line of the lips."""
        return points[:, 1] - np.interp(points[:, 0], *self.lips.T)

    def outside(self, points: Float64[np.ndarray, "N 3"], eye: int) -> Float64[np.ndarray, " N"]:
        """Metres outside a lid's margin, negative within; `FAR` from there on and behind the face."""
        loop = self.lids[eye]
        found = np.full(len(points), FAR)
        beside = np.abs(points[:, :2] - loop.mean(axis=0)).max(axis=1) < FAR
        near = np.flatnonzero(beside & (points[:, 2] > FRONT))
        distance, inside = to_polygon(points[near, :2], loop)
        found[near] = np.where(inside, -distance, distance)
        return found

    def distance(self, points: Float64[np.ndarray, "N 3"]) -> Float64[np.ndarray, " N"]:
        """Metres, seen from the front, to the nearest of the curves; infinite farther than any face is."""
        found = np.full(len(points), np.inf)
        ends = np.concatenate([self.lips, *self.lids])
        low, high = ends.min(axis=0) - FAR, ends.max(axis=0) + FAR
        flat = points[:, :2]
        near = np.flatnonzero(((flat > low) & (flat < high)).all(axis=1) & (points[:, 2] > FRONT))
        starts = np.concatenate([self.lips[:-1], *self.lids])
        ends = np.concatenate([self.lips[1:], *(np.roll(loop, -1, axis=0) for loop in self.lids)])
        found[near] = nearest_segment(flat[near], starts, ends)[2]
        return found


def nearest_segment(
    points: Float64[np.ndarray, "N D"], starts: Float64[np.ndarray, "K D"], ends: Float64[np.ndarray, "K D"]
) -> tuple[Int64[np.ndarray, " N"], Float64[np.ndarray, " N"], Float64[np.ndarray, " N"]]:
    """Of some segments the nearest one's number, how far along it the point lies, 0..1, and the distance."""
    way, off = ends - starts, points[:, None] - starts
    share = np.clip((off * way).sum(axis=2) / np.maximum((way**2).sum(axis=1), 1e-18), 0, 1)
    distance = np.linalg.norm(off - share[..., None] * way, axis=2)
    row, nearest = np.arange(len(points)), distance.argmin(axis=1)
    return nearest, share[row, nearest], distance[row, nearest]


def to_polygon(
    points: Float64[np.ndarray, "N 2"], loop: Float64[np.ndarray, "K 2"]
) -> tuple[Float64[np.ndarray, " N"], Bool[np.ndarray, " N"]]:
    """Distance to a polygon's border, and whether a point is inside."""
    ends = np.roll(loop, -1, axis=0)
    x, y = points[:, :1], points[:, 1:]
    crosses = (loop[:, 1] > y) != (ends[:, 1] > y)
    rise = np.where(np.abs(ends[:, 1] - loop[:, 1]) > 1e-12, ends[:, 1] - loop[:, 1], 1e-12)
    right = x < loop[:, 0] + (y - loop[:, 1]) / rise * (ends[:, 0] - loop[:, 0])
    return nearest_segment(points, loop, ends)[2], (crosses & right).sum(axis=1) % 2 == 1


def face_curves(
    units: FaceUnits, body: Float64[np.ndarray, "B 3"], faces: Int64[np.ndarray, "F 3"]
) -> Curves:
    """The curves on the canonical body."""
    upper, lower = body[units.upper_lip], body[units.lower_lip]
    x = np.linspace(upper[0, 0], upper[-1, 0], 41)
    middle = (np.interp(x, upper[:, 0], upper[:, 1]) + np.interp(x, lower[:, 0], lower[:, 1])) / 2
    lids = tuple(rim_of_lids(loop, units.eyes, body[:, :2], faces) for loop in units.lids)
    return Curves(lips=np.stack([x, middle], axis=1), lids=lids)


def rim_of_lids(
    loop: Int64[np.ndarray, " C"],
    eyes: Int64[np.ndarray, " E"],
    body: Float64[np.ndarray, "B 2"],
    faces: Int64[np.ndarray, "F 3"],
) -> Float64[np.ndarray, "C 2"]:
    """Where skin ends and an eye begins to be painted: halfway from the lids' last vertices to the eye's
    first ones."""
    edges = directed_edges(faces)
    edges = edges[np.isin(edges[:, 0], loop) & np.isin(edges[:, 1], eyes)]
    found = np.zeros((len(loop), 2))
    for number, vertex in enumerate(loop):
        inner = body[edges[edges[:, 0] == vertex, 1]]
        found[number] = body[vertex] + RIM * (inner.mean(axis=0) - body[vertex]) if len(inner) else np.nan
    here = np.flatnonzero(~np.isnan(found[:, 0]))
    rows = np.arange(len(loop))
    return np.stack([np.interp(rows, here, found[here, k], period=len(loop)) for k in (0, 1)], axis=1)


def refined(mesh: CutMesh, curves: Curves) -> CutMesh:
    """The mesh with edges near the curves no longer than it takes to bend along them."""
    for _ in range(ROUNDS):
        edges, points = mesh.edges(), mesh.points
        ends = points[edges]
        length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        may = np.flatnonzero((length > FINEST) & (ends[:, :, 2].max(axis=1) > FRONT))
        away = curves.distance(points)[edges[may]].min(axis=1)
        for share in (0.25, 0.5, 0.75):  # an edge across a curve is near it, however long it is
            between = ends[may, 0] + share * (ends[may, 1] - ends[may, 0])
            away = np.minimum(away, curves.distance(between))
        long = may[(away < NEAR) & (length[may] > FINEST + GROWTH * np.minimum(away, NEAR))]
        if not len(long):
            break
        mesh = split_edges(mesh, edges[long], np.full(len(long), 0.5))
    return mesh


def cut_lids(mesh: CutMesh, curves: Curves, eye: int) -> tuple[CutMesh, Bool[np.ndarray, " V"]]:
    """The mesh with vertices wherever an edge crosses the margin of an eye's lids, and which vertices lie
    within."""
    edges, points = mesh.edges(), mesh.points
    off = curves.outside(points, eye)
    within = largest(edges, ~largest(edges, off > 0))
    off = np.where(within, np.minimum(off, 0), np.maximum(off, 1e-9))
    ends = off[edges]
    crossing = (ends[:, 0] > 0) != (ends[:, 1] > 0)
    edges, ends = edges[crossing], ends[crossing]
    low, high = np.zeros(len(edges)), np.ones(len(edges))
    for _ in range(20):  # bisection: the distance is no straight line along an edge
        share = (low + high) / 2
        here = curves.outside(
            points[edges[:, 0]] + share[:, None] * (points[edges[:, 1]] - points[edges[:, 0]]), eye
        )
        before = (here > 0) == (ends[:, 0] > 0)
        low, high = np.where(before, share, low), np.where(before, high, share)
    split = split_edges(mesh, edges, np.clip((low + high) / 2, 0.02, 0.98))
    return split, np.concatenate([off <= 0, np.zeros(len(edges), bool)])


def largest(edges: Int64[np.ndarray, "E 2"], chosen: Bool[np.ndarray, " V"]) -> Bool[np.ndarray, " V"]:
    """Of the chosen vertices those of the largest patch that edges hold together: a fold of a lid may hang
    over the margin."""
    inner = edges[chosen[edges].all(axis=1)]
    graph = coo_array((np.ones(len(inner)), inner.T), shape=(len(chosen),) * 2)
    _, label = connected_components(graph, directed=False)
    return chosen & (label == np.bincount(label[chosen], minlength=1).argmax())


def turn(u: Float64[np.ndarray, "N 2"], v: Float64[np.ndarray, "N 2"]) -> Float64[np.ndarray, " N"]:
    """Twice the area between two directions, positive to the left."""
    return u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]


def front_face(mesh: CutMesh, place: Float64[np.ndarray, "2"]) -> tuple[int, Float64[np.ndarray, "3"]]:
    """The foremost face over a place seen from the front, and where on it.

    Raises:
        GeometryError: nothing lies there.
    """
    triangles = mesh.places[mesh.faces]
    near = np.flatnonzero(
        (np.abs(triangles[:, :, 0] - place[0]).min(axis=1) < 0.05)
        & (triangles[:, :, 2].max(axis=1) > FRONT)
        & (np.abs(triangles[:, :, 1] - place[1]).min(axis=1) < 0.05)
    )
    a, b, c = (triangles[near, k, :2] for k in range(3))
    area = turn(b - a, c - a)
    safe = np.where(np.abs(area) > 1e-12, area, np.inf)
    corners = (turn(b - place, c - place), turn(c - place, a - place), turn(a - place, b - place))
    shares = np.stack(corners, axis=1) / safe[:, None]
    over = (shares.min(axis=1) > -1e-9) & (area > 0)
    if not over.any():
        raise GeometryError("face: no surface lies over a corner of the mouth; leave the face as it is")
    depth = np.where(over, (shares * triangles[near, :, 2]).sum(axis=1), -np.inf)
    best = int(depth.argmax())
    return int(near[best]), np.clip(shares[best], 0, 1) / np.clip(shares[best], 0, 1).sum()


def with_corner(mesh: CutMesh, place: Float64[np.ndarray, "2"]) -> tuple[CutMesh, int]:
    """The mesh with a welded vertex at a place seen from the front, and its number."""
    face, shares = front_face(mesh, place)
    corners = mesh.faces[face]
    if shares.max() > 1 - CORNER:
        return mesh, int(mesh.welded[corners[shares.argmax()]])
    if shares.min() < CORNER:
        a, b = np.delete(corners, shares.argmin())
        share = np.delete(shares, shares.argmin())
        edge = mesh.welded[[a, b]]
        order = np.argsort(edge)
        new = int(mesh.welded.max()) + 1
        return split_edges(mesh, edge[order][None], share[order][1:] / share.sum()), new
    return insert(mesh, face, shares), int(mesh.welded.max()) + 1


def cut_lips(mesh: CutMesh, curves: Curves) -> tuple[CutMesh, Int64[np.ndarray, " N"]]:
    """The mesh with edges along the line of the lips, and the welded vertices there from corner to corner."""
    mesh, right = with_corner(mesh, curves.lips[0])
    mesh, left = with_corner(mesh, curves.lips[-1])
    edges, points = mesh.edges(), mesh.points
    above = curves.above_lips(points)
    near = (np.abs(above) < 0.02) & (points[:, 2] > FRONT + 0.015)
    between = (points[:, 0] > points[right, 0]) & (points[:, 0] < points[left, 0])
    above[[right, left]] = 0.0
    ends = above[edges]
    share = ends[:, 0] / np.where(ends[:, 0] == ends[:, 1], np.inf, ends[:, 0] - ends[:, 1])
    crossing = (ends[:, 0] * ends[:, 1] < 0) & near[edges].all(axis=1)
    on_it = np.isin(np.arange(len(points)), [right, left])
    for end, far in ((0, share < SNAP), (1, share > 1 - SNAP)):
        at = edges[crossing & far, end]
        on_it[at[between[at]]] = True
    x = points[edges[:, 0], 0] + share * (points[edges[:, 1], 0] - points[edges[:, 0], 0])
    crossing &= ~on_it[edges].any(axis=1) & (x > points[right, 0]) & (x < points[left, 0])
    first = int(mesh.welded.max()) + 1
    mesh = split_edges(mesh, edges[crossing], share[crossing])
    on_it = np.concatenate([on_it, np.ones(int(crossing.sum()), bool)])
    assert len(on_it) == first + crossing.sum()
    return mesh, shortest_way(mesh, on_it, right, left)


def shortest_way(
    mesh: CutMesh, allowed: Bool[np.ndarray, " V"], start: int, end: int
) -> Int64[np.ndarray, " N"]:
    """The shortest way along edges between allowed welded vertices.

    Raises:
        GeometryError: there is none.
    """
    edges, points = mesh.edges(), mesh.points
    edges = edges[allowed[edges].all(axis=1)]
    length = np.linalg.norm(points[edges[:, 1]] - points[edges[:, 0]], axis=1)
    graph = coo_array((length + 1e-9, edges.T), shape=(len(points),) * 2).tocsr()
    _, before = dijkstra(graph, directed=False, indices=start, return_predecessors=True)
    way = [end]
    while way[-1] != start:
        if before[way[-1]] < 0:
            raise GeometryError("face: the lips' line breaks off on this surface; leave the face as it is")
        way.append(int(before[way[-1]]))
    return np.array(way[::-1])
