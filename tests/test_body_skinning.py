"""Skinning and its inverse."""

import numpy as np
import pytest

from avatargen.avatar import shipped
from avatargen.body.load import load_body
from avatargen.body.model import pose, shape
from avatargen.body.pose import named_pose
from avatargen.body.skinning import skin, unskin
from tests.bodies import capsule_body


@pytest.mark.parametrize("seed", range(3))
def test_inverse_skinning_returns_every_vertex(seed: int):
    body, rng = capsule_body(), np.random.default_rng(seed)
    shaped = shape(body, rng.normal(size=10))
    posed = pose(body, shaped, rng.normal(size=(24, 3)) * 0.6, rng.normal(size=3))

    back = unskin(posed.vertices, body.weights, posed.T_posed_rest)

    assert np.abs(back - shaped.vertices).max() < 1e-5


def test_opposite_rotations_fall_back_to_the_heavier_joint():
    transforms = np.stack([np.eye(4), np.diag([-1.0, 1.0, -1.0, 1.0])])  # a half turn about y
    weights = np.array([[0.4999, 0.5001], [0.9, 0.1]])
    points = np.array([[0.1, 0.2, 0.3], [0.1, 0.2, 0.3]])

    back = unskin(points, weights, transforms)

    assert np.allclose(back[0], [-0.1, 0.2, -0.3])  # rigid, by joint 1
    assert np.allclose(skin(back[1:], weights[1:], transforms), points[1:])  # regular, so exact


def test_no_points_is_no_problem():
    assert skin(np.zeros((0, 3)), np.zeros((0, 2)), np.stack([np.eye(4)] * 2)).shape == (0, 3)
    assert unskin(np.zeros((0, 3)), np.zeros((0, 2)), np.stack([np.eye(4)] * 2)).shape == (0, 3)


@pytest.mark.parametrize("name", ["x", "t", "a"])
def test_the_shipped_body_returns_from_its_named_poses(name: str):
    body = load_body(shipped("body.npz"))
    shaped = shape(body, np.linspace(-2, 2, body.shapedirs.shape[2]))
    posed = pose(body, shaped, named_pose(name, body.joint_names))

    assert np.abs(unskin(posed.vertices, body.weights, posed.T_posed_rest) - shaped.vertices).max() < 1e-5
