"""Layers of fields: a place as waves, and modulated layers without neighbours.

Letters: B pictures, N points, D size of w, L frequencies.
"""

import math

import torch
from jaxtyping import Float
from torch import Tensor, nn

from avatargen.generator.layers import EqualLinear, leaky_relu


def waves(x: Float[Tensor, "*batch d"], frequencies: int) -> Float[Tensor, "*batch e"]:
    """The numbers themselves, and their sines and cosines at pi, 2 pi, 4 pi ... (NeRF, equation 4)."""
    scale = math.pi * 2.0 ** torch.arange(frequencies, device=x.device, dtype=x.dtype)
    angle = (x[..., None] * scale).flatten(-2)
    return torch.cat([x, torch.sin(angle), torch.cos(angle)], dim=-1)


def wave_count(dimensions: int, frequencies: int) -> int:
    """How many numbers `waves` makes."""
    return dimensions * (1 + 2 * frequencies)


class ModulatedLinear(nn.Module):
    """A 1 x 1 modulated convolution on points in any order: inputs are scaled by a style, outputs
    demodulated (StyleGAN2, section 2.2).
    """

    def __init__(
        self, inputs: int, outputs: int, w_size: int, *, demodulate: bool = True, zero: bool = False
    ) -> None:
        super().__init__()
        self.style = EqualLinear(w_size, inputs, bias=1.0)
        size = (outputs, inputs)
        self.weight = nn.Parameter(torch.zeros(size) if zero else torch.randn(size))
        self.bias = nn.Parameter(torch.zeros(outputs))
        self.gain = 1 / math.sqrt(inputs)
        self.demodulate = demodulate

    def forward(self, x: Float[Tensor, "B N i"], w: Float[Tensor, "B D"]) -> Float[Tensor, "B N o"]:
        style = self.style(w)
        weight = self.weight * self.gain
        y = torch.nn.functional.linear(x * style[:, None], weight)
        if not self.demodulate:
            return y + self.bias
        power = style.square() @ weight.square().T  # B o
        return torch.addcmul(self.bias, y, (power + 1e-8).rsqrt()[:, None])


class StyledLayer(ModulatedLinear):
    """The same with a leaky ReLU."""

    def forward(self, x: Float[Tensor, "B N i"], w: Float[Tensor, "B D"]) -> Float[Tensor, "B N o"]:
        return leaky_relu(super().forward(x, w))
