"""A wardrobe person as a coloured mesh that poses: the fast way from a field to many pictures.

    People --Tailor--> DressedMesh (canonical space) --shape, skin--> vertices in any pose

The field is asked on a coarse grid, then on the corners of the fine cells near its zero; marching cubes
takes those the surface crosses. What a corner knows of the body is the same for every person, so it is
computed the first time a person needs it and kept. What cells of `cell` metres cannot hold is lost: the
silhouette is right to a fraction of a cell, prints and faces are as fine as a cell.

Letters: C cells, N corners, V vertices, J joints. Metres, canonical space.
"""

from dataclasses import dataclass, fields

import igl
import numpy as np
import scipy.ndimage
import scipy.sparse
import torch
from jaxtyping import Bool, Float, Float32, Float64, Int64

from avatargen.body.model import Body, CanonicalBody, forward_kinematics, from_rest_joints, pose_canonically
from avatargen.body.model import shape as shape_body
from avatargen.body.pose import axis_angle_to_matrix
from avatargen.body.skinning import invert_blend, skin, transform
from avatargen.wardrobe import MARKS
from avatargen.wardrobe.attributes import People
from avatargen.wardrobe.chart import Chart, Places
from avatargen.wardrobe.person import dress_up
from avatargen.wardrobe.stature import Sizing

MARGIN = (0.1, 0.1, 0.24)  # metres of box around the body: skirts reach far along z
REACH = (
    -0.04,
    0.12,
)  # metres from the body within which the surface is looked for; from there it is followed
NEAR = 1.25  # coarse cells whose field is within this many half diagonals may hold the surface
LOOK_AHEAD = 4  # coarse cells around those into which the surface is followed
SMOOTHING = 15  # rounds that even out skinning weights off the body, each about a cell far
LOOSE = (0.01, 0.05)  # metres from the body between which smoothing sets in
CUBE = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)])


@dataclass(frozen=True, kw_only=True, eq=False)
class DressedMesh:
    """One person's surface in the canonical space, ready to be shaped and posed."""

    vertices: Float64[np.ndarray, "V 3"]
    faces: Int64[np.ndarray, "F 3"]
    colors: Float32[np.ndarray, "V 3"]  # sRGB 0..1
    weights: Float64[np.ndarray, "V J"]
    betas: Float32[np.ndarray, " b"]
    rest: Float64[np.ndarray, "V 3"]  # in the T-pose, with the person's own shape
    joints: Float64[np.ndarray, "J 3"]  # likewise


@dataclass(frozen=True, kw_only=True, eq=False)
class Region:
    """One person's field on part of the fine grid, and the cells that the surface crosses there."""

    corners: Int64[np.ndarray, " N"]  # keys in the grid, ascending
    sdf: Float64[np.ndarray, " N"]
    color: Float32[np.ndarray, "N 3"]
    cells: Int64[np.ndarray, "C 3"]
    rows: Int64[np.ndarray, "C 8"]  # of `corners`


class Tailor:
    """Makes meshes of wardrobe people; what it learns about the body's surroundings serves them all."""

    def __init__(self, body: CanonicalBody, cell: float) -> None:
        self.body, self.cell = body, cell
        self.chart = Chart(body, MARKS, spacing=cell)
        self.T_canonical_rest = pose_canonically(body.source).T_posed_rest
        self.sizing = Sizing(body.source)
        self.origin = body.vertices.min(axis=0).astype(np.float64) - MARGIN
        size = body.vertices.max(axis=0) + np.array(MARGIN) - self.origin
        self.coarse_counts = np.ceil(size / (2 * cell)).astype(np.int64)
        self.corner_counts = 2 * self.coarse_counts + 1
        self.row = np.full(self.corner_counts.prod(), -1, dtype=np.int64)  # of each known corner
        self.place = np.empty_like(self.row)  # of each corner among those of the region at hand
        self.known: Places | None = None
        self.coarse = self.cells_in_reach(self.coarse_counts)
        self.coarse_places = self.chart.places(self.centers(self.coarse))

    def centers(self, cells: Int64[np.ndarray, "C 3"]) -> Float32[np.ndarray, "C 3"]:
        """Middles of coarse cells, which are two fine ones long."""
        return (self.origin + (2 * cells + 1) * self.cell).astype(np.float32)

    def cells_in_reach(self, counts: Int64[np.ndarray, "3"]) -> Int64[np.ndarray, "C 3"]:
        """Coarse cells that some person's surface could cross."""
        cells = np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), axis=-1).reshape(-1, 3)
        distance = self.chart.distance.query(self.centers(cells)).distance
        return cells[(distance > REACH[0]) & (distance < REACH[1])]

    def mesh(self, people: People) -> DressedMesh:
        """The surface of one person; `people` holds one latent."""
        region = self.near_surface(people)
        places = self.places_of(region.corners)
        points = self.origin + self.grid(region.corners) * self.cell
        vertices, faces = map(np.asarray, igl.marching_cubes(region.sdf, points, region.rows, 0.0)[:2])
        faces = faces[:, ::-1].astype(np.int64) if inward(vertices, faces) else faces.astype(np.int64)
        low, high, share = self.edge(vertices, region.corners)

        def along(low: np.ndarray, high: np.ndarray) -> np.ndarray:
            return low + (high - low) * share[:, None]

        def on_body(values: np.ndarray) -> np.ndarray:
            ends = (
                spread(values, places.corners[row].numpy(), places.barycentric[row].double().numpy())
                for row in (torch.from_numpy(low), torch.from_numpy(high))
            )
            return along(*ends)

        betas = self.betas(people)
        away = places.body.double().numpy()[:, None]
        weights = smooth_weights(on_body(self.body.weights), faces, along(away[low], away[high])[:, 0])
        offsets = on_body(self.body.source.shapedirs @ betas)
        rest = transform(invert_blend(weights, self.T_canonical_rest), vertices) + offsets
        return DressedMesh(
            vertices=vertices,
            faces=faces,
            colors=along(region.color[low], region.color[high]).astype(np.float32),
            weights=weights,
            betas=betas,
            rest=rest,
            joints=shape_body(self.body.source, betas).joints,
        )

    def near_surface(self, people: People) -> Region:
        """Fine cells around the surface: where the coarse field is small, and beyond."""
        sdf = dress_up(self.coarse_places[None], people).sdf[0].numpy()
        wanted = self.coarse[np.abs(sdf) < NEAR * np.sqrt(3) * self.cell]
        listed = np.zeros(self.coarse_counts, dtype=bool)
        regions = []
        while len(wanted):
            listed[tuple(wanted.T)] = True
            regions.append(self.fine_cells(wanted, people))
            leaving = self.beyond(regions[-1], listed)
            wanted = np.argwhere(leaving | self.ahead(leaving, listed, people))
        return regions[0] if len(regions) == 1 else self.merged(regions)

    def ahead(
        self, leaving: Bool[np.ndarray, "x y z"], listed: Bool[np.ndarray, "x y z"], people: People
    ) -> Bool[np.ndarray, "x y z"]:
        """Coarse cells around those, where the field is small: one question instead of one a cell."""
        found = np.zeros_like(leaving)
        if leaving.any():
            around = scipy.ndimage.binary_dilation(leaving, np.ones((3, 3, 3)), LOOK_AHEAD) & ~listed
            cells = np.argwhere(around)
            sdf = dress_up(self.places_of(self.keys(2 * cells + 1))[None], people).sdf[0].numpy()
            found[tuple(cells[np.abs(sdf) < NEAR * np.sqrt(3) * self.cell].T)] = True
        return found

    def fine_cells(self, coarse: Int64[np.ndarray, "C 3"], people: People) -> Region:
        """The field at the corners of the eight fine cells of each coarse one."""
        cells = (2 * coarse[:, None] + CUBE).reshape(-1, 3)
        keys = self.keys((cells[:, None] + CUBE).reshape(-1, 3))
        listed = np.zeros(len(self.row), dtype=bool)  # np.unique would sort: six times as slow
        listed[keys] = True
        corners = np.flatnonzero(listed)
        self.place[corners] = np.arange(len(corners))
        layer = dress_up(self.places_of(corners)[None], people)
        sdf, color = layer.sdf[0].double().numpy(), layer.color[0].numpy()
        rows = self.place[keys].reshape(-1, 8)
        inside = (sdf < 0)[rows]
        crossed = inside.any(axis=1) & ~inside.all(axis=1)
        return Region(corners=corners, sdf=sdf, color=color, cells=cells[crossed], rows=rows[crossed])

    def beyond(self, region: Region, listed: Bool[np.ndarray, "x y z"]) -> Bool[np.ndarray, "x y z"]:
        """Coarse cells not yet listed into which the surface leaves this region."""
        inside = (region.sdf < 0)[region.rows]
        found = np.zeros_like(listed)
        for axis in range(3):
            for side in (0, 1):
                corners = inside[:, CUBE[:, axis] == side]
                cells = region.cells[corners.any(axis=1) & ~corners.all(axis=1)]
                cells[:, axis] += 2 * side - 1
                cells = cells // 2
                within = ((cells >= 0) & (cells < self.coarse_counts)).all(axis=1)
                found[tuple(cells[within].T)] = True
        return found & ~listed

    def merged(self, regions: list[Region]) -> Region:
        """One region of several."""
        keys = np.concatenate([region.corners for region in regions])
        corners, first = np.unique(keys, return_index=True)
        return Region(
            corners=corners,
            sdf=np.concatenate([region.sdf for region in regions])[first],
            color=np.concatenate([region.color for region in regions])[first],
            cells=np.concatenate([region.cells for region in regions]),
            rows=np.concatenate([np.searchsorted(corners, r.corners)[r.rows] for r in regions]),
        )

    def places_of(self, corners: Int64[np.ndarray, " N"]) -> Places:
        """What is known of these corners; the chart is asked for those never met before."""
        new = corners[self.row[corners] < 0]
        if len(new):
            points = (self.origin + self.grid(new) * self.cell).astype(np.float32)
            found = self.chart.places(points)
            count = 0 if self.known is None else len(self.known.body)
            self.row[new] = count + np.arange(len(new))
            self.known = found if self.known is None else joined(self.known, found)
        assert self.known is not None
        return self.known[torch.from_numpy(self.row[corners])]

    def betas(self, people: People) -> Float32[np.ndarray, " b"]:
        """The person's shape, as the warm start has it."""
        return self.sizing.betas(people)[0].numpy()

    def keys(self, corners: Int64[np.ndarray, "N 3"]) -> Int64[np.ndarray, " N"]:
        _, y, z = self.corner_counts
        return (corners[:, 0] * y + corners[:, 1]) * z + corners[:, 2]

    def grid(self, keys: Int64[np.ndarray, " N"]) -> Int64[np.ndarray, "N 3"]:
        _, y, z = self.corner_counts
        return np.stack([keys // (y * z), keys // z % y, keys % z], axis=1)

    def edge(
        self, vertices: Float64[np.ndarray, "V 3"], corners: Int64[np.ndarray, " N"]
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The grid edge each vertex lies on: rows of its ends among `corners`, and how far along."""
        place = (vertices - self.origin) / self.cell
        axis = np.abs(place - np.rint(place)).argmax(axis=1)
        low = np.rint(place).astype(np.int64)
        each = np.arange(len(place))
        low[each, axis] = np.floor(place[each, axis])
        high = low.copy()
        high[each, axis] = np.minimum(low[each, axis] + 1, self.corner_counts[axis] - 1)
        rows = [np.searchsorted(corners, self.keys(end)) for end in (low, high)]
        return rows[0], rows[1], place[each, axis] - low[each, axis]


def joined(first: Places, second: Places) -> Places:
    return Places(
        **{f.name: torch.cat([getattr(first, f.name), getattr(second, f.name)]) for f in fields(first)}
    )


def spread(
    values: Float[np.ndarray, "B k"], corners: Int64[np.ndarray, "N 3"], barycentric: Float[np.ndarray, "N 3"]
) -> Float64[np.ndarray, "N k"]:
    """Values of the body's vertices at places on its faces."""
    return np.einsum("nck,nc->nk", values[corners], barycentric)


def inward(vertices: Float64[np.ndarray, "V 3"], faces: np.ndarray) -> bool:
    """Whether the closed surface has negative volume: which way marching cubes turns is a convention."""
    a, b, c = vertices[faces[:, 0]], vertices[faces[:, 1]], vertices[faces[:, 2]]
    return bool(np.einsum("fd,fd->", a, np.cross(b, c)) < 0)


def smooth_weights(
    weights: Float64[np.ndarray, "V J"], faces: Int64[np.ndarray, "F 3"], away: Float64[np.ndarray, " V"]
) -> Float64[np.ndarray, "V J"]:
    """Weights evened out over the surface where it hangs off the body: a skirt follows both legs.

    The closest body point jumps from leg to leg across a skirt; without this its cloth would tear open.
    """
    share = np.clip((away - LOOSE[0]) / (LOOSE[1] - LOOSE[0]), 0, 1)[:, None]
    ends = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    ends = np.concatenate([ends, ends[:, ::-1]])
    ones = np.ones(len(ends))
    links = scipy.sparse.csr_matrix((ones, (ends[:, 0], ends[:, 1])), shape=(len(weights),) * 2)
    loose = np.flatnonzero(share[:, 0] > 0)
    links = links[loose]
    counts = np.maximum(np.asarray(links.sum(axis=1)).reshape(-1, 1), 1)
    weights = np.maximum(weights, 0)  # rounding leaves barycentric coordinates of -1e-18
    for _ in range(SMOOTHING):
        weights[loose] += share[loose] * (links @ weights / counts - weights[loose])
    return weights / weights.sum(axis=1, keepdims=True)


def pose_mesh(
    mesh: DressedMesh, body: Body, rotations: Float[np.ndarray, "J 3"]
) -> Float64[np.ndarray, "V 3"]:
    """The mesh's vertices in a pose: linear blend skinning of its rest shape, metres."""
    T_world_joint = forward_kinematics(mesh.joints, axis_angle_to_matrix(rotations), body.parents)
    return skin(mesh.rest, mesh.weights, from_rest_joints(T_world_joint, mesh.joints))
