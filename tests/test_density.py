"""Density from signed distance."""

import pytest
import torch

from avatargen.generator.density import SMALLEST_ALPHA, Density


@pytest.mark.parametrize("alpha", [0.1, 3e-3, SMALLEST_ALPHA])
def test_density_by_its_definition_and_finite_everywhere(alpha: float):
    density = Density(alpha).double()
    d = torch.tensor([-1e4, -1.0, -alpha, 0.0, alpha, 1.0, 1e4]).double()
    sigma = density(d)
    assert density.alpha.item() == pytest.approx(alpha, rel=1e-5)
    assert torch.isfinite(sigma).all()
    assert (torch.diff(sigma) <= 0).all()
    assert sigma[0].item() == pytest.approx(1 / alpha, rel=1e-5)
    assert sigma[3].item() == pytest.approx(0.5 / alpha, rel=1e-5)
    assert sigma[-1] == 0


def test_optical_depth_across_a_wall_is_its_thickness_over_alpha():
    """The integral of the density through a thick wall is its thickness over alpha."""
    density, thickness = Density(0.01).double(), 0.3
    t = torch.linspace(-1, 1, 400001).double()
    sigma = density(t.abs() - thickness / 2)
    assert torch.trapezoid(sigma, t).item() == pytest.approx(thickness / 0.01, rel=1e-4)


def test_alpha_stays_positive_and_is_learned():
    density = Density(0.01)
    density.p.data.fill_(-0.02)
    assert density.alpha.item() == pytest.approx(0.02 + SMALLEST_ALPHA)
    density(torch.tensor([0.01, -0.01])).square().sum().backward()
    assert density.p.grad is not None
    assert torch.isfinite(density.p.grad)


@pytest.mark.parametrize("alpha", [0.1, 3e-3, SMALLEST_ALPHA])
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
@torch.no_grad()
def test_mean_density_between_two_distances_is_that_of_many(alpha: float, dtype: torch.dtype):
    draw = torch.Generator().manual_seed(0)
    first = torch.randn(500, generator=draw).to(dtype) * 10 * alpha
    change = torch.randn(500, generator=draw).to(dtype) * alpha
    last = first + change * 10.0 ** torch.linspace(-9, 1, 500).to(dtype)
    density = Density(alpha).double()
    share = (torch.arange(10_000).double() + 0.5) / 10_000
    slow = density(torch.lerp(first.double()[:, None], last.double()[:, None], share)).mean(dim=1)
    found = Density(alpha).to(dtype).between(first, last).double()
    assert ((found - slow) / slow).abs().max() < (1e-4 if dtype == torch.float32 else 1e-5)


def test_mean_density_between_is_finite_with_finite_slopes_everywhere():
    ends = torch.tensor([-1e4, -1.0, -1e-6, 0.0, 1e-6, 1.0, 1e4])
    first, last = (end.clone().requires_grad_() for end in torch.meshgrid(ends, ends, indexing="ij"))
    for alpha in (SMALLEST_ALPHA, 1e-2, 10.0):
        density = Density(alpha)
        found = density.between(first, last)
        slopes = torch.autograd.grad(found.sum(), [first, last, density.p])
        assert torch.isfinite(found).all() and (found >= 0).all()
        assert all(torch.isfinite(slope).all() for slope in slopes)
