"""Sampling of the planes: axes, texels, both methods equal, twice differentiable, monotone warp."""

import numpy as np
import pytest
import torch
from torch.autograd import gradcheck, gradgradcheck

from avatargen.generator.config import PlanesConfig, interval_warp
from avatargen.generator.planes import PlaneFrame, lookup_bilinear, plane_table, sample_planes

METHODS = ("fast", "differentiable")


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(("plane", "axes"), [(0, (0, 1)), (1, (1, 2)), (2, (0, 2))])
def test_each_plane_spans_its_axes(method, plane: int, axes: tuple[int, int]):
    """A plane that holds a linear function of (column, row) returns it of (first axis, second axis)."""
    R = 16
    centers = (torch.arange(R) + 0.5) / R
    planes = torch.zeros(1, 3, 2, R, R)
    planes[0, plane, 0] = centers[None, :]
    planes[0, plane, 1] = centers[:, None]
    points = torch.rand(1, 200, 3) * (1 - 1 / R) + 0.5 / R  # within the outermost texel centres

    sampled = sample_planes(planes, points, method)

    assert torch.allclose(sampled, points[..., list(axes)], atol=1e-6)


@pytest.mark.parametrize("method", METHODS)
def test_texel_centres_and_borders(method):
    R = 8
    planes = torch.randn(2, 3, 4, R, R)
    i, j, k = 3, 7, 0
    place = (torch.tensor([i, j, k]) + 0.5) / R
    expected = planes[:, 0, :, j, i] + planes[:, 1, :, k, j] + planes[:, 2, :, k, i]
    assert torch.allclose(sample_planes(planes, place.expand(2, 1, 3), method)[:, 0], expected, atol=1e-6)

    outermost = sample_planes(planes, torch.tensor([0.5, 1.0, 0.5]).expand(2, 1, 3), method)
    last_center = sample_planes(planes, torch.tensor([0.5, 1 - 0.5 / R, 0.5]).expand(2, 1, 3), method)
    assert torch.allclose(outermost, last_center, atol=1e-6)  # the border repeats


def test_all_methods_agree():
    planes, points = torch.randn(3, 3, 8, 32, 32), torch.rand(3, 2000, 3)
    points[0, :8] = torch.tensor(np.indices((2, 2, 2)).reshape(3, 8).T.copy())  # the box's corners
    fast, slow = (sample_planes(planes.double(), points.double(), method) for method in METHODS)
    assert (fast - slow).abs().max() < 1e-6
    single = sample_planes(planes, points, "differentiable")
    assert (single - fast).abs().max() < 1e-4
    assert (lookup_bilinear(plane_table(planes)[1], points[1]) - single[1]).abs().max() < 1e-5


def test_gather_is_differentiable_twice():
    draw = torch.Generator().manual_seed(0)
    planes = torch.randn(2, 3, 2, 4, 4, generator=draw, dtype=torch.float64, requires_grad=True)
    cells = torch.randint(1, 3, (2, 3, 3), generator=draw)
    inside = torch.rand(2, 3, 3, generator=draw, dtype=torch.float64) * 0.8 + 0.1
    points = ((cells + inside) / 4).requires_grad_()  # away from the creases between texels

    def sample(planes, points):
        return sample_planes(planes, points, "differentiable")

    assert gradcheck(sample, (planes, points))
    assert gradgradcheck(sample, (planes, points))


def test_gradients_of_both_methods_agree():
    planes = torch.randn(2, 3, 4, 8, 8, dtype=torch.float64)
    points = torch.rand(2, 100, 3, dtype=torch.float64) * 0.8 + 0.1
    grads = []
    for method in METHODS:
        inputs = planes.clone().requires_grad_(), points.clone().requires_grad_()
        grads.append(torch.autograd.grad(sample_planes(*inputs, method).square().sum(), inputs))
    for fast, slow in zip(*grads, strict=True):
        assert (fast - slow).abs().max() < 1e-8


def test_the_frame_maps_the_box_to_the_unit_cube():
    config = PlanesConfig(low=(-1.0, -2.0, -0.5), high=(1.0, 1.0, 0.5), head_gain=1.0)
    frame = PlaneFrame(config)
    points = torch.tensor([[-1.0, -2, -0.5], [1, 1, 0.5], [0, -0.5, 0], [9, 9, 9]])
    assert torch.allclose(frame(points), torch.tensor([[0.0, 0, 0], [1, 1, 1], [0.5, 0.5, 0.5], [1, 1, 1]]))
    assert torch.allclose(frame.centered(points[:3]), torch.tensor([[-1.0, -1, -1], [1, 1, 1], [0, 0, 0]]))


def test_the_warp_is_monotone_and_spends_texels_on_its_interval():
    knots = interval_warp(0.6, 0.8, gain=3.0)
    frame = PlaneFrame(
        PlanesConfig(
            low=(0.0, 0.0, 0.0),
            high=(1.0, 1.0, 1.0),
            warp=(knots, knots, ((0.0, 0.0), (0.5, 0.5), (0.7, 0.7), (1.0, 1.0))),
        )
    )
    line = torch.linspace(0, 1, 1001)
    warped = frame(line[:, None].expand(-1, 3))
    expected = np.interp(line.numpy(), *np.array(knots).T)

    assert np.abs(warped[:, 0].numpy() - expected).max() < 1e-5
    assert torch.allclose(warped[:, 2], line, atol=1e-6)  # a straight table changes nothing
    steps = torch.diff(warped[:, 0]) * 1000
    assert (steps > 0).all()
    assert torch.allclose(steps[650:750], 3 * steps[100:200], rtol=1e-2)
    assert warped[-1, 0] == pytest.approx(1.0, abs=1e-5)
