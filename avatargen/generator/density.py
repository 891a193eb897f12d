"""Signed distance to volume density with a learned sharpness (section 3.4)."""

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional as F

SMALLEST_ALPHA = 1e-4  # metres
FLAT = 1e-6  # widths of the transition; a distance that changes by less counts as changing by so much


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

    def between(
        self, first: Float[Tensor, "*batch"], last: Float[Tensor, "*batch"]
    ) -> Float[Tensor, "*batch"]:
        """Mean density where the distance goes linearly from `first` to `last`.

        Its integral over the distance is softplus(-d / alpha), so no transition is too sharp for it. Short
        of a width, the difference of two of these is log(1 + (e^change - 1) sigmoid(-last / alpha)), in which
        no digits cancel.
        """
        if self.representation == "density":
            return (self(first) + self(last)) / 2
        start, end = -first / self.alpha, -last / self.alpha
        change = start - end
        change = torch.where(change.abs() < FLAT, FLAT, change)
        short = change.clamp(-1, 1)
        area = torch.where(
            change.abs() < 1,
            torch.log1p(torch.expm1(short) * torch.sigmoid(end)),
            F.softplus(start) - F.softplus(end),
        )
        return area / (change * self.alpha)
