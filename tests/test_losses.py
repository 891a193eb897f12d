"""The losses of the training, against analytic answers; the slope's way to the planes in float64."""

from dataclasses import replace

import pytest
import torch
from torch.autograd import gradcheck, gradgradcheck

from avatargen.errors import InputError
from avatargen.generator.config import GeometryConfig
from avatargen.generator.generator import AvatarGenerator
from avatargen.generator.picture import CanonicalSurface, People, make_people
from avatargen.training.discriminator import Discriminator, DiscriminatorConfig, variety
from avatargen.training.losses import (
    discriminator_loss,
    distance_and_slope,
    generator_loss,
    geometry_losses,
    r1_penalty,
)
from tests.bodies import capsule_body
from tests.generators import debug_config, random_generator

SURFACE = CanonicalSurface(capsule_body(0.04))


def people_of(generator: AvatarGenerator) -> People:
    w = torch.randn(2, 32, generator=torch.Generator().manual_seed(0)).to(generator.density.p)
    poses = torch.zeros(2, 24, 3).to(w)
    poses[:, 16, 2] = -0.6
    return make_people(generator, SURFACE, w, generator.planes(w), poses, torch.zeros(2, 10).to(w))


SEEDS = torch.arange(2)


def test_an_untrained_field_is_the_body_and_loses_nothing_by_it():
    generator = AvatarGenerator(debug_config())
    losses = geometry_losses(generator, people_of(generator), 300, SEEDS)
    assert float(losses.eikonal.detach()) < 0.03  # creases of the skinning
    assert float(losses.smpl.detach()) < 1e-4  # metres
    assert 0.05 < float(losses.minimal_surface.detach()) < 0.6


def test_a_shifted_field_costs_its_shift_and_never_explodes_inside():
    generator = AvatarGenerator(debug_config())
    with torch.no_grad():
        # half a metre inside, as far as the limit allows
        generator.decoder.get_parameter("networks.0.geometry.bias")[0] = -5.0
    people = people_of(generator)
    losses = geometry_losses(generator, people, 100, SEEDS)
    expected = 0.5 * torch.tanh(torch.tensor(5.0 * 0.1 / 0.5))
    assert float(losses.smpl.detach()) == pytest.approx(float(expected), rel=1e-3)
    assert float(losses.minimal_surface.detach()) < 1e-6


def test_density_has_no_geometry_losses():
    generator = AvatarGenerator(replace(debug_config(), geometry=GeometryConfig(representation="density")))
    losses = geometry_losses(generator, people_of(generator), 10, SEEDS)
    assert [float(value) for value in vars(losses).values()] == [0.0, 0.0, 0.0]


def test_the_slope_reaches_the_planes_by_gradcheck_in_float64():
    """The penalty on the slope, differentiated by the features of the planes, once and twice."""
    generator = random_generator().double()
    one = people_of(generator).parts[0]
    with torch.no_grad():
        generator.decoder.get_parameter("networks.0.geometry.weight").mul_(0.1)
    points = one.posed.vertices[:, ::200].double() + 0.01

    def penalty(planes: torch.Tensor) -> torch.Tensor:
        _, slope = distance_and_slope(generator, replace(one, planes=planes), points)
        return (slope - 1).square().mean()

    planes = one.planes.detach()[:, :, :, 4:8, 4:8].clone().requires_grad_()
    assert penalty(planes).dtype == torch.float64
    assert gradcheck(penalty, (planes,), nondet_tol=1e-12, fast_mode=True)
    assert gradgradcheck(penalty, (planes,), nondet_tol=1e-12, fast_mode=True)
    (gradient,) = torch.autograd.grad(penalty(planes), planes)
    assert gradient.abs().max() > 1e-6


def test_the_eikonal_loss_moves_the_synthesis():
    generator = random_generator()
    losses = geometry_losses(generator, people_of(generator), 50, SEEDS)
    losses.eikonal.backward()
    assert generator.synthesis.constant.grad is not None
    assert generator.synthesis.constant.grad.abs().max() > 0


def test_adversarial_losses_are_the_log_probabilities():
    fake, real = torch.tensor([0.3, -2.0]), torch.tensor([1.0, 40.0])
    assert torch.allclose(generator_loss(fake), -torch.sigmoid(fake).log().mean())
    plain = -(1 - torch.sigmoid(fake)).log().mean() - torch.sigmoid(real).log().mean()
    assert torch.allclose(discriminator_loss(fake, real), plain)
    assert torch.isfinite(discriminator_loss(torch.tensor([200.0]), torch.tensor([-200.0])))


def small(group: int = 2) -> Discriminator:
    torch.manual_seed(0)
    config = DiscriminatorConfig(capacity=64, channels=8, condition=8, group=group)
    return Discriminator(config, size=16, label_size=5)


def test_r1_is_half_the_squared_slope_at_both_pictures():
    network = small(group=1).double()
    image, raw, label = (torch.rand(shape).double() for shape in ((2, 3, 16, 16), (2, 3, 8, 8), (2, 5)))
    slopes = []
    for i in range(2):
        one = [image[i : i + 1].clone().requires_grad_(), raw[i : i + 1].clone().requires_grad_()]
        grads = torch.autograd.grad(network(*one, label[i : i + 1]).sum(), one)
        slopes.append(sum(float(g.square().sum()) for g in grads))
    penalty = r1_penalty(network, image, raw, label)
    assert float(penalty.detach()) == pytest.approx(sum(slopes) / 2 / 2, rel=1e-9)
    penalty.backward()
    assert network.enter.weight.grad is not None and network.enter.weight.grad.abs().max() > 0


def test_the_discriminator_reads_both_pictures_and_the_label():
    network = small()
    image, raw, label = torch.rand(4, 3, 16, 16), torch.rand(4, 3, 8, 8), torch.randn(4, 5)
    logits = network(image, raw, label)
    assert logits.shape == (4,)
    for other in (
        network(1 - image, raw, label),
        network(image, 1 - raw, label),
        network(image, raw, -label),
    ):
        assert (logits - other).abs().max() > 1e-4
    flat = torch.full((1, 3, 16, 16), 0.2), torch.full((1, 3, 8, 8), 0.2), label[:1]
    assert network(*(part.expand(4, *part.shape[1:]) for part in flat)).std() < 1e-6


def test_variety_is_that_of_the_group_and_batches_must_fit():
    x = torch.randn(6, 3, 4, 4)
    own = variety(x, 2)
    assert torch.allclose(torch.cat([variety(x[:2], 2), variety(x[2:], 2)]), own)
    assert own[0, 0, 0, 0] == own[1, 0, 0, 0] != own[2, 0, 0, 0]
    assert variety(x[:1].expand(2, -1, -1, -1), 2).max() < 1e-3
    with pytest.raises(InputError, match="groups of 4"):
        variety(x, 4)
