"""The nearest marked texel, against scipy's distance transform."""

import numpy as np
import pytest
from scipy.ndimage import distance_transform_edt

from assets.texture.nearest_texel import nearest_texels


def blocks(shape, seed):
    rng = np.random.default_rng(seed)
    marked = np.zeros(shape, dtype=bool)
    for _ in range(40):
        y, x = rng.integers(0, shape)
        marked[y : y + rng.integers(1, 12), x : x + rng.integers(1, 20)] = True
    return marked


def alone(shape, *texels):
    marked = np.zeros(shape, dtype=bool)
    marked[tuple(np.array(texels).T)] = True
    return marked


@pytest.mark.parametrize(
    "marked",
    [
        blocks((97, 160), 0),
        blocks((160, 97), 1),
        np.random.default_rng(2).random((64, 64)) < 0.01,
        alone((50, 70), (0, 0)),
        alone((50, 70), (49, 69), (3, 60)),
        alone((16, 1), (7, 0)),
        alone((1, 16), (0, 3), (0, 12)),
        np.ones((9, 9), dtype=bool),
    ],
    ids=["wide", "high", "noise", "corner", "two", "column", "row", "all"],
)
def test_as_near_as_the_distance_transform(marked):
    nearest, squared = nearest_texels(marked)
    row, column = np.indices(marked.shape)
    there = nearest // marked.shape[1], nearest % marked.shape[1]

    assert marked[there].all()
    assert np.array_equal((there[0] - row) ** 2 + (there[1] - column) ** 2, squared)
    distance = np.asarray(distance_transform_edt(~marked))
    assert np.array_equal(squared, np.rint(distance**2))
