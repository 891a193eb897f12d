"""Volumes: a shape's numbers on a sparse grid, read back between the nodes."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from avatargen.errors import InputError
from avatargen.generator.dressed.volume import FARTHEST, REACH, RIM, STEPS, Volume
from avatargen.training.dressed.learn import errors_of, learn_volume

CELL = 0.005


@dataclass(frozen=True)
class Ball:
    """A ball whose edge is its lowest point, painted by a linear function of place."""

    centre = np.array([0.1, 0.2, -0.05])
    radius = 0.11

    @property
    def box(self):
        return np.stack([self.centre - self.radius, self.centre + self.radius])

    def ask(self, points):
        away = points - self.centre
        distance = np.linalg.norm(away, axis=1) - self.radius
        return distance.astype(np.float32), (0.1 * (away[:, 1] + self.radius)).astype(np.float32).clip(0)

    def surface(self, count, rng):
        up = rng.normal(size=(count, 3))
        return self.centre + self.radius * up / np.linalg.norm(up, axis=1, keepdims=True)

    def seen(self, count, rng):
        points = self.surface(count, rng).astype(np.float32)
        return points, self.paint(points)

    def paint(self, points):
        return 0.5 + (points - self.centre) @ np.array([[3.0, 0, 1], [0, 2, 1], [1, 1, 1]])


@pytest.fixture(scope="module")
def ball():
    return Ball()


@pytest.fixture(scope="module")
def volume(ball) -> Volume:
    return learn_volume(ball, CELL, np.random.default_rng(0))


def test_a_ball_comes_back(ball, volume):
    bricks = volume.read()
    points = ball.surface(5000, np.random.default_rng(1)).astype(np.float32)
    out = (points - ball.centre) / ball.radius
    for off in (-0.004, 0.0, 0.003):
        at = (points + off * out).astype(np.float32)
        distance, rim = bricks.read(at)
        true, edge = ball.ask(at)
        # trilinear: an eighth of the squared cell times the curvatures; and half a step of a byte
        bound = CELL**2 / 8 * 2 / ball.radius * 1.2 + REACH * CELL / STEPS
        assert np.abs(distance - true).max() < bound
        assert np.abs(rim - edge).max() < RIM / 255 + 1e-5
    # clipped to what colours can be
    assert np.abs(bricks.colors(points) - ball.paint(points).clip(0, 1)).max() < 0.02
    assert volume.config.count < 0.6 * np.prod(volume.config.blocks)


def test_no_point_is_on_the_wrong_side(ball, volume):
    low, high = ball.box
    points = np.random.default_rng(2).uniform(low - 0.2, high + 0.2, (40_000, 3)).astype(np.float32)
    true, found = ball.ask(points)[0], volume.read().read(points)[0]
    clear = np.abs(true) > 1e-3
    assert ((true < 0) == (found < 0))[clear].all()
    near = np.abs(true) < 0.04
    assert np.abs(true - found)[near].max() < 0.004


def test_it_is_never_nearer_than_said(ball, volume):
    low, high = ball.box
    points = np.random.default_rng(3).uniform(low - 0.5, high + 0.5, (40_000, 3)).astype(np.float32)
    least, true = volume.read().least(points), ball.ask(points)[0]
    assert (least >= 0).all() and (least <= np.maximum(true, 0) + 1e-6).all()
    assert (least > 0.3 * FARTHEST)[true > FARTHEST].all()


def test_learning_says_how_well_it_went(ball, volume):
    errors = errors_of(volume, ball, np.random.default_rng(4))
    assert errors["mm"] < 0.1 and errors["wrong side"] == 0 and errors["dB"] > 40


def test_far_from_its_blocks_it_has_no_colour(volume):
    assert (volume.read().colors(np.array([[3.0, 0, 0]], np.float32)) == 0.5).all()


def test_a_damaged_volume_ends_in_one_sentence(ball):
    volume = learn_volume(ball, 2 * CELL, np.random.default_rng(0))
    volume.occupied[0, 0, 0] = 1 - volume.occupied[0, 0, 0]
    with pytest.raises(InputError, match="blocks keeps"):
        volume.read()
    changes: tuple[dict[str, Any], ...] = (
        {"cell": 0.0},
        {"blocks": (0, 1, 1)},
        {"count": 10**9},
        {"colors": 2},
        {"low": (np.inf, 0.0, 0.0)},
    )
    for wrong in changes:
        with pytest.raises(InputError, match="out of range"):
            replace(volume.config, **wrong)
