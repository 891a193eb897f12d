"""Field decoder: starts as the body, matches a slow version, blends parts, passes gradients."""

import pytest
import torch

from avatargen.errors import InputError
from avatargen.generator.config import PRESETS
from avatargen.generator.decoder import Decoder, PartNetwork, attach_gradient, encode, interpolate
from avatargen.generator.generator import AvatarGenerator
from avatargen.generator.parts import Parts
from tests.generators import capsule_canonical, debug_config, points_near_body, random_generator

PARTS: Parts = (((0.0, 0.5, 0.0),), ((0.3, 0.0, 0.0), (-0.3, 0.0, 0.0)), ((0.0, -0.5, 0.0),))


def test_the_untrained_field_is_the_body():
    generator = AvatarGenerator(debug_config())
    points, body = points_near_body(500, people=2)
    w = torch.randn(2, 32)
    sdf, color, features = generator.field(generator.planes(w), generator.layers(w), points, body)

    assert torch.equal(sdf, body.distance)
    assert color.shape == (2, 500, 3)
    assert features.shape == (2, 500, 32)
    assert torch.equal(features[..., :3], color)
    assert -0.001 <= color.min() <= color.max() <= 1.001


def test_the_residual_keeps_its_limit():
    generator = random_generator(residual_scale=100.0, residual_limit=0.2, gated=False)
    points, body = points_near_body(500)
    w = torch.randn(1, 32)
    residual = generator.field(generator.planes(w), generator.layers(w), points, body)[0] - body.distance
    assert 0.1 < residual.abs().max() <= 0.2 + 1e-6


@pytest.mark.parametrize(("code_size", "parts"), [(8, PARTS), (8, ()), (0, PARTS), (0, ())])
def test_people_in_a_batch_are_people_alone(code_size: int, parts: Parts):
    generator = random_generator(code_size=code_size, parts=parts).double()
    points, body = points_near_body(64, people=3)
    points, w = points.double(), torch.randn(3, 32).double()
    planes = generator.planes(w)
    together = generator.field(planes, generator.layers(w), points, body)
    for person in range(3):
        one = slice(person, person + 1)
        alone_points, alone_body = points_near_body(64)
        alone = generator.field(planes[one], generator.layers(w[one]), alone_points.double(), alone_body)
        for whole, part in zip(together, alone, strict=True):
            assert torch.allclose(whole[one], part, atol=1e-9)


def test_layers_of_ones_own_are_a_switch():
    points, body = points_near_body(100, people=2)
    w, planes = torch.randn(2, 32), torch.zeros(2, 3, 8, 16, 16)
    for code_size in (8, 0):
        generator = random_generator(code_size=code_size)
        sdf = generator.field(planes, generator.layers(w), points, body)[0]
        alike = torch.equal(sdf[0], sdf[1])  # same planes: only their own layers can tell people apart
        assert alike == (code_size == 0)


def test_parts_are_blended_by_their_shares():
    decoder = random_generator(parts=PARTS).double().decoder
    points = torch.rand(2, 400, 3, dtype=torch.float64) * 2 - 1
    x = torch.randn(2, 400, inputs_of(decoder), dtype=torch.float64)
    layers = decoder.layers_of(torch.randn(2, 32).double())
    assert decoder.shares is not None
    share = decoder.shares(points)
    asked = zip(decoder.networks, layers, strict=True)
    every = torch.stack([network(x, own, "both") for network, own in asked], dim=-2)
    assert ((share > 0).sum(dim=-1) > 1).any()
    assert torch.allclose(decoder(x, points, layers), (every * share[..., None]).sum(dim=-2), atol=1e-12)
    assert decoder(x[:, :0], points[:, :0], layers).shape == (2, 0, 2 + decoder.config.features)


def test_points_of_one_part_and_the_colour_alone_are_no_different():
    decoder = random_generator(parts=PARTS).double().decoder
    points = torch.rand(1, 400, 3, dtype=torch.float64) * 2 - 1
    x = torch.randn(1, 400, inputs_of(decoder), dtype=torch.float64)
    layers = decoder.layers_of(torch.randn(1, 32).double())
    assert decoder.shares is not None
    alone = decoder.shares(points)[0, :, 0] == 1  # such chunks take a shorter way
    both = decoder(x, points, layers)
    assert 0 < alone.sum() < 400
    assert torch.allclose(decoder(x[:, alone], points[:, alone], layers), both[:, alone], atol=1e-12)
    for kept in (slice(None), alone):
        with torch.no_grad():
            color = decoder(x[:, kept], points[:, kept], layers, "color")
        assert torch.allclose(color, both[:, kept, 2:5], atol=1e-12)


def inputs_of(decoder: Decoder) -> int:
    """How many numbers the networks read at each point."""
    first = decoder.networks[0]
    assert isinstance(first, PartNetwork)
    return len(first.get_parameter("layers.0.weight"))


def test_the_bodys_distance_can_be_taken_back():
    generator = random_generator(residual_scale=0.0)
    network = generator.decoder.networks[0]
    with torch.no_grad():
        network.get_parameter("geometry.bias")[1] = 100.0
    points, body = points_near_body(300)
    w = torch.zeros(1, 32)
    sdf = generator.field(generator.planes(w), generator.layers(w), points, body)[0]
    assert sdf.abs().max() < 1e-6


def test_regions_give_a_point_one_of_the_persons_colours():
    generator = random_generator(regions=4)
    network = generator.decoder.networks[0]
    with torch.no_grad():
        for name in ("picture.weight", "picture.own.weight", "picture.own.bias", "palette.weight"):
            network.get_parameter(name).zero_()
        network.get_parameter("picture.bias").zero_()[-2] = 5.0  # the third region everywhere
        network.get_parameter("palette.bias").copy_(torch.linspace(-3, 3, 12))
    points, body = points_near_body(50)
    w = torch.zeros(1, 32)
    color = generator.field(generator.planes(w), generator.layers(w), points, body)[1]
    wanted = torch.sigmoid(torch.linspace(-3, 3, 12)[6:9]) * 1.002 - 0.001
    assert (color - wanted).abs().max() < 1e-5


def test_vertex_features_are_interpolated_at_the_closest_point():
    points, body = points_near_body(300)
    place = torch.from_numpy(capsule_canonical().vertices).double()
    closest = interpolate(place, body)[0]  # interpolating places gives the closest point
    distance = (points[0] - closest).norm(dim=-1)
    assert (distance - body.distance[0].abs()).abs().max() < 1e-5
    with pytest.raises(InputError, match="for_body"):
        AvatarGenerator(PRESETS["debug"])


def test_attached_gradient_is_that_of_the_distance():
    points, body = points_near_body(400, spread=0.02)
    points = points.clone().requires_grad_()
    vertices = torch.from_numpy(capsule_canonical().vertices)
    attached = attach_gradient(body, points, vertices[None])
    assert torch.equal(attached.distance.detach(), body.distance)
    (gradient,) = torch.autograd.grad(attached.distance.sum(), points)
    far = body.distance.abs() > 1e-3
    assert (gradient.norm(dim=-1)[far] - 1).abs().max() < 1e-3
    stepped = (
        points.detach() - body.distance[..., None] * gradient
    )  # Newton's step lands on the closest point
    closest = interpolate(vertices, body)
    assert (stepped - closest)[far].abs().max() < 1e-5


def test_encoding():
    points = torch.rand(2, 5, 3) * 2 - 1
    code = encode(points, 3)
    assert code.shape == (2, 5, 21)
    assert torch.equal(code[..., :3], points)
    assert torch.allclose(code[..., 6:9], torch.sin(2 * torch.pi * points), atol=1e-5)
    assert torch.allclose(code[..., 18:21], torch.cos(4 * torch.pi * points), atol=1e-5)


@pytest.mark.parametrize("activation", ["leaky_relu", "softplus"])
def test_everything_the_field_uses_gets_a_gradient(activation: str):
    generator = random_generator(activation=activation)
    points, body = points_near_body(200, people=2)
    w = generator.mapping(torch.randn(2, 16), torch.randn(2, 25))
    sdf, color, features = generator.field(generator.planes(w), generator.layers(w), points, body)
    (sdf.square().sum() + color.sum() + features.square().sum() + generator.betas(w).sum()).backward()
    used = [generator.mapping, generator.synthesis, generator.decoder, generator.shape]
    missing = [n for part in used for n, p in part.named_parameters() if p.grad is None or not p.grad.any()]
    assert missing == []


def test_the_gradient_of_the_field_can_be_penalised():
    """The eikonal term through plane features: a second derivative that grid_sample does not have."""
    generator = random_generator(activation="softplus")
    points, body = points_near_body(50)
    points, w = points.clone().requires_grad_(), torch.randn(1, 32)
    body = attach_gradient(body, points, torch.from_numpy(capsule_canonical().vertices)[None])
    sdf = generator.field(generator.planes(w), generator.layers(w), points, body, method="differentiable")[0]
    (slope,) = torch.autograd.grad(sdf.sum(), points, create_graph=True)
    (slope.norm(dim=-1) - 1).square().mean().backward()
    assert all(p.grad is not None for p in generator.synthesis.parameters() if p.ndim > 1)
