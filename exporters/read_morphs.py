"""Read back a mesh's morph targets: whole arrays, or the rows alone that are not zero.

Letters: W vertices, J joints.
"""

from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float32, Float64, Int64

from assets.asset.rig import Morph

if TYPE_CHECKING:
    from exporters.read_glb import Document

MOST_NUMBERS = 1 << 28  # of all targets together: a file of few rows may ask for much memory


def read_morphs(
    document: "Document", mesh: Any, vertex_count: int, place: Int64[np.ndarray, " J"]
) -> tuple[Morph, ...]:
    """The targets of a mesh's first primitive that have names; `place` is where each of the file's joints
    stands in the skeleton. Raises ValueError where they do not fit."""
    targets, extras = mesh["primitives"][0].get("targets", ()), mesh.get("extras", {})
    names = extras.get("targetNames", ())
    if not targets or len(names) != len(targets):
        return ()
    if len(targets) * vertex_count * 6 > MOST_NUMBERS:
        raise ValueError(f"{len(targets)} morph targets of {vertex_count} vertices take too much memory")
    offsets = extras.get("targetJointOffsets", [np.zeros((len(place), 3))] * len(targets))
    return tuple(
        Morph(
            name=str(name),
            vertices=rows(document, target["POSITION"], vertex_count),
            normals=rows(document, target["NORMAL"], vertex_count) if "NORMAL" in target else None,
            joints=moved_joints(way, place),
        )
        for name, target, way in zip(names, targets, offsets, strict=True)
    )


def rows(document: "Document", accessor: Any, count: int) -> Float32[np.ndarray, "W 3"]:
    """The numbers of an accessor that may be sparse."""
    found = document.accessor(accessor)
    if found["count"] != count or found["type"] != "VEC3" or found["componentType"] != 5126:
        raise ValueError("a morph target is not of the mesh's vertices")
    values = np.zeros((count, 3), np.float32)
    if "bufferView" in found:
        values[:] = document.stored(found)
    sparse = found.get("sparse")
    if sparse is not None:
        changed = {"count": sparse["count"], "componentType": 5126, "type": "VEC3", **sparse["values"]}
        index = {"count": sparse["count"], "type": "SCALAR", **sparse["indices"]}
        numbers = document.stored(index).ravel().astype(np.int64)
        if numbers.max(initial=0) >= count:
            raise ValueError("a morph target moves a vertex that there is not")
        values[numbers] = document.stored(changed)
    return values


def moved_joints(way: Any, place: Int64[np.ndarray, " J"]) -> Float64[np.ndarray, "J 3"]:
    """How far joints ought to move, as the file says."""
    found = np.array(way, dtype=np.float64)
    if found.shape != (len(place), 3):
        raise ValueError("a morph target moves joints that there are not")
    sorted_ways = np.empty_like(found)
    sorted_ways[place] = found
    return sorted_ways
