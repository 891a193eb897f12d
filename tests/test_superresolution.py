"""Upsampling decoder."""

import torch
from torch.nn import functional as F

from avatargen.generator.config import RenderConfig
from avatargen.generator.superresolution import Upsampler
from tests.generators import randomize


def test_untrained_it_is_bilinear_enlargement_of_the_raw_colour():
    upsampler = Upsampler(
        RenderConfig(raw_size=8, image_size=16, upsampler_channels=8), features=12, w_size=6
    )
    features, w = torch.rand(2, 12, 8, 8), torch.randn(2, 6)
    expected = F.interpolate(features[:, :3], scale_factor=2, mode="bilinear", align_corners=False)
    assert torch.equal(upsampler(features, w), expected)


def test_sizes_and_gradients():
    for steps in (0, 1, 2):
        config = RenderConfig(raw_size=8, image_size=8 * 2**steps, upsampler_channels=8)
        upsampler = Upsampler(config, features=12, w_size=6)
        randomize(upsampler)
        image = upsampler(torch.rand(2, 12, 8, 8), torch.randn(2, 6))
        assert image.shape == (2, 3, 8 * 2**steps, 8 * 2**steps)
        if steps:
            image.square().sum().backward()
            assert all(p.grad is not None and p.grad.any() for p in upsampler.parameters())
