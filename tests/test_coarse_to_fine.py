import numpy as np
import pytest

from assets.texture.coarse_to_fine import CONTRAST, LARGEST_BLOCK, ask_coarse_to_fine

SIZE = 150  # no multiple of a block


class Picture:
    """A picture that counts how often each texel is asked."""

    def __init__(self, texels):
        self.texels = texels.reshape(len(texels), len(texels), -1).astype(np.uint8)
        self.times = np.zeros(len(texels) ** 2, dtype=int)

    def __call__(self, numbers):
        np.add.at(self.times, numbers, 1)
        return self.texels.reshape(self.times.size, -1)[numbers]


def found(picture, wanted=None):
    wanted = np.ones(picture.texels.shape[:2], dtype=bool) if wanted is None else wanted
    texels = ask_coarse_to_fine(picture, wanted, picture.texels.shape[2])
    assert texels.dtype == np.uint8
    assert picture.times.max() <= 1, "a texel was asked twice"
    assert not picture.times[~wanted.reshape(-1)].any(), "a texel was asked that nobody wants"
    assert not texels[~wanted].any()
    return texels.astype(int)


def disc(rng, radius, level, size=SIZE):
    x, y = rng.uniform(radius, size - 1 - radius, size=2)
    row, column = np.mgrid[:size, :size]
    return np.where((row - y) ** 2 + (column - x) ** 2 <= radius**2, level, 100)


def test_one_colour_is_asked_at_corners_and_middles():
    picture = Picture(np.full((SIZE, SIZE, 3), [10, 120, 255]))
    assert (found(picture) == [10, 120, 255]).all()
    assert picture.times.mean() < 2.5 / LARGEST_BLOCK**2


def test_noise_is_asked_everywhere():
    picture = Picture(np.random.default_rng(0).integers(0, 256, (SIZE, SIZE, 3)))
    assert (found(picture) == picture.texels).all()
    assert picture.times.all()


@pytest.mark.parametrize("slope", [0.05, 0.2, 0.37])
def test_a_gentle_slope_follows_from_few_texels(slope):
    row, column = np.mgrid[:SIZE, :SIZE]
    picture = Picture(np.rint(20 + slope * (row + column)))
    assert np.abs(found(picture) - picture.texels).max() <= 1
    assert picture.times.mean() < 0.2


@pytest.mark.parametrize("radius", [2.0, 3.0, 7.5, 40.0])
@pytest.mark.parametrize("contrast", [CONTRAST + 1, 150])
def test_a_spot_of_half_a_block_or_more_is_found_with_its_whole_border(radius, contrast):
    rng = np.random.default_rng(int(radius * 10))
    for _ in range(20):
        picture = Picture(disc(rng, radius, 100 + contrast))
        assert (found(picture) == picture.texels).all()
        assert picture.times.mean() < 0.6


def test_what_is_left_out_differs_by_little():
    """Soft spots of any size, in three channels."""
    rng = np.random.default_rng(5)
    row, column = np.mgrid[:SIZE, :SIZE]
    for _ in range(10):
        x, y = rng.uniform(20, SIZE - 20, size=2)
        width = rng.uniform(4, 30)
        bump = np.exp(-((row - y) ** 2 + (column - x) ** 2) / (2 * width**2))
        picture = Picture(np.rint(50 + bump[..., None] * rng.uniform(0, 200, size=3)))
        assert np.abs(found(picture) - picture.texels).max() <= CONTRAST


@pytest.mark.parametrize("charts", [1, 8, 100])
def test_only_wanted_texels_count(charts):
    """Charts of any outline, beside texels that hold anything."""
    rng = np.random.default_rng(1)
    wanted = np.zeros((SIZE, SIZE), dtype=bool)
    for _ in range(charts):
        wanted |= disc(rng, rng.uniform(2, 30), 1) == 1
    row, column = np.mgrid[:SIZE, :SIZE]
    slope = np.rint(40 + 0.3 * row + 0.4 * column)
    picture = Picture(np.where(wanted, slope, 255 * rng.random(wanted.shape)))
    off = found(picture, wanted) - np.where(wanted[..., None], picture.texels, 0)
    assert np.abs(off).max() <= 1


@pytest.mark.parametrize("size", [16, 17, 18, 19])
def test_small_textures(size):
    rng = np.random.default_rng(size)
    picture = Picture(disc(rng, 5.0, 7, size))
    assert (found(picture) == picture.texels).all()
