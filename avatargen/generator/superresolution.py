"""Upsampling decoder (section 3.4): the rendered feature picture to the final one, in StyleGAN2-type blocks.

The colour is carried around the blocks: an untrained decoder gives the bilinear enlargement of the raw
colour. What else is to be enlarged so, a mask, may be carried with it.
"""

import itertools
import math

import torch
from jaxtyping import Float
from torch import Tensor, nn

from avatargen.generator.config import RenderConfig
from avatargen.generator.layers import ModulatedConv, upsample
from avatargen.generator.synthesis import Layer


class Upsampler(nn.Module):
    """Doubles the picture up to the final size; each step adds a learned correction to the colour."""

    def __init__(self, config: RenderConfig, *, features: int, w_size: int, carried: int = 3) -> None:
        super().__init__()
        self.carried = carried
        steps = round(math.log2(config.image_size / config.raw_size))
        widths = [features, *[config.upsampler_channels] * steps]
        self.enter = nn.ModuleList(Layer(i, o, w_size, 0, noise=False) for i, o in itertools.pairwise(widths))
        self.stay = nn.ModuleList(Layer(o, o, w_size, 0, noise=False) for o in widths[1:])
        self.color = nn.ModuleList(
            ModulatedConv(o, carried, w_size, kernel=1, demodulate=False, zero=True) for o in widths[1:]
        )

    def forward(
        self, features: Float[Tensor, "B K r r"], w: Float[Tensor, "B D"]
    ) -> Float[Tensor, "B C S S"]:
        """The final colour picture, nominally 0..1; `features` begin with the raw colour."""
        color = features[:, : self.carried]
        if features.is_cuda:  # the order in which its convolutions are fastest
            features = features.contiguous(memory_format=torch.channels_last)
        for enter, stay, correct in zip(self.enter, self.stay, self.color, strict=True):
            features = stay(enter(upsample(features), w), w)
            color = upsample(color) + correct(features, w)
        return color
