"""Shares of the body's parts: sum to 1, smooth, one near a part's places, sparse."""

from dataclasses import replace

import numpy as np
import torch

from avatargen.avatar import shipped
from avatargen.body.load import load_body
from avatargen.body.model import canonical_body
from avatargen.generator.config import parts_of
from avatargen.generator.parts import JOINTS_OF_PARTS, Shares
from tests.generators import capsule_canonical


def default_shares() -> tuple[Shares, np.ndarray]:
    body = canonical_body(load_body(shipped("body.npz")))
    return Shares(parts_of(body)), body.vertices


def test_shares_sum_to_one_and_are_sparse_on_the_body():
    shares, vertices = default_shares()
    share = shares(torch.from_numpy(vertices))
    assert share.shape == (len(vertices), len(JOINTS_OF_PARTS))
    assert (share >= 0).all()
    assert (share.sum(dim=1) - 1).abs().max() < 1e-6
    assert (share > 0).sum(dim=1).float().mean() < 1.2  # few points are asked of two networks
    assert (share.max(dim=0).values == 1).all()


def test_a_place_belongs_to_its_part():
    body = canonical_body(load_body(shipped("body.npz")))
    parts = parts_of(body)
    shares = Shares(parts)
    for number, part in enumerate(parts):
        own = shares(torch.tensor(part))[:, number]
        assert own.min() > 0.9


def test_shares_change_smoothly():
    shares, _ = default_shares()
    points = (
        torch.rand(2000, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(0)) * 2 - 1
    ).requires_grad_()
    share = shares.double()(points)
    step = 1e-5
    moved = shares(points.detach() + step * torch.tensor([0.6, 0.64, 0.48]))
    assert ((moved - share).abs().max() / step) < 120  # per metre: a border is centimetres wide
    (slope,) = torch.autograd.grad(share.square().sum(), points)
    assert torch.isfinite(slope).all()


def test_far_points_have_finite_shares():
    shares, _ = default_shares()
    share = shares(torch.tensor([[1e3, -1e3, 5.0], [0.0, 0.0, 0.0]]))
    assert torch.isfinite(share).all()


def test_bodies_without_the_joints_are_one_part():
    body = capsule_canonical()
    assert len(parts_of(body)) == len(JOINTS_OF_PARTS)
    names = tuple(f"bone_{number}" for number in range(len(body.joint_names)))
    assert parts_of(replace(body, joint_names=names)) == ()
