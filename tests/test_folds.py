"""Folds: where they are, which way they run, and where there are none."""

import numpy as np
import pytest

from avatargen.wardrobe.tailored.folds import (
    ANKLE,
    ELBOW,
    KNEE,
    WAIST,
    Family,
    noise,
    of_bottom,
    of_top,
    ridges,
)

RNG = np.random.default_rng(0)
HEM = -0.01


def somewhere(low, high, count=4000):
    return RNG.uniform(low, high, (count, 3))


def steepness(of, at, axis, step=0.002):
    """How much a function of places changes along an axis, in the mean."""
    there = at.copy()
    there[:, axis] += step
    return np.abs(of(there) - of(at)).mean()


@pytest.mark.parametrize("end", [None, 0.3, 0.68])
def test_folds_of_tops_stand_out_and_never_sink_in(end):
    found = of_top(somewhere((-0.7, -0.05, -0.15), (0.7, 0.6, 0.15)), end, HEM)
    assert found.min() >= 0 and 0.5 < found.max() <= 1


def test_across_the_waist_behind_folds_lie_more_than_they_hang():
    at = somewhere((-0.12, WAIST + 0.02, -0.12), (0.12, WAIST + 0.1, -0.08))
    assert steepness(lambda x: of_top(x, None, HEM), at, 1) > steepness(lambda x: of_top(x, None, HEM), at, 0)


def test_at_the_hem_they_hang():
    at = somewhere((-0.12, HEM, 0.08), (0.12, HEM + 0.03, 0.12))
    assert steepness(lambda x: of_top(x, None, HEM), at, 0) > steepness(lambda x: of_top(x, None, HEM), at, 1)


def test_sleeves_have_rings_where_they_cover_the_elbow():
    elbow = somewhere((ELBOW - 0.02, 0.38, -0.04), (ELBOW + 0.02, 0.48, 0.04))
    assert of_top(elbow, 0.68, HEM).max() > 0.5
    assert of_top(elbow, 0.3, HEM).max() < 0.05
    assert not of_top(elbow, None, HEM).any()


def test_trousers_have_them_at_the_knee_and_long_ones_at_the_ankle():
    knee = somewhere((0.05, KNEE - 0.03, -0.06), (0.15, KNEE + 0.03, 0.06))
    ankle = somewhere((0.05, ANKLE, -0.06), (0.15, ANKLE + 0.06, 0.06))
    assert of_bottom(knee, -0.87).max() > 0.5 and of_bottom(ankle, -0.87).max() > 0.5
    assert of_bottom(knee, -0.23).max() < 1e-9


def test_ridges_are_narrow_broken_and_never_straight():
    at = somewhere((-0.2, -0.2, -0.2), (0.2, 0.2, 0.2), 20_000)
    found = ridges(at, Family(turns=at[:, 1] / 0.05, there=np.ones(len(at))), seed=3)
    assert (found > 0.5).mean() < 0.3
    along = np.zeros((400, 3))
    along[:, 0] = np.linspace(-0.3, 0.3, 400)
    one = ridges(along, Family(turns=np.zeros(400), there=np.ones(400)), seed=3)
    assert one.max() > 0.8 and one.min() < 0.2  # it comes to an end


def test_noise_is_smooth_and_the_same_for_the_same_seed():
    at = somewhere((-1, -1, -1), (1, 1, 1))
    assert np.array_equal(noise(at, 0.1, 4), noise(at, 0.1, 4))
    assert abs(noise(at, 0.1, 4).mean()) < 0.05 and 0.5 < noise(at, 0.1, 4).std() < 1.0
    assert np.abs(noise(at + 1e-4, 0.1, 4) - noise(at, 0.1, 4)).max() < 0.05
