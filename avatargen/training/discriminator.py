"""The dual discriminator (section 3.5, after EG3D): judges the final picture and the raw one together,
knowing camera, pose and shape.

The raw picture, enlarged, is the second half of the input: a final picture that shows something else than the
geometry does is told from a real one, whose halves agree.

Letters: B pictures, S final size, r raw size, L length of a label.
"""

import itertools
import math
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional as F

from avatargen.errors import InputError
from avatargen.generator.layers import EqualLinear, leaky_relu, normalize_second_moment


@dataclass(frozen=True, kw_only=True)
class DiscriminatorConfig:
    """Channels by resolution are `capacity` / resolution, at most `channels`."""

    capacity: int = 1024
    channels: int = 128
    condition: int = 64  # width of the embedded label
    group: int = 4  # neighbouring pictures of a batch that are compared for variety

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if value < 1:
                raise InputError(f"discriminator config: {name} = {value}; give 1 or more")

    def width(self, resolution: int) -> int:
        return min(self.channels, self.capacity // resolution)


class EqualConv(nn.Module):
    """Convolution with equalised learning rate."""

    def __init__(self, inputs: int, outputs: int, kernel: int) -> None:
        super().__init__()
        self.weight = nn.Parameter(torch.randn(outputs, inputs, kernel, kernel))
        self.bias = nn.Parameter(torch.zeros(outputs))
        self.gain = 1 / math.sqrt(inputs * kernel**2)

    def forward(self, x: Float[Tensor, "B i h w"]) -> Float[Tensor, "B o h w"]:
        return F.conv2d(x, self.weight * self.gain, self.bias, padding=self.weight.shape[-1] // 2)


class Halving(nn.Module):
    """Residual block that halves the size."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.first = EqualConv(inputs, inputs, 3)
        self.second = EqualConv(inputs, outputs, 3)
        self.skip = EqualConv(inputs, outputs, 1)

    def forward(self, x: Float[Tensor, "B i h w"]) -> Float[Tensor, "B o h2 w2"]:
        y = leaky_relu(self.second(F.avg_pool2d(leaky_relu(self.first(x)), 2)))
        return (y + self.skip(F.avg_pool2d(x, 2))) * math.sqrt(0.5)


class Discriminator(nn.Module):
    """Logit of a picture being real, given its label."""

    def __init__(self, config: DiscriminatorConfig, *, size: int, label_size: int) -> None:
        super().__init__()
        self.config = config
        sizes = [size // 2**i for i in range(round(math.log2(size)) - 1)]  # down to 4
        self.enter = EqualConv(6, config.width(size), 1)
        self.blocks = nn.ModuleList(
            Halving(config.width(a), config.width(b)) for a, b in itertools.pairwise(sizes)
        )
        last = config.width(4)
        self.mix = EqualConv(last + 1, last, 3)
        self.hidden = EqualLinear(last * 16, last)
        self.judge = EqualLinear(last, config.condition)
        self.label = nn.ModuleList(
            [EqualLinear(label_size, config.condition), EqualLinear(config.condition, config.condition)]
        )

    def forward(
        self,
        image: Float[Tensor, "B 3 S S"],
        raw: Float[Tensor, "B 3 r r"],
        label: Float[Tensor, "B L"],
    ) -> Float[Tensor, " B"]:
        """Pictures are sRGB 0..1; `label` is camera, pose and betas in a row."""
        wide = F.interpolate(raw, size=image.shape[-2:], mode="bilinear", align_corners=False)
        both = torch.cat([image, wide], dim=1) * 2 - 1
        if both.is_cuda:  # the order in which its convolutions are fastest
            both = both.contiguous(memory_format=torch.channels_last)
        x = leaky_relu(self.enter(both))
        for block in self.blocks:
            x = block(x)
        x = torch.cat([x, variety(x, self.config.group)], dim=1)
        x = leaky_relu(self.hidden(leaky_relu(self.mix(x)).flatten(1)))
        enter, leave = self.label
        key = normalize_second_moment(leave(leaky_relu(enter(normalize_second_moment(label)))).float())
        return (self.judge(x) * key).sum(dim=1) / math.sqrt(self.config.condition)


def variety(x: Float[Tensor, "B C h w"], group: int) -> Float[Tensor, "B 1 h w"]:
    """Mean standard deviation within groups of neighbours (StyleGAN's minibatch standard deviation).

    Neighbours stay together when a batch is split over processes, so the split changes no number. In float32:
    where pictures agree, on the white beside people, 1e-8 keeps the root's slope finite, and is 0 in fp16.

    Raises:
        InputError: the batch is no whole number of groups.
    """
    B, _, h, w = x.shape
    if B % group:
        raise InputError(f"discriminator: {B} pictures are no whole number of groups of {group}")
    y = x.float().unflatten(0, (-1, group))
    deviation = (y.var(dim=1, unbiased=False) + 1e-8).sqrt().mean(dim=(1, 2, 3))
    return deviation.repeat_interleave(group)[:, None, None, None].expand(B, 1, h, w).to(x.dtype)
