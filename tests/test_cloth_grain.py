"""Places on cloth: metres, alike on both sides, and whole but at the armholes."""

import numpy as np
import pytest

from avatargen.body.load import load_body
from avatargen.body.model import CanonicalBody, canonical_body
from avatargen.shipped import shipped
from avatargen.wardrobe.cloth_grain import ANGLES, Grain, grain_of, quarter_arcs


@pytest.fixture(scope="module")
def body() -> CanonicalBody:
    return canonical_body(load_body(shipped("body.npz")))


@pytest.fixture(scope="module")
def grain(body) -> Grain:
    return grain_of(body)


def test_arcs_are_those_of_circles_and_of_thin_ellipses():
    arcs = quarter_arcs(np.array([0.2, 0.3]), np.array([0.2, 1e-9]))
    angle = np.linspace(0, np.pi / 2, ANGLES)
    assert np.allclose(arcs[0], 0.2 * angle, atol=1e-12)
    assert np.allclose(arcs[1], 0.3 * np.sin(angle), atol=1e-4)  # along its width


def test_left_and_right_are_alike(grain, body):
    points = body.vertices[::7].astype(np.float64)
    assert np.allclose(grain.places(points), grain.places(points * [-1, 1, 1]), atol=1e-12)


def test_a_metre_on_the_chest_is_a_metre_of_cloth(grain, body):
    """Steps on the front of the trunk, where most of a print is seen, change places by their lengths."""
    names, weight = body.joint_names, body.weights
    trunk = weight[:, [names.index(name) for name in ("spine1", "spine2", "spine3")]].sum(axis=1) > 0.9
    faces = body.faces[trunk[body.faces].all(axis=1) & (body.vertices[body.faces, 2].min(axis=1) > 0.02)]
    ends = np.concatenate([faces[:, :2], faces[:, 1:]])
    place = grain.places(body.vertices)[ends]
    laid = np.linalg.norm(place[:, 0] - place[:, 1], axis=1)
    true = np.linalg.norm(body.vertices[ends[:, 0]] - body.vertices[ends[:, 1]], axis=1)
    assert 0.9 < np.median(laid / true) < 1.1
    assert np.quantile(laid / true, 0.05) > 0.6 and np.quantile(laid / true, 0.95) < 1.4


def test_nothing_jumps_but_at_the_armholes(grain):
    """Around the waist, over a shoulder and around an arm, a millimetre moves places by a few at most."""
    turn = np.linspace(0, 2 * np.pi, 1200)
    waist = np.stack([0.16 * np.sin(turn), np.full_like(turn, 0.2), 0.11 * np.cos(turn) - 0.03], axis=1)
    arm = np.stack(
        [np.full_like(turn, 0.5), 0.478 + 0.05 * np.cos(turn), 0.012 + 0.05 * np.sin(turn)], axis=1
    )
    for ring in (waist, arm):
        step = np.linalg.norm(np.diff(grain.places(ring), axis=0), axis=1)
        assert step.max() < 3 * np.linalg.norm(np.diff(ring, axis=0), axis=1).max()


def test_sleeves_are_told_from_what_hangs_below_the_armpit(grain):
    points = np.array(
        [[0.3, 0.45, 0.0], [0.19, 0.3, 0.0], [0.4, -0.2, 0.1], [0.1, 0.5, 0.05], [0.6, 0.44, 0.0]]
    )
    assert grain.on_sleeve(points).tolist() == [True, False, False, False, True]
