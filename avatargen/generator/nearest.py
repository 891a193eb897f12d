"""The nearest vertices of posed bodies: trees on the CPU, all distances on other devices.

Letters: B people, N points, V vertices, K nearest. Metres.
"""

from collections.abc import Sequence
from functools import cache
from importlib.util import find_spec

import numpy as np
import torch
from jaxtyping import Float, Int
from scipy.spatial import KDTree
from torch import Tensor

PAIRS = 1 << 26  # distances that are held at once where no kernel is


def nearest_vertices(
    points: Float[Tensor, "B N 3"], vertices: Float[Tensor, "B V 3"], count: int
) -> tuple[Float[Tensor, "B N K"], Int[Tensor, "B N K"]]:
    """Distances to the nearest vertices and which these are, the nearest first.

    Those of the trees to float32's rounding, but for the order of equal distances.
    """
    if points.device.type == "cuda" and has_triton():
        from avatargen.generator.nearest_kernel import nearest_by_kernel

        squared, index = nearest_by_kernel(points.float(), vertices.float(), count)
    else:
        squared, index = nearest_by_all(points, vertices, count)
    return squared.sqrt(), index


@cache
def has_triton() -> bool:
    """Whether kernels can be made; torch brings what it takes for GPUs."""
    return find_spec("triton") is not None


def by_trees(
    trees: Sequence[KDTree], points: Float[Tensor, "B N 3"], count: int
) -> tuple[Float[Tensor, "B N K"], Int[Tensor, "B N K"]]:
    """The same by a tree of each person's vertices, on the CPU."""
    numbers = [*range(1, count + 1)]
    found = [
        tree.query(some.numpy(), k=numbers)  # pyright: ignore[reportArgumentType]
        for tree, some in zip(trees, points, strict=True)
    ]
    distance, index = (np.stack(part) for part in zip(*found, strict=True))
    return torch.from_numpy(distance).to(points), torch.from_numpy(index)


def nearest_by_all(
    points: Float[Tensor, "B N 3"], vertices: Float[Tensor, "B V 3"], count: int
) -> tuple[Float[Tensor, "B N K"], Int[Tensor, "B N K"]]:
    """Squared distances, by all pairs in parts."""
    width = max(1, PAIRS // (len(points) * vertices.shape[1]))
    parts = []
    for some in points.split(width, dim=1):
        squared = torch.zeros((), dtype=points.dtype, device=points.device)
        for axis in range(3):
            squared = squared + (some[:, :, None, axis] - vertices[:, None, :, axis]).square()
        parts.append(squared.topk(count, dim=2, largest=False, sorted=True))
    distance, index = (torch.cat(part, dim=1) for part in zip(*parts, strict=True))
    return distance, index
