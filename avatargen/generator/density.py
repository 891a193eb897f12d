"""Signed distance to volume density with a learned sharpness (section 3.4)."""

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional as F

SMALLEST_ALPHA = 1e-4  # metres


class Density(nn.Module):
    """sigma = sigmoid(-d / alpha) / alpha, alpha = |p| + 1e-4: 1 / alpha deep inside, half on the surface."""

    def __init__(self, initial_alpha: float, representation: str = "sdf") -> None:
        super().__init__()
        self.representation = representation
        self.p = nn.Parameter(torch.tensor(initial_alpha - SMALLEST_ALPHA))

    @property
    def alpha(self) -> Float[Tensor, ""]:
        """Width of the transition in metres."""
        return self.p.abs() + SMALLEST_ALPHA

    def forward(self, distance: Float[Tensor, "*batch"]) -> Float[Tensor, "*batch"]:
        """Density per metre; finite for any finite distance.

        With representation `density` the number is no distance and the density has no upper limit.
        """
        alpha = self.alpha
        if self.representation == "density":
            return F.softplus(-distance / alpha) / alpha
        return torch.sigmoid(-distance / alpha) / alpha
