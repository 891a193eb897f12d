import numpy as np
import pytest

from avatargen.mesh.morton import morton_order


def interleaved(x: int, y: int, z: int) -> int:
    return sum(
        (x >> bit & 1) << 3 * bit | (y >> bit & 1) << 3 * bit + 1 | (z >> bit & 1) << 3 * bit + 2
        for bit in range(8)
    )


@pytest.mark.parametrize("count", [2, 1000])
def test_points_lie_along_the_curve(count: int) -> None:
    """Whole numbers of 0 to 255 are their own cells; equal ones keep their order."""
    points = np.random.default_rng(0).integers(0, 256, (count, 3))
    points[:2] = [[0, 0, 0], [255, 255, 255]]
    points[10:20] = points[30:40]
    codes = [interleaved(*point) for point in points.tolist()]
    assert morton_order(points.astype(np.float32)).tolist() == sorted(range(count), key=codes.__getitem__)


def test_neighbours_follow_each_other() -> None:
    points = np.random.default_rng(1).random((20_000, 3))
    steps = np.linalg.norm(np.diff(points[morton_order(points)], axis=0), axis=1)
    assert np.median(steps) < 0.06  # half a unit in random order


def test_points_at_one_place_keep_their_order() -> None:
    for count in (0, 1, 5):
        assert morton_order(np.ones((count, 3))).tolist() == list(range(count))
