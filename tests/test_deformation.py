"""Residual deformation."""

import torch

from avatargen.generator.config import DeformationConfig
from avatargen.generator.deformation import Deformation
from tests.generators import randomize


def deformation() -> Deformation:
    return Deformation(
        DeformationConfig(width=16, depth=2, frequencies=2), w_size=8, joint_count=5, shape_count=3
    )


def test_it_starts_as_identity():
    inputs = torch.rand(2, 50, 3), torch.randn(2, 8), torch.randn(2, 5, 3), torch.randn(2, 3)
    assert not deformation()(*inputs).any()


def test_it_depends_on_point_style_pose_and_shape_but_not_on_the_root():
    network = deformation()
    randomize(network)
    points, w, pose, betas = torch.rand(2, 50, 3), torch.randn(2, 8), torch.randn(2, 5, 3), torch.randn(2, 3)
    moved = network(points, w, pose, betas)
    turned = pose.clone()
    turned[:, 0] += 1
    bent = pose.clone()
    bent[:, 3] += 1

    assert torch.equal(network(points, w, turned, betas), moved)
    for other in (
        (points + 0.1, w, pose, betas),
        (points, w + 1, pose, betas),
        (points, w, bent, betas),
        (points, w, pose, betas + 1),
    ):
        assert not torch.allclose(network(*other), moved)
