"""Tri-plane synthesis and its layers."""

from dataclasses import replace

import torch
from torch.nn import functional as F

from avatargen.generator.config import PRESETS, SynthesisConfig
from avatargen.generator.layers import EqualLinear, ModulatedConv, upsample
from avatargen.generator.synthesis import Synthesis


def test_modulated_convolution_is_that_of_modulated_weights():
    conv = ModulatedConv(5, 7, 4, kernel=3).double()
    x, w = torch.randn(3, 5, 8, 8).double(), torch.randn(3, 4).double()
    style = conv.style(w)
    expected = []
    for person in range(3):  # a person at a time, with weights of their own
        weight = conv.weight * conv.gain * style[person][:, None, None]
        weight = weight / (weight.square().sum(dim=(1, 2, 3), keepdim=True) + 1e-8).sqrt()
        expected.append(F.conv2d(x[person : person + 1], weight, conv.bias, padding=1))
    assert torch.allclose(conv(x, w), torch.cat(expected), atol=1e-12)


def test_demodulation_keeps_the_variance():
    conv = ModulatedConv(64, 64, 8, kernel=3)
    y = conv(torch.randn(8, 64, 16, 16), torch.randn(8, 8) * 5)
    assert 0.7 < y[..., 1:-1, 1:-1].std() < 1.3


def test_upsampling_is_the_fir_filter():
    x = torch.zeros(1, 1, 5, 5)
    x[0, 0, 2, 2] = 1
    taps = torch.tensor([1.0, 3, 3, 1]) / 4
    assert torch.allclose(upsample(x)[0, 0, 3:7, 3:7], torch.outer(taps, taps))
    assert upsample(torch.ones(1, 1, 4, 4)).allclose(torch.ones(1, 1, 8, 8))


def test_planes_have_the_shape_and_differ_between_people():
    for config in (PRESETS["debug"].synthesis, PRESETS["shipped"].synthesis):
        synthesis = Synthesis(config, 32)
        with torch.no_grad():
            planes = synthesis(torch.randn(2, 32))
        R = config.resolution
        assert planes.shape == (2, 3, config.plane_channels, R, R)
        assert torch.isfinite(planes).all()
        assert (planes[0] - planes[1]).std() > 0.1
        assert (planes[:, 0] - planes[:, 1]).std() > 0.1


def test_same_weights_and_w_give_the_same_planes_alone_or_in_a_batch():
    synthesis, w = Synthesis(PRESETS["debug"].synthesis, 32).double(), torch.randn(4, 32).double()
    assert torch.allclose(synthesis(w)[2:3], synthesis(w[2:3]), atol=1e-12)
    assert torch.equal(synthesis(w), synthesis(w))


def test_noise_is_fixed_and_starts_silent():
    quiet = PRESETS["debug"].synthesis
    synthesis = Synthesis(replace(quiet, noise=True), 32)
    w = torch.randn(1, 32)
    still = synthesis(w)
    for name, parameter in synthesis.named_parameters():
        if name.endswith("strength"):
            parameter.data.fill_(1.0)
    assert not torch.allclose(synthesis(w), still)
    assert torch.equal(synthesis(w), synthesis(w))


def test_every_parameter_gets_a_gradient():
    synthesis = Synthesis(SynthesisConfig(blocks=((4, 8), (8, 8)), plane_channels=4), 16)
    synthesis(torch.randn(3, 16)).square().sum().backward()
    assert all(p.grad is not None and p.grad.abs().max() > 0 for p in synthesis.parameters())


def test_learning_rate_multiplier_changes_speed_not_output_size():
    x = torch.randn(2000, 64)
    for multiplier in (1.0, 0.01):
        layer = EqualLinear(64, 32, learning_rate_multiplier=multiplier)
        assert 0.8 < layer(x).std() < 1.2
        assert abs(layer.weight.std().item() * multiplier - 1) < 0.1
