"""Stress of density and volume rendering: narrow transitions, long and short steps, two precisions, against
float64."""

import torch
from torch import Tensor

from avatargen.commands.stress.case import Case, require
from avatargen.generator.density import SMALLEST_ALPHA, Density
from avatargen.generator.renderer import Samples, composite

ALPHAS = (1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0, 10.0)
STEPS = (1e-6, 1e-4, 1e-2, 1.0, 10.0)
PRECISIONS = {torch.float32: 2e-5, torch.bfloat16: 2e-2}  # largest error, as a share of the largest value


def density_at(alpha: float, dtype: torch.dtype) -> Density:
    """A density whose width is asked to be alpha; no width falls below the smallest."""
    density = Density(SMALLEST_ALPHA)
    with torch.no_grad():
        density.p.fill_(max(alpha - SMALLEST_ALPHA, 0.0))
    return density.to(dtype)


def distances() -> Tensor:
    """Metres, both signs, exact in bfloat16."""
    powers = 2.0 ** torch.arange(-20, 7)
    return torch.cat([-powers, torch.zeros(1), powers])


@torch.no_grad()
def densities(dtype: torch.dtype) -> str:
    worst = 0.0
    for alpha in ALPHAS:
        density = density_at(alpha, dtype)
        wide = float(density.alpha.double())
        true = torch.sigmoid(-distances().double() / wide) / wide
        found = density(distances().to(dtype)).double()
        require(torch.isfinite(found).all(), f"not finite at alpha {alpha:g}")
        worst = max(worst, float((found - true).abs().max() * wide))
    require(worst < PRECISIONS[dtype], f"off by {worst:.1e} of the largest density")
    return f"within {worst:.1e} of the largest density; alpha is never below {SMALLEST_ALPHA:g}"


def density_slopes() -> str:
    """Gradients where training could meet them: on the surface, and kilometres away."""
    for alpha in ALPHAS:
        density = density_at(alpha, torch.float32)
        place = torch.tensor([-1e4, -1.0, -1e-6, 0.0, 1e-6, 1.0, 1e4], requires_grad=True)
        density(place).sum().backward()
        slopes = [place.grad, density.p.grad]
        require(
            all(slope is not None and torch.isfinite(slope).all() for slope in slopes),
            f"a gradient is NaN or infinite at alpha {alpha:g}",
        )
    return "all gradients finite"


def ray(alpha: float, step: float, dtype: torch.dtype) -> tuple[Tensor, Tensor, Tensor]:
    """Mask, depth and a constant feature of one ray through a surface in its middle."""
    count = 48
    depth = step * (torch.arange(count, dtype=torch.float64) + 0.5)
    distance = (step * count / 2 - depth).to(dtype)
    length = step * torch.tensor([0.5, *[1] * (count - 1), 0.5]).to(dtype)
    samples = Samples(depth=depth.to(dtype)[None], length=length[None])
    features, far = torch.ones(1, count, 1, dtype=dtype), torch.full((1,), step * count, dtype=dtype)
    seen = composite(distance[None], features, samples, far, density_at(alpha, dtype))
    return seen.mask, seen.depth / (step * count), seen.features[:, 0]


@torch.no_grad()
def transmittances(dtype: torch.dtype) -> str:
    worst = 0.0
    for alpha in ALPHAS:
        for step in STEPS:
            for found, true in zip(ray(alpha, step, dtype), ray(alpha, step, torch.float64), strict=True):
                require(torch.isfinite(found).all(), f"not finite at alpha {alpha:g}, step {step:g}")
                worst = max(worst, float((found.double() - true).abs().max()))
            mask, _, feature = ray(alpha, step, torch.float64)
            require((mask - feature).abs().max() < 1e-9, "weights do not add up to the mask")
    require(worst < 5 * PRECISIONS[dtype], f"off by {worst:.1e}")
    return f"mask, depth and features within {worst:.1e}; weights add up to the mask"


def cases() -> list[Case]:
    """Every one ends in a right number."""
    found = []
    for dtype, name in ((torch.float32, "float32"), (torch.bfloat16, "bfloat16")):
        limit = PRECISIONS[dtype]
        found += [
            Case(
                name=f"density, alpha 1e-6 to 10, {name}",
                expected=f"finite, within {limit:.0e} of float64",
                check=lambda dtype=dtype: densities(dtype),
            ),
            Case(
                name=f"transmittance, steps 1e-6 to 10 m, {name}",
                expected=f"finite, within {5 * limit:.0e} of float64",
                check=lambda dtype=dtype: transmittances(dtype),
            ),
        ]
    found.append(
        Case(name="density's gradients, 10 km away", expected="finite gradients", check=density_slopes)
    )
    return found
