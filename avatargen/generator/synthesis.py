"""StyleGAN2-type synthesis of the three feature planes from w (section 3.2), in plain torch operations.

Letters: B people, D size of w, C channels, R resolution. Planes come in the order XY, YZ, XZ: the first axis
runs along columns, the second along rows.
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from avatargen.generator.config import SynthesisConfig
from avatargen.generator.layers import ModulatedConv, leaky_relu, upsample


class Layer(nn.Module):
    """3 x 3 modulated convolution, optional fixed noise, leaky ReLU."""

    noise: Tensor

    def __init__(self, inputs: int, outputs: int, w_size: int, resolution: int, *, noise: bool) -> None:
        super().__init__()
        self.conv = ModulatedConv(inputs, outputs, w_size, kernel=3)
        self.noisy = noise
        if noise:
            self.register_buffer("noise", torch.randn(resolution, resolution))
            self.strength = nn.Parameter(torch.zeros(()))

    def forward(self, x: Float[Tensor, "B i h h"], w: Float[Tensor, "B D"]) -> Float[Tensor, "B o h h"]:
        x = self.conv(x, w)
        return leaky_relu(x + self.strength * self.noise if self.noisy else x)


class Block(nn.Module):
    """One resolution: upsample (but the first), two layers, and this resolution's share of the planes."""

    def __init__(
        self, inputs: int, channels: int, resolution: int, outputs: int, w_size: int, *, noise: bool
    ) -> None:
        super().__init__()
        self.first = inputs == 0
        if not self.first:
            self.enter = Layer(inputs, channels, w_size, resolution, noise=noise)
        self.stay = Layer(channels, channels, w_size, resolution, noise=noise)
        self.share = ModulatedConv(channels, outputs, w_size, kernel=1, demodulate=False)

    def forward(
        self, x: Float[Tensor, "B i h h"], w: Float[Tensor, "B D"]
    ) -> tuple[Float[Tensor, "B o h2 h2"], Float[Tensor, "B p h2 h2"]]:
        if not self.first:
            x = self.enter(upsample(x), w)
        x = self.stay(x, w)
        return x, self.share(x, w)


class Synthesis(nn.Module):
    """w to tri-planes: a learned constant, blocks of doubling resolution, their shares summed."""

    def __init__(self, config: SynthesisConfig, w_size: int) -> None:
        super().__init__()
        self.config = config
        base, width = config.blocks[0]
        self.constant = nn.Parameter(torch.randn(width, base, base))
        inputs = [0, *[channels for _, channels in config.blocks]]
        self.blocks = nn.ModuleList(
            Block(i, channels, resolution, 3 * config.plane_channels, w_size, noise=config.noise)
            for i, (resolution, channels) in zip(inputs, config.blocks, strict=False)
        )

    def forward(
        self, w: Float[Tensor, "B D"], other: Float[Tensor, "B D"] | None = None, crossover: int = 0
    ) -> Float[Tensor, "B 3 C R R"]:
        """Planes of w; blocks from `crossover` on follow `other` where it is given (style mixing)."""
        x = self.constant.expand(len(w), -1, -1, -1)
        x = x.contiguous(memory_format=torch.channels_last)  # a third less time in all the layers that follow
        x, planes = self.blocks[0](x, w)
        for number, block in enumerate(list(self.blocks)[1:], start=1):
            x, share = block(x, w if other is None or number < crossover else other)
            planes = upsample(planes) + share
        return planes.unflatten(1, (3, self.config.plane_channels))
