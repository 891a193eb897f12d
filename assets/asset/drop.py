"""A mesh without what is hidden, closed again: faces all of whose corners are hidden go, and a fan from the
middle of each rim closes what is left. So a body under clothes becomes a head, hands and feet, each closed.

Letters: W vertices of an asset, V welded ones.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Int64

from assets.asset.asset import Asset
from assets.mesh.surface import Surface, directed_edges, label_components, opposite_edges
from assets.skin.skin import limit_influences

SMALLEST, SMALLEST_HOLE = 0.01, 0.03  # of all faces: scraps between garments go, under collars nothing does


def without_hidden(asset: Asset, hidden: Bool[np.ndarray, " W"]) -> Asset:
    """The asset without its hidden faces, every piece closed, manifold and outward; the asset itself where
    nothing, or everything, is hidden. Parts, levels and animations are not looked at.

    The fans have no picture of their own: nobody is to see them.
    """
    assert asset.welded is not None and asset.canonical is not None, "built from a field"
    open_faces = np.asarray(~hidden[asset.faces].all(axis=1))
    kept = keep_whole_fans(asset.welded[asset.faces], open_faces)
    if kept.all() or not kept.any():
        return asset
    faces = asset.faces[kept]
    loops = rims(asset.welded[faces], faces)
    return with_fans(asset, faces, loops)


def faces_left(faces: Int64[np.ndarray, "F 3"], hidden: Bool[np.ndarray, " V"]) -> int:
    """How many faces a welded surface has without the hidden ones, fans included."""
    kept = keep_whole_fans(faces, np.asarray(~hidden[faces].all(axis=1)))
    if kept.all() or not kept.any():
        return len(faces)
    return int(kept.sum()) + len(open_edges(faces[kept]))


def keep_whole_fans(faces: Int64[np.ndarray, "F 3"], kept: Bool[np.ndarray, " F"]) -> Bool[np.ndarray, " F"]:
    """The faces that are kept, without small holes and small pieces, and with rims that touch themselves
    nowhere."""
    count = int(faces.max()) + 1
    kept = kept | in_small_regions(faces, ~kept, SMALLEST_HOLE)
    while True:
        starts = open_edges(faces[kept])[:, 0]
        crossed = np.bincount(starts, minlength=count) > 1
        at_crossing = crossed[faces].any(axis=1) & kept
        if not at_crossing.any():
            break
        kept &= ~at_crossing
    return kept & ~in_small_regions(faces, kept, SMALLEST)


def in_small_regions(
    faces: Int64[np.ndarray, "F 3"], chosen: Bool[np.ndarray, " F"], share: float
) -> Bool[np.ndarray, " F"]:
    """Which of the chosen faces hang together with few others alone, fewer than that share of all."""
    left = Surface(vertices=np.zeros((int(faces.max()) + 1, 3)), faces=faces[chosen])
    count, label = label_components(left)
    of_face = label[faces[:, 0]]
    sizes = np.bincount(of_face[chosen], minlength=count)
    return chosen & (sizes[of_face] < share * len(faces))


def open_edges(faces: Int64[np.ndarray, "F 3"]) -> Int64[np.ndarray, "E 2"]:
    """Directed edges that one face alone has."""
    if len(faces) == 0:
        return np.zeros((0, 2), np.int64)
    twin = opposite_edges(np.ascontiguousarray(faces), int(faces.max()) + 1)
    return directed_edges(faces)[twin < 0]


def rims(welded: Int64[np.ndarray, "F 3"], faces: Int64[np.ndarray, "F 3"]) -> list[Int64[np.ndarray, " _"]]:
    """The closed walks around what is open, as vertices of the asset, in the faces' direction."""
    following = dict(open_edges(welded).tolist())
    vertex = dict(zip(welded.reshape(-1).tolist(), faces.reshape(-1).tolist(), strict=True))
    loops = []
    while following:
        start = next(iter(following))
        walk = [start]
        while (step := following.pop(walk[-1])) != start:
            walk.append(step)
        loops.append(np.array([vertex[each] for each in walk]))
    return loops


def with_fans(asset: Asset, faces: Int64[np.ndarray, "F 3"], loops: list[Int64[np.ndarray, " _"]]) -> Asset:
    """The asset with these faces alone and a fan for each loop."""
    assert asset.welded is not None and asset.canonical is not None, "built from a field"
    count, first = len(asset.vertices), np.array([loop[0] for loop in loops], np.int64)
    fans = [
        np.stack([np.roll(loop, -1), loop, np.full(len(loop), count + number)], axis=1)
        for number, loop in enumerate(loops)
    ]
    joint_count = len(asset.skeleton.parents)
    dense = np.zeros((len(loops), joint_count))
    for row, loop in zip(dense, loops, strict=True):
        np.add.at(row, asset.joints[loop], asset.weights[loop] / len(loop))
    skin = limit_influences(dense)
    rows = np.concatenate([np.arange(count), first])
    used, corner = np.unique(np.concatenate([faces, *fans]), return_inverse=True)

    def filled(values: np.ndarray) -> np.ndarray:
        middles = [values[loop].mean(axis=0, dtype=np.float64) for loop in loops]
        return np.concatenate([values, *[m[None].astype(values.dtype) for m in middles]])[used]

    normal_map = asset.normal_map
    if normal_map is not None:
        normal_map = replace(normal_map, tangents=normal_map.tangents[rows][used])
    welded = np.concatenate([asset.welded, asset.welded.max() + 1 + np.arange(len(loops))])[used]
    return replace(
        asset,
        vertices=filled(asset.vertices),
        canonical=filled(asset.canonical),
        normals=asset.normals[rows][used],
        faces=corner.reshape(-1, 3).astype(np.int64),
        welded=np.unique(welded, return_inverse=True)[1].astype(np.int64),
        uv=asset.uv[rows][used],
        normal_map=normal_map,
        joints=np.concatenate([asset.joints, skin.joints])[used],
        weights=np.concatenate([asset.weights, skin.weights.astype(asset.weights.dtype)])[used],
        morphs=tuple(replace(morph, vertices=filled(morph.vertices)) for morph in asset.morphs),
    )
