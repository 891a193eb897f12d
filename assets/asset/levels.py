"""Levels of detail of a finished asset: ever fewer faces on the vertices that it has, so that all levels
share one texture and one skeleton.

    the asset as a mesh whose seams are welded -> rounds of half-edge collapses, level by level   (level_mesh)
    -> the asset, with the faces of each level and the few vertices that they add                 (here)

Letters: N vertices chosen from an asset's, F faces.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any, TypeVar

import numpy as np
from jaxtyping import Int64

from assets.asset.asset import Asset, PlainAsset, TexturedAsset, part_names
from assets.asset.level_mesh import LevelMesh, collapse_round, level_mesh
from assets.errors import GeometryError
from assets.field import Field
from assets.mesh.measure import MeasureConfig, SurfaceError, surface_error
from assets.mesh.surface import compact
from avatargen.errors import InputError

AnyAsset = TypeVar("AnyAsset", bound=PlainAsset)
FEWEST_FACES = 100  # of a level: fewer are no person any more
MEASURE = MeasureConfig(samples=3_000)  # a quarter of the finest level's: the errors are larger


def with_levels(asset: AnyAsset, faces: Sequence[int]) -> AnyAsset:
    """The asset with coarser levels of the given numbers of faces; the asset's own faces are the finest.

    Where seams cross, vertices are added at the end that only coarser levels use.

    Raises:
        InputError: numbers that do not fall, too few or more faces than there are, or an asset of parts.
        GeometryError: the surface cannot be kept closed with so few faces.
    """
    if part_names(asset):
        raise InputError("levels: the asset is of several parts; make it of one, or leave levels out")
    check_falling(len(asset.faces), faces)
    mesh = level_mesh(asset)
    levels = []
    for target in faces:
        while len(mesh.faces) - target > 1:
            if not collapse_round(mesh, target):
                raise GeometryError(
                    f"levels: no collapse is left at {len(mesh.faces)} faces, wanted {target}; ask for more"
                )
        levels.append(mesh.split.copy())
    return extended(asset, mesh, tuple(levels))


def check_falling(finest: int, faces: Sequence[int]) -> None:
    """Raises InputError unless each level has fewer faces than the one before."""
    sizes = [finest, *faces]
    if sizes[-1] < FEWEST_FACES or any(a <= b for a, b in pairwise(sizes)):
        listed = ", ".join(map(str, faces))
        raise InputError(
            f"levels: found {listed} under a mesh of {finest} faces; "
            f"give falling numbers, {FEWEST_FACES} or more"
        )


def extended(asset: AnyAsset, mesh: LevelMesh, levels: tuple[np.ndarray, ...]) -> AnyAsset:
    """The asset with its levels and the vertices that they add, as far as a level names them."""
    first = len(asset.vertices)
    named = np.unique(np.concatenate([level.reshape(-1) for level in levels]))
    added = named[named >= first]
    number = np.concatenate([np.arange(first), np.zeros(len(mesh.source) - first, dtype=np.int64)])
    number[added] = first + np.arange(len(added))
    kept = np.concatenate([np.arange(first), added])
    renumbered = tuple(number[level] for level in levels)
    return replace(asset, **of_vertices(asset, mesh.source[kept], mesh.uv_source[kept]), levels=renumbered)


def of_vertices(
    asset: PlainAsset, rows: Int64[np.ndarray, " N"], uv_rows: Int64[np.ndarray, " N"]
) -> dict[str, Any]:
    """The asset's parts with a value a vertex, for the vertices `rows` of it; their places in the texture,
    and so their tangents, are those of the vertices `uv_rows`."""
    names = ("vertices", "normals", "welded", "canonical", "joints", "weights")
    parts: dict[str, Any] = {
        name: getattr(asset, name)[rows] for name in names if getattr(asset, name, None) is not None
    }
    if isinstance(asset, TexturedAsset):
        parts["uv"] = asset.uv[uv_rows]
        if asset.normal_map is not None:
            parts["normal_map"] = replace(asset.normal_map, tangents=asset.normal_map.tangents[uv_rows])
    if isinstance(asset, Asset):
        parts["morphs"] = tuple(morph.of(rows) for morph in asset.morphs)
    return parts


def at_level(asset: AnyAsset, number: int) -> AnyAsset:
    """One level alone, with the vertices that it uses; 0 is the finest."""
    named, corner = np.unique((asset.faces, *asset.levels)[number], return_inverse=True)
    faces = corner.reshape(-1, 3).astype(np.int64)
    return replace(asset, **of_vertices(asset, named, named), faces=faces, levels=())


def level_error(asset: PlainAsset, faces: Int64[np.ndarray, "F 3"], sdf: Field) -> SurfaceError:
    """How far the faces of a level are from the field.

    Raises:
        GeometryError: the asset was not built from a field, so nobody knows where its vertices were.
        FieldError: the field is NaN or infinite.
    """
    if asset.welded is None or asset.canonical is None:
        raise GeometryError("levels: the asset was not built from a field; build it from an avatar")
    points = np.zeros((int(asset.welded.max()) + 1, 3))
    points[asset.welded] = asset.canonical
    return surface_error(compact(points, asset.welded[faces]), sdf, MEASURE)
