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
