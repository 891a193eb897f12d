"""Canonical mapping: posed people return to the canonical space."""

import numpy as np
import pytest
import torch

from avatargen.body.model import PosedBody, canonical_body, pose, shape
from avatargen.errors import InputError
from avatargen.generator.canonical import canonical_map
from tests.bodies import capsule_body


def posed(seed: int, pose_blend: bool = True, size: float = 0.5) -> PosedBody:
    body, rng = capsule_body(0.04, pose_blend), np.random.default_rng(seed)
    return pose(body, shape(body, rng.normal(size=10)), rng.normal(size=(24, 3)) * size, rng.normal(size=3))


@pytest.mark.parametrize("nearest", [1, 2, 3, 4])
@pytest.mark.parametrize("pose_blend", [False, True])
def test_posed_vertices_return_to_the_canonical_ones(nearest: int, pose_blend: bool):
    person = posed(nearest, pose_blend)
    points = torch.from_numpy(person.vertices).float()
    canonical, distance = canonical_map(person)(points, nearest)

    expected = torch.from_numpy(canonical_body(person.shaped.body).vertices)
    assert (canonical - expected).abs().max() < 1e-5
    assert distance.max() < 1e-6


def test_points_off_a_rigid_part_keep_their_place_on_it():
    """A person that is only turned and moved as a whole: the map is the inverse of that motion everywhere."""
    body = capsule_body(0.04)
    rotations = np.zeros((24, 3))
    rotations[0] = [0.3, 1.0, -0.2]
    person = pose(body, shape(body, np.zeros(10)), rotations, np.array([0.5, -1.0, 2.0]))
    canonical = canonical_body(body)
    rng = np.random.default_rng(0)
    head = canonical.vertices[canonical.vertices[:, 1] > canonical.vertices[:, 1].max() - 0.1]
    away = head + rng.normal(size=head.shape) * 0.03
    motion = person.T_world_joint[15] @ np.linalg.inv(
        np.block([[np.eye(3), person.shaped.joints[15][:, None]], [np.zeros((1, 3)), 1.0]])
    )
    moved = away @ motion[:3, :3].T + motion[:3, 3]
    back, _ = canonical_map(person)(torch.from_numpy(moved).float(), 2)
    assert (back.numpy() - away).__abs__().max() < 2e-3  # the neck's small weights turn with the legs' pose


def test_the_map_is_differentiable_in_the_points():
    person = posed(0)
    mapping = canonical_map(person)
    points = torch.from_numpy(person.vertices[:20] + 0.01).requires_grad_()
    canonical, _ = mapping(points, 2)
    (gradient,) = torch.autograd.grad(canonical[:, 0].sum(), points)
    step = torch.zeros_like(points)
    step[:, 1] = 1e-7
    numeric = (mapping(points + step, 2)[0] - mapping(points - step, 2)[0])[:, 0] / 2e-7
    assert torch.isfinite(gradient).all()
    assert (gradient[:, 1] - numeric).abs().max() < 0.5  # the blend of two vertices is held fixed
    single = mapping(points, 1)[0]
    (exact,) = torch.autograd.grad(single[:, 0].sum(), points)
    numeric = (mapping(points + step, 1)[0] - mapping(points - step, 1)[0])[:, 0] / 2e-7
    assert (exact[:, 1] - numeric).abs().max() < 1e-4


def test_the_count_of_vertices_is_checked():
    mapping = canonical_map(posed(0))
    for nearest in (0, 5):
        with pytest.raises(InputError, match="1 to 4"):
            mapping(torch.zeros(1, 3), nearest)
