"""The closest points of bodies' surfaces, exactly, as tensors on devices that follow no tree.

Faces stand in the order of a tree (`avatargen.mesh.closest`), `LEAF` to a leaf and `LEAVES` leaves to a
group, so that whole groups are ruled out by their boxes; a known near vertex bounds the distance from the
start. Where no kernel can be made every face is measured. The sign is that of `avatargen.body.distance`.

Letters: B bodies (1: the canonical one for all), N points, F faces, V vertices, M faces in the tree's order,
the last one repeated to fill whole groups, G groups, W leaves of one. Metres.
"""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Int64
from torch import Tensor

from avatargen.generator.nearest import has_triton
from avatargen.mesh.closest import LEAF, build_tree

LEAVES = 32
ON_EDGE = 1e-6  # barycentric coordinate under which a closest point counts as on the opposite edge
FLAT = 1e-12  # squared sine of the angle between two edges, under which a face counts as without area
MEASURED = 1 << 22  # faces that are measured at once where no kernel is


@dataclass(frozen=True, kw_only=True, eq=False)
class Topology:
    """How the faces of a closed mesh hang together, and their order."""

    faces: Int64[Tensor, "F 3"]
    edges: Int64[Tensor, "F 3"]  # number of the edge opposite each corner
    edge_count: int
    order: Int64[Tensor, " M"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Surfaces:
    """Surfaces of one topology."""

    topology: Topology
    vertices: Float[Tensor, "B V 3"]
    rows: Float[Tensor, "B M 18"]  # a corner, two edges, two gradients; inverse squared lengths
    leaves: Float[Tensor, "B G W 6"]  # boxes: low corner and high
    groups: Float[Tensor, "B G 6"]
    normals: Float[Tensor, "B F 7 3"]  # of the face, the edges opposite its corners, and its corners


@dataclass(frozen=True, kw_only=True)
class Closest:
    """A point of the surface: signed distance, negative inside; the face, and its corners' weights."""

    distance: Float[Tensor, "B N"]
    face: Int64[Tensor, "B N"]
    barycentric: Float[Tensor, "B N 3"]


def closest_on(surfaces: Surfaces, points: Float[Tensor, "B N 3"], near: Int64[Tensor, "B N"]) -> Closest:
    """The closest points; `near` are vertices not far from the points. Without gradients."""
    points = points.detach().float()
    if points.device.type == "cuda" and has_triton():
        from avatargen.generator.closest_kernel import search_by_kernel

        place, second, third = search_by_kernel(surfaces, points, near)
    else:
        place, second, third = search_all(surfaces, points)
    rows = surfaces.rows.gather(1, place[..., None].expand(-1, -1, 9))
    corner, along, across = rows.split(3, dim=2)
    away = points - corner - second[..., None] * along - third[..., None] * across
    weights = torch.stack([1 - second - third, second, third], dim=2)
    on_edge = weights <= ON_EDGE
    zeros = on_edge.sum(dim=2)
    edge, tip = on_edge.byte().argmax(dim=2) + 1, (~on_edge).byte().argmax(dim=2) + 4
    feature = torch.where(zeros == 1, edge, torch.where(zeros == 2, tip, 0))
    face = surfaces.topology.order[place]
    normal = surfaces.normals.flatten(1, 2).gather(1, (face * 7 + feature)[..., None].expand(-1, -1, 3))
    inside = (away * normal).sum(dim=2) < 0
    distance = away.square().sum(dim=2).sqrt()
    return Closest(
        distance=torch.where(inside, -distance, distance), face=face, barycentric=weights.clamp_min(0)
    )


def search_all(
    surfaces: Surfaces, points: Float[Tensor, "B N 3"]
) -> tuple[Int64[Tensor, "B N"], Float[Tensor, "B N"], Float[Tensor, "B N"]]:
    """The faces' places in the tree's order, and the weights of their second and third corners."""
    width = max(1, MEASURED // (len(points) * surfaces.rows.shape[1]))
    found = []
    for some in points.split(width, dim=1):
        squared, second, third = measure(some, surfaces.rows[:, None])
        best = squared.argmin(dim=2, keepdim=True)
        found.append([part.gather(2, best)[..., 0] for part in (second, third)] + [best[..., 0]])
    second, third, place = (torch.cat(part, dim=1) for part in zip(*found, strict=True))
    return place, second, third


def measure(
    points: Float[Tensor, "B N 3"], rows: Float[Tensor, "B *N M 18"]
) -> tuple[Float[Tensor, "B N M"], Float[Tensor, "B N M"], Float[Tensor, "B N M"]]:
    """Squared distances to faces, and the weights of the second and third corners at their closest points.

    Over a face the closest point is the foot; elsewhere it lies on the nearest of the three edges. A face
    without area has gradients of zero, so its foot is its corner.
    """
    corner, u, v, to_second, to_third, inverse = rows.split(3, dim=3)
    p = points[:, :, None] - corner
    s, t = (to_second * p).sum(dim=3), (to_third * p).sum(dim=3)
    over = (s >= 0) & (t >= 0) & (s + t <= 1)
    best = (p - s[..., None] * u - t[..., None] * v).square().sum(dim=3)
    best, s, t = torch.where(over, best, torch.inf), torch.where(over, s, 0), torch.where(over, t, 0)
    for number, (start, edge) in enumerate(((0, u), (0, v), (u, v - u))):
        q = p - start
        k = ((edge * q).sum(dim=3) * inverse[..., number]).clamp(0, 1)
        away = (q - k[..., None] * edge).square().sum(dim=3)
        nearer = away < best
        best = torch.where(nearer, away, best)
        s = torch.where(nearer, (k, torch.zeros_like(k), 1 - k)[number], s)
        t = torch.where(nearer, (torch.zeros_like(k), k, k)[number], t)
    return best, s, t


def surfaces_of(vertices: Float[Tensor, "B V 3"], topology: Topology) -> Surfaces:
    """Surfaces by their vertices."""
    vertices, faces = vertices.detach(), topology.faces
    corners = vertices.double()[:, faces.flatten()].unflatten(1, faces.shape)  # B F 3 3
    ordered = corners[:, topology.order]
    a, u, v = ordered[:, :, 0], ordered[:, :, 1] - ordered[:, :, 0], ordered[:, :, 2] - ordered[:, :, 0]
    uu, uv, vv = ((x * y).sum(dim=2, keepdim=True) for x, y in ((u, u), (u, v), (v, v)))
    area = uu * vv - uv * uv
    flat = ~(area > FLAT * uu * vv)
    scale = torch.where(flat, 0.0, 1 / torch.where(flat, 1.0, area))
    lengths = torch.cat([uu, vv, (v - u).square().sum(dim=2, keepdim=True)], dim=2)
    inverse = torch.where(lengths > 0, 1 / lengths.clamp_min(1e-300), 0.0)
    columns = [a, u, v, (vv * u - uv * v) * scale, (uu * v - uv * u) * scale, inverse]
    in_leaves = ordered.float().unflatten(1, (-1, LEAVES, LEAF))
    leaves = torch.cat([in_leaves.amin(dim=(3, 4)), in_leaves.amax(dim=(3, 4))], dim=-1)
    groups = torch.cat([leaves[..., :3].amin(dim=2), leaves[..., 3:].amax(dim=2)], dim=-1)
    return Surfaces(
        topology=topology,
        vertices=vertices,
        rows=torch.cat(columns, dim=2).float(),
        leaves=leaves,
        groups=groups,
        normals=pseudonormals(corners, topology, vertices.shape[1]).float(),
    )


def pseudonormals(
    corners: Float[Tensor, "B F 3 3"], topology: Topology, count: int
) -> Float[Tensor, "B F 7 3"]:
    """Outward pseudonormals of each face's seven features, of any length, as in `avatargen.body.distance`."""
    forward, backward = corners.roll(-1, dims=2) - corners, corners.roll(1, dims=2) - corners
    normal = torch.linalg.cross(forward[:, :, 0], backward[:, :, 0])
    normal = normal / normal.norm(dim=2, keepdim=True).clamp_min(1e-300)
    sine = torch.linalg.cross(forward, backward).norm(dim=3)
    angle = torch.atan2(sine, (forward * backward).sum(dim=3))  # B F 3

    def gathered(index: Int64[Tensor, "F 3"], rows: int, values: Tensor) -> Float[Tensor, "B F 3 3"]:
        total = corners.new_zeros(len(corners), rows, 3).index_add(1, index.flatten(), values.flatten(1, 2))
        return total[:, index.flatten()].unflatten(1, index.shape)

    of_edges = gathered(topology.edges, topology.edge_count, normal[:, :, None].expand(-1, -1, 3, -1))
    of_corners = gathered(topology.faces, count, angle[..., None] * normal[:, :, None])
    return torch.cat([normal[:, :, None], of_edges, of_corners], dim=2)


def topology_of(
    vertices: Float[np.ndarray, "V 3"], faces: Int64[np.ndarray, "F 3"], device: torch.device | str = "cpu"
) -> Topology:
    """The topology of a mesh, and an order in which the neighbours on it follow each other."""
    sides = np.sort(np.stack([faces[:, [1, 2]], faces[:, [2, 0]], faces[:, [0, 1]]], axis=1), axis=2)
    _, edges = np.unique(sides.reshape(-1, 2), axis=0, return_inverse=True)
    corners = vertices[faces].astype(np.float64)
    order, _ = build_tree(corners.min(axis=1), corners.max(axis=1))
    order = np.append(order, np.full(-len(order) % (LEAF * LEAVES), order[-1]))
    return Topology(
        faces=torch.from_numpy(faces).to(device),
        edges=torch.from_numpy(edges.reshape(-1, 3)).to(device),
        edge_count=int(edges.max()) + 1,
        order=torch.from_numpy(order).to(device),
    )
