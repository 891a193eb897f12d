"""Signed distance to volume density with a learned sharpness (section 3.4)."""

import torch
from jaxtyping import Float
from torch import Tensor, nn

SMALLEST_ALPHA = 1e-4  # metres


class Density(nn.Module):
    """sigma = sigmoid(-d / alpha) / alpha, alpha = |p| + 1e-4: 1 / alpha deep inside, half on the surface."""

    def __init__(self, initial_alpha: float) -> None:
        super().__init__()
        self.p = nn.Parameter(torch.tensor(initial_alpha - SMALLEST_ALPHA))

    @property
    def alpha(self) -> Float[Tensor, ""]:
        """Width of the transition in metres."""
        return self.p.abs() + SMALLEST_ALPHA

    def forward(self, distance: Float[Tensor, "*batch"]) -> Float[Tensor, "*batch"]:
        """Density per metre; finite for any finite distance."""
        alpha = self.alpha
        return torch.sigmoid(-distance / alpha) / alpha
