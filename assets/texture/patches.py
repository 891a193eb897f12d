"""Small charts of what no pattern fits, as the inside of clothes: each holds neighbouring faces that face
much the same way, so that seen from there none is turned over.

Letters: F faces, E directed edges, N chosen faces.
"""

import numpy as np
from jaxtyping import Bool, Int64

from assets.mesh.surface import Surface, normals_of
from avatargen.compiled import compiled

TINY = 1e-30


def find_patches(
    surface: Surface,
    twin: Int64[np.ndarray, " E"],
    chosen: Bool[np.ndarray, " F"],
    widest: float,
    fewest: int,
) -> Int64[np.ndarray, " N"]:
    """A number for each chosen face, from 0: neighbours that face at most so far (degrees) from the mean of
    their patch; fewer than so many join a neighbouring patch whichever way they face."""
    normals = normals_of(surface.vertices[surface.faces])
    area = np.maximum(np.linalg.norm(normals, axis=1), TINY)
    patch = np.where(chosen, 0, -1)
    beside = np.where(twin >= 0, twin // 3, np.arange(len(twin)) // 3).reshape(-1, 3)
    order = np.flatnonzero(chosen)
    order = order[np.argsort(-area[order], kind="stable")]
    grow(normals, area, beside, order, patch, np.cos(np.radians(widest)))
    join_few(normals, area, beside, order, patch, fewest)
    return np.unique(patch[chosen], return_inverse=True)[1].astype(np.int64)


@compiled
def grow(normals, area, beside, order, patch, cosine):
    """Number the faces [F] whose patch is 0, from 1 on: from the first in `order` [N] that is left, over the
    faces beside [F 3], twice, first about that face's direction and then about the mean of what that found.

    `normals` [F 3] are twice as long as their faces' `area` [F] is large, or as long as any measure of it.
    """
    queue = np.empty(len(order), np.int64)
    number = 0
    for start in order:
        if patch[start] != 0:
            continue
        number += 1
        x, y, z = normals[start, 0], normals[start, 1], normals[start, 2]
        for again in range(2):
            length = max(np.sqrt(x * x + y * y + z * z), 1e-30)
            x, y, z = x / length, y / length, z / length
            mx, my, mz = 0.0, 0.0, 0.0
            queue[0], patch[start], first, last = start, number, 0, 1
            while first < last:
                face = queue[first]
                first += 1
                mx, my, mz = mx + normals[face, 0], my + normals[face, 1], mz + normals[face, 2]
                for i in range(3):
                    other = beside[face, i]
                    if patch[other] != 0:
                        continue
                    along = normals[other, 0] * x + normals[other, 1] * y + normals[other, 2] * z
                    if along >= cosine * area[other]:
                        patch[other] = number
                        queue[last] = other
                        last += 1
            if again == 0:
                for i in range(last):
                    patch[queue[i]] = 0
                x, y, z = mx, my, mz


@compiled
def join_few(normals, area, beside, order, patch, fewest):
    """Give the faces of patches of few to the neighbouring patch, no smaller one, that they turn away from
    least, face by face and again as long as there are such: squares of sizes grow, so it ends."""
    count = 0
    for face in order:
        count = max(count, patch[face])
    size, mean = np.zeros(count + 1, np.int64), np.zeros((count + 1, 3))
    for face in order:
        size[patch[face]] += 1
        mean[patch[face]] += normals[face]
    changed = True
    while changed:
        changed = False
        for face in order[::-1]:
            own = patch[face]
            if size[own] >= fewest:
                continue
            best, found = -2.0 * area[face], own
            for i in range(3):
                other = patch[beside[face, i]]
                if other > 0 and other != own and size[other] >= size[own]:
                    x, y, z = mean[other]
                    length = max(np.sqrt(x * x + y * y + z * z), 1e-30)
                    along = (normals[face, 0] * x + normals[face, 1] * y + normals[face, 2] * z) / length
                    if along > best:
                        best, found = along, other
            if found != own:
                patch[face] = found
                size[own] -= 1
                size[found] += 1
                changed = True
