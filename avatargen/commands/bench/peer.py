"""The recipe that relatives use, for comparison: a dense grid of 256^3, scikit-image's marching cubes,
pymeshlab's cleaning and decimation, xatlas at its defaults on the whole mesh, the nearest body vertex's
weights.

Nearly all of its time goes into the field at 17 million points, most of that into the body's distance, which
relatives take from a library's tree. The cheap version reads that distance from a coarse grid made beforehand
(which is not timed), by trilinear interpolation, and everything else from the nearest node.

Letters: N points, G nodes along a side, V vertices, F faces. Metres.
"""

import dataclasses
import time
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float, Float64, Int64
from scipy.ndimage import map_coordinates
from scipy.spatial import KDTree

from assets.field import Field, ask
from assets.mesh.clean import from_pymeshlab, to_pymeshlab
from assets.mesh.surface import Surface
from assets.skin.skin import limit_influences
from assets.texture.atlas import Atlas
from assets.texture.bake import BakeConfig, bake_texture
from avatargen.avatar import Avatar
from avatargen.body.distance import BodyDistance, BodyHit
from avatargen.generator.person_field import PersonField
from exporters.png import encode_png

NODE = 0.02  # metres between the nodes of the cheap distance


@dataclass(frozen=True, kw_only=True)
class PeerConfig:
    """The recipe's usual settings."""

    resolution: int = 256
    faces: int = 20_000
    texture: int = 1024


@dataclass(frozen=True, kw_only=True)
class PeerResult:
    """Its mesh in the canonical space, and seconds by stage."""

    surface: Surface
    seconds: dict[str, float]


class LibiglTree:
    """Closest points of a mesh by libigl, in place of `avatargen.mesh.closest.ClosestPoints`."""

    def __init__(self, vertices: Float64[np.ndarray, "V 3"], faces: Int64[np.ndarray, "F 3"]) -> None:
        import igl

        self.vertices, self.faces, self.tree = vertices, faces, igl.AABB()
        self.tree.init(vertices, faces)

    def query(
        self, points: Float64[np.ndarray, "N 3"]
    ) -> tuple[Float64[np.ndarray, " N"], Int64[np.ndarray, " N"], Float64[np.ndarray, "N 3"]]:
        """Squared distance, face, and the barycentric coordinates of its closest point."""
        import igl

        found: Any = self.tree.squared_distance(self.vertices, self.faces, points)
        squared, face, closest = map(np.asarray, found)
        corners = self.vertices[self.faces[face]].transpose(1, 0, 2)
        barycentric: Any = igl.barycentric_coordinates(closest, *map(np.ascontiguousarray, corners))
        return squared, face.astype(np.int64), np.asarray(barycentric)


class LibiglDistance(BodyDistance):
    """The body's distance by libigl's tree: exact too."""

    def __init__(self, exact: BodyDistance) -> None:
        vars(self).update(vars(exact))
        self.closest = LibiglTree(exact.vertices, exact.faces)


class CheapDistance(BodyDistance):
    """The body's distance off a grid: fast and inexact."""

    def __init__(self, exact: BodyDistance, cube: Float64[np.ndarray, "2 3"]) -> None:
        vars(self).update(vars(exact))
        self.low, self.count = cube[0], int(np.ceil((cube[1] - cube[0]).max() / NODE)) + 1
        axis = NODE * np.arange(self.count)
        nodes = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
        self.nodes = exact.query(nodes + self.low)

    def query_in_order(self, points: Float[np.ndarray, "N 3"]) -> BodyHit:
        place = np.clip((points - self.low) / NODE, 0, self.count - 1)
        grid = self.nodes.distance.reshape(3 * (self.count,))
        nearest = np.rint(place).astype(np.int64) @ [self.count**2, self.count, 1]
        return BodyHit(
            distance=map_coordinates(grid, place.T, order=1).astype(np.float32),
            face=self.nodes.face[nearest],
            barycentric=self.nodes.barycentric[nearest],
        )


def cube_around(avatar: Avatar) -> Float64[np.ndarray, "2 3"]:
    """The cube that holds the avatar's box."""
    low, high = avatar.bounds.astype(np.float64)
    half = (high - low).max() / 2
    return np.stack([(low + high) / 2 - half, (low + high) / 2 + half])


def paper_field(avatar: Avatar) -> PersonField:
    """The field of a person of the paper's generator, whom the bench measures."""
    assert isinstance(avatar.field, PersonField)
    return avatar.field


def with_libigl(avatar: Avatar) -> Avatar:
    """The same person, whose body distance comes from libigl's tree."""
    return with_distance(avatar, LibiglDistance(paper_field(avatar).distance))


def with_cheap_distance(avatar: Avatar) -> Avatar:
    """The same person, whose body distance is read off a grid."""
    return with_distance(avatar, CheapDistance(paper_field(avatar).distance, cube_around(avatar)))


def with_distance(avatar: Avatar, distance: BodyDistance) -> Avatar:
    """The same person on another distance, with networks as relatives ask them: by torch alone."""
    field = dataclasses.replace(paper_field(avatar), distance=distance, gathering=None)
    return dataclasses.replace(avatar, field=field)


def run_peer(avatar: Avatar, config: PeerConfig) -> PeerResult:
    """The whole recipe, from the avatar's fields to an encoded texture."""
    seconds: dict[str, float] = {}

    @contextmanager
    def clock(stage: str):
        started = time.perf_counter()
        yield
        seconds[stage] = time.perf_counter() - started

    with clock("grid"):
        values = dense_grid(avatar.sdf, cube_around(avatar), config.resolution)
    with clock("marching cubes"):
        surface = march(values, cube_around(avatar))
    with clock("clean and decimate"):
        surface = decimate(surface, config.faces)
    with clock("atlas"):
        atlas = default_atlas(surface)
    with clock("bake"):
        texture = bake_texture(surface, atlas, avatar.color, BakeConfig(texture_size=config.texture))
        encode_png(texture.texels)
    with clock("weights"):
        nearest = KDTree(avatar.body.vertices).query(surface.vertices)[1]
        limit_influences(avatar.body.weights[nearest])
    return PeerResult(surface=surface, seconds=seconds)


def dense_grid(sdf: Field, cube: Float64[np.ndarray, "2 3"], resolution: int) -> Float64[np.ndarray, "G G G"]:
    """The field at every node of the cube, slab by slab."""
    axes = np.linspace(cube[0], cube[1], resolution).T
    slabs = []
    for x in axes[0]:
        y, z = np.meshgrid(axes[1], axes[2], indexing="ij")
        slab = np.stack([np.full(y.size, x), y.reshape(-1), z.reshape(-1)], axis=1)
        slabs.append(ask(sdf, slab).reshape(resolution, resolution))
    return np.stack(slabs)


def march(values: Float64[np.ndarray, "G G G"], cube: Float64[np.ndarray, "2 3"]) -> Surface:
    """scikit-image's marching cubes, faces outward."""
    from skimage.measure import marching_cubes

    spacing = (cube[1] - cube[0]) / (len(values) - 1)
    found: Any = marching_cubes(values, 0.0, spacing=tuple(spacing))
    vertices, faces = found[0] + cube[0], found[1].astype(np.int64)
    return Surface(vertices=vertices.astype(np.float64), faces=np.ascontiguousarray(faces))


def decimate(surface: Surface, faces: int) -> Surface:
    """pymeshlab's usual filters."""
    meshes = to_pymeshlab(surface)
    meshes.apply_filter("meshing_remove_duplicate_vertices")
    meshes.apply_filter("meshing_remove_duplicate_faces")
    meshes.apply_filter("meshing_remove_null_faces")
    smallest = len(surface.faces) // 50
    meshes.apply_filter("meshing_remove_connected_component_by_face_number", mincomponentsize=smallest)
    meshes.apply_filter("meshing_remove_unreferenced_vertices")
    meshes.apply_filter("meshing_decimation_quadric_edge_collapse", targetfacenum=faces)
    return from_pymeshlab(meshes)


def default_atlas(surface: Surface) -> Atlas:
    """xatlas as it comes, on the whole mesh."""
    import xatlas

    vertex_map, faces, uv = xatlas.parametrize(
        surface.vertices.astype(np.float32), surface.faces.astype(np.uint32)
    )
    return Atlas(
        vertex_map=vertex_map.astype(np.int64),
        uv=np.clip(uv, 0, 1).astype(np.float32),
        faces=faces.astype(np.int64),
    )
