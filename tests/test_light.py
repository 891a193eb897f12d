"""Light around a surface: what sees the sky receives it all, what stands under a roof does not."""

import numpy as np
import pytest

from assets.mesh.surface import Surface
from assets.picture.light import cast_samples, lamps_around, received, sees
from tests.shapes import icosphere

UP = np.array([[0.0, 1.0, 0.0]])


def test_lamps_are_spread_evenly():
    lamps = lamps_around()
    assert np.allclose(np.linalg.norm(lamps, axis=1), 1)
    assert np.abs(lamps.mean(axis=0)).max() < 0.01
    nearest = np.sort(np.arccos(np.clip(lamps @ lamps.T, -1, 1)), axis=1)[:, 1]
    assert nearest.max() < 1.7 * nearest.min()
    assert (np.abs(lamps[:, 1]) < 1).all()


def test_a_ball_shades_nothing_of_itself_that_faces_a_lamp():
    ball = icosphere()
    light = received(ball.vertices, ball.vertices, cast_samples(ball), lamps_around())
    assert light.sum(axis=1) == pytest.approx(np.ones(len(light)), abs=0.06)


def test_a_roof_takes_the_light_from_above():
    roof = Surface(
        vertices=np.array([[-0.4, 0.4, -0.4], [-0.4, 0.4, 0.4], [0.4, 0.4, 0.4], [0.4, 0.4, -0.4]]),
        faces=np.array([[0, 1, 2], [0, 2, 3]]),
    )
    lamps = lamps_around()
    under = received(np.zeros((1, 3)), UP, cast_samples(roof), lamps)[0]
    through_roof = (lamps[:, 1] > 0) & (np.abs(lamps[:, [0, 2]]) < 0.95 * lamps[:, [1]]).all(axis=1)
    past_roof = (lamps[:, 1] > 0) & (np.abs(lamps[:, [0, 2]]) > 1.05 * lamps[:, [1]]).any(axis=1)
    assert (under[through_roof] == 0).all()
    assert under[past_roof] == pytest.approx(4 / len(lamps) * lamps[past_roof, 1])
    assert (under[lamps[:, 1] < 0] == 0).all()


def test_points_beside_the_shadow_see_the_lamp():
    lamp = np.array([0.6, 0.8, 0.0])
    points = np.array([[-0.6, -0.8, 0.0], [5.0, 0.0, 0.0], [0.6, 0.8, 0.0]])  # behind, beside, before
    assert sees(points, np.zeros((1, 3)), lamp) == pytest.approx([0, 1, 1], abs=1e-12)
