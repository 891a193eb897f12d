"""The asset: one person with everything an exporter needs and what it cost to make.

    PlainAsset (a mesh) -> TexturedAsset (and its colours) -> Asset (and its skeleton)

A scene that needs no skeleton or no colours gets one of the smaller types: what is left out is not there.
Letters: W vertices after the texture's seams have split them, F faces, J joints, S and K texels along a side.
Metres, y up, facing +z; uv origin at the texture's top left, as in glTF. The vertices stand in the
skeleton's rest pose.
"""

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float32, Int, Int64, UInt8

from assets.asset.rig import Animation, Morph, Skeleton
from assets.asset.spring import Collider, Spring
from assets.content import LeftOut
from assets.errors import GeometryError
from assets.mesh.measure import SurfaceError
from assets.texture.normal_map import NormalMap

if TYPE_CHECKING:
    from trimesh import Trimesh

WEIGHT_SUM_LIMIT = 1e-5


@dataclass(frozen=True, kw_only=True)
class AssetInfo:
    """Where an asset comes from."""

    seed: int
    weights_hash: str
    version: str
    licence: str
    betas: tuple[float, ...] = ()
    height_m: float | None = None  # of the body, crown of the head to the soles
    facts: tuple[tuple[str, str | int | float], ...] = ()  # the person's attributes, name and value


@dataclass(frozen=True, kw_only=True)
class Report:
    """What making the asset took and how exact it is."""

    seconds: tuple[tuple[str, float], ...]  # per stage, in order
    error: SurfaceError  # mesh to field, in the canonical pose
    missed: SurfaceError | None  # extracted surface to mesh; None where the mesh is that surface
    welded_vertices: int
    queries: int  # points the field was asked at for the surface
    dropped_components: int
    texture_coverage: float  # share of texels that a face uses; 0 without a texture
    left_out: tuple[LeftOut, ...]

    @property
    def total_seconds(self) -> float:
        return sum(seconds for _, seconds in self.seconds)


@dataclass(frozen=True, kw_only=True)
class PlainAsset:
    """A mesh in its rest pose and where it comes from. Raises GeometryError where its parts do not fit."""

    vertices: Float32[np.ndarray, "W 3"]
    normals: Float32[np.ndarray, "W 3"]
    faces: Int64[np.ndarray, "F 3"]
    info: AssetInfo
    welded: Int64[np.ndarray, " W"] | None = None  # each vertex's number before the seams split it
    canonical: Float32[np.ndarray, "W 3"] | None = None  # metres, where the fields have each vertex
    levels: tuple[Int64[np.ndarray, "_ 3"], ...] = ()  # faces of coarser levels, finest first
    report: Report | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        require_finite(vertices=self.vertices, normals=self.normals)
        count = len(self.vertices)
        for faces in (self.faces, *self.levels):
            if len(faces) == 0 or faces.min() < 0 or faces.max() >= count:
                raise GeometryError(f"asset: faces must name some of the {count} vertices")

    def to_trimesh(self) -> "Trimesh":
        """A `trimesh.Trimesh` of the finest level: vertices, normals and faces as they are here and, where
        there are any, uv and textures.

        Vertices are split at the texture's seams. `merge_vertices(merge_tex=True, merge_norm=True)` on the
        result closes it again, at the uv's cost.
        """
        from assets.asset.as_trimesh import as_trimesh

        return as_trimesh(self)


@dataclass(frozen=True, kw_only=True)
class TexturedAsset(PlainAsset):
    """A mesh with a base colour texture and, where wanted, a normal map and ambient occlusion."""

    uv: Float32[np.ndarray, "W 2"]
    texture: UInt8[np.ndarray, "S S 3"]
    normal_map: NormalMap | None = None
    occlusion: UInt8[np.ndarray, "K K"] | None = None  # 255: open to light from all around; 0: to none

    def __post_init__(self) -> None:
        super().__post_init__()
        require_finite(uv=self.uv)
        if self.uv.min() < 0 or self.uv.max() > 1:
            raise GeometryError(
                f"asset: uv reach from {self.uv.min():g} to {self.uv.max():g}; 0 to 1 is needed"
            )
        if self.normal_map is not None and len(self.normal_map.tangents) != len(self.vertices):
            raise GeometryError(
                f"asset: {len(self.normal_map.tangents)} tangents for {len(self.vertices)} vertices"
            )
        if self.occlusion is not None:
            check_occlusion(self.occlusion)


@dataclass(frozen=True, kw_only=True)
class Part:
    """A mesh of its own within an asset: the body, a garment, the hair.

    Its vertices and faces are those from the first number up to the second. Its pictures are a square of the
    asset's: the place of that square's top left corner in uv, and its side.
    """

    name: str
    vertices: tuple[int, int]
    faces: tuple[int, int]
    corner: tuple[float, float]
    side: float


@dataclass(frozen=True, kw_only=True)
class Asset(TexturedAsset):
    """A rigged, textured mesh: the whole of what an avatar can be.

    With `parts` it is several meshes one after another, which share skeleton and pictures
    (joined by `assets.asset.parts`); without any it is one.
    """

    joints: Int[np.ndarray, "W 4"]
    weights: Float32[np.ndarray, "W 4"]
    skeleton: Skeleton
    animations: tuple[Animation, ...] = ()
    morphs: tuple[Morph, ...] = ()
    parts: tuple[Part, ...] = ()
    springs: tuple[Spring, ...] = ()
    colliders: tuple[Collider, ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        require_finite(weights=self.weights)
        if self.joints.min() < 0 or self.joints.max() >= len(self.skeleton.parents):
            raise GeometryError(f"asset: joints must be among the skeleton's {len(self.skeleton.parents)}")
        error = np.abs(self.weights.sum(axis=1, dtype=np.float64) - 1).max()
        if not error < WEIGHT_SUM_LIMIT or self.weights.min() < 0:
            raise GeometryError(f"asset: weight sums are off 1 by {error:.1e}, limit {WEIGHT_SUM_LIMIT:.0e}")
        check_motion(self)
        check_parts(self)


def check_occlusion(texels: np.ndarray) -> None:
    """Raises GeometryError unless the texels are a square of bytes."""
    if texels.dtype != np.uint8 or texels.ndim != 2 or len(set(texels.shape)) != 1 or not texels.size:
        raise GeometryError(
            f"asset: occlusion is {texels.dtype} of shape {texels.shape}; a square of uint8 is needed"
        )


def require_finite(**arrays: np.ndarray) -> None:
    """Raises GeometryError naming the first of the arrays that holds NaN or infinity."""
    for name, array in arrays.items():
        if not np.isfinite(array).all():
            raise GeometryError(f"asset: {name} hold NaN or infinity; the stage before failed")


def check_motion(asset: Asset) -> None:
    """Animations and morphs fit the asset and have names of their own."""
    joint_count, vertex_count = len(asset.skeleton.parents), len(asset.vertices)
    for kind, parts in (("animations", asset.animations), ("morphs", asset.morphs)):
        if len({part.name for part in parts}) < len(parts):
            raise GeometryError(f"asset: two {kind} share a name; give each its own")
    for animation in asset.animations:
        if animation.rotations.shape[1] != joint_count:
            raise GeometryError(f"asset: animation {animation.name} is not of its {joint_count} joints")
        if animation.weights is not None and animation.weights.shape[1] != len(asset.morphs):
            raise GeometryError(f"asset: animation {animation.name} is not of its {len(asset.morphs)} morphs")
    for morph in asset.morphs:
        if (len(morph.vertices), len(morph.joints)) != (vertex_count, joint_count):
            raise GeometryError(f"asset: morph {morph.name} is not of its {vertex_count} vertices")


def check_parts(asset: Asset) -> None:
    """The parts have names of their own, follow one another, and share no vertex."""
    if not asset.parts:
        return
    if len({part.name for part in asset.parts}) < len(asset.parts):
        raise GeometryError("asset: two parts share a name; give each its own")
    for what, count in (("vertices", len(asset.vertices)), ("faces", len(asset.faces))):
        ranges = [getattr(part, what) for part in asset.parts]
        starts, ends = [start for start, _ in ranges], [end for _, end in ranges]
        if starts != [0, *ends[:-1]] or ends[-1] != count:
            raise GeometryError(
                f"asset: its parts' {what} are {ranges}; one after another up to {count} is needed"
            )
    for part in asset.parts:
        named = asset.faces[slice(*part.faces)]
        if len(named) == 0 or named.min() < part.vertices[0] or named.max() >= part.vertices[1]:
            raise GeometryError(
                f"asset: faces of {part.name} name vertices of other parts, or there are none"
            )


def apart(asset: Asset) -> dict[str, Asset]:
    """Each part by itself, with its own vertices, faces and pictures, on the asset's skeleton and with its
    animations."""
    return {part.name: alone(asset, part) for part in asset.parts}


def meshes_of(asset: PlainAsset, name: str) -> dict[str, PlainAsset]:
    """What a file holds as meshes: the parts by their names, or the asset itself as `name`."""
    return dict(apart(asset)) if isinstance(asset, Asset) and asset.parts else {name: asset}


def part_names(asset: PlainAsset) -> tuple[str, ...]:
    """Names of the parts, in order; none of an asset that is one mesh."""
    return tuple(part.name for part in asset.parts) if isinstance(asset, Asset) else ()


def alone(asset: Asset, part: Part) -> Asset:
    """One part of an asset."""
    rows, normal_map = slice(*part.vertices), asset.normal_map
    if normal_map is not None:
        normal_map = NormalMap(texels=cut(normal_map.texels, part), tangents=normal_map.tangents[rows])
    return replace(
        asset,
        vertices=asset.vertices[rows],
        normals=asset.normals[rows],
        faces=asset.faces[slice(*part.faces)] - part.vertices[0],
        welded=None if asset.welded is None else asset.welded[rows] - asset.welded[rows].min(),
        canonical=None if asset.canonical is None else asset.canonical[rows],
        uv=np.clip((asset.uv[rows] - part.corner) / part.side, 0, 1).astype(np.float32),
        texture=cut(asset.texture, part),
        normal_map=normal_map,
        occlusion=None if asset.occlusion is None else cut(asset.occlusion, part),
        joints=asset.joints[rows],
        weights=asset.weights[rows],
        morphs=tuple(morph.of(rows) for morph in asset.morphs),
        parts=(),
    )


def cut(picture: UInt8[np.ndarray, "S S *C"], part: Part) -> UInt8[np.ndarray, "_ _ *C"]:
    """A part's square of a picture."""
    size = len(picture)
    x, y, side = (round(each * size) for each in (*part.corner, part.side))
    return np.ascontiguousarray(picture[y : y + side, x : x + side])
