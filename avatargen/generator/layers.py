"""Layers shared by the generator's networks, with equalised learning rate (StyleGAN2).

A weight is stored with unit variance and scaled by 1 / sqrt(inputs) when used, so that one learning rate
suits every layer.
"""

import math
from contextlib import AbstractContextManager, nullcontext

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional as F

BRANCHING = {"cpu"}  # types of devices
LEAK = 0.2
ACTIVATION_GAIN = math.sqrt(2)  # keeps unit variance through the leaky ReLU


def leaky_relu(x: Float[Tensor, "*any"]) -> Float[Tensor, "*any"]:
    """Leaky ReLU that keeps the variance."""
    return F.leaky_relu(x, LEAK) * ACTIVATION_GAIN


def normalize_second_moment(x: Float[Tensor, "B D"]) -> Float[Tensor, "B D"]:
    """Scale each row to unit mean square."""
    return x * (x.square().mean(dim=1, keepdim=True) + 1e-8).rsqrt()


def may_branch(tensor: Tensor) -> bool:
    """Whether code may ask for a tensor's numbers and do only what they call for, as where nothing runs
    beside Python; elsewhere that would wait for all that is under way.
    """
    return tensor.device.type in BRANCHING


def without_autocast(device: torch.device) -> AbstractContextManager:
    """Operations keep their numbers' own precision: distances need all their digits."""
    return nullcontext() if device.type == "meta" else torch.autocast(device.type, enabled=False)


class EqualLinear(nn.Module):
    """Fully connected layer with equalised learning rate."""

    def __init__(
        self,
        inputs: int,
        outputs: int,
        *,
        bias: float = 0.0,
        learning_rate_multiplier: float = 1.0,
        zero: bool = False,
    ) -> None:
        super().__init__()
        start = (
            torch.zeros(outputs, inputs) if zero else torch.randn(outputs, inputs) / learning_rate_multiplier
        )
        self.weight = nn.Parameter(start)
        self.bias = nn.Parameter(torch.full((outputs,), bias / learning_rate_multiplier))
        self.bias_gain = learning_rate_multiplier
        self.weight_gain = learning_rate_multiplier / math.sqrt(inputs)

    def forward(self, x: Float[Tensor, "*batch inputs"]) -> Float[Tensor, "*batch outputs"]:
        return F.linear(x, self.weight * self.weight_gain, self.bias * self.bias_gain)


class ModulatedConv(nn.Module):
    """Convolution whose input channels are scaled per sample by a style, with demodulation (StyleGAN2,
    section 2.2).

    Scaling the input and output channels instead of the weights gives the same numbers and lets the whole
    batch share one dense convolution.
    """

    def __init__(
        self,
        inputs: int,
        outputs: int,
        w_size: int,
        *,
        kernel: int,
        demodulate: bool = True,
        zero: bool = False,
    ) -> None:
        super().__init__()
        self.style = EqualLinear(w_size, inputs, bias=1.0)
        size = (outputs, inputs, kernel, kernel)
        self.weight = nn.Parameter(torch.zeros(size) if zero else torch.randn(size))
        self.bias = nn.Parameter(torch.zeros(outputs))
        self.gain = 1 / math.sqrt(inputs * kernel**2)
        self.demodulate = demodulate

    def forward(self, x: Float[Tensor, "B i h v"], w: Float[Tensor, "B D"]) -> Float[Tensor, "B o h v"]:
        style = self.style(w)
        weight = self.weight * self.gain
        y = F.conv2d(x * style[:, :, None, None], weight, padding=weight.shape[-1] // 2)
        if not self.demodulate:
            return y + self.bias[:, None, None]
        power = style.square() @ weight.square().sum(dim=(2, 3)).T  # B o
        return torch.addcmul(self.bias[:, None, None], y, (power + 1e-8).rsqrt()[:, :, None, None])


def upsample(x: Float[Tensor, "B C h v"]) -> Float[Tensor, "B C h2 v2"]:
    """Twice the size by the FIR filter [1, 3, 3, 1]: bilinear interpolation with repeated borders."""
    return F.interpolate(x, scale_factor=2, mode="bilinear", align_corners=False)
