"""Small generators on the capsule figure, for tests."""

import functools
from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor, nn

from avatargen.body.distance import BodyDistance
from avatargen.body.model import CanonicalBody, canonical_body
from avatargen.generator.config import PRESETS, GeneratorConfig, for_body
from avatargen.generator.decoder import BodyPoints, body_points, fit_reach
from avatargen.generator.generator import AvatarGenerator
from tests.bodies import capsule_body


@functools.cache
def capsule_canonical() -> CanonicalBody:
    return canonical_body(capsule_body(0.04))


@functools.cache
def capsule_distance() -> BodyDistance:
    return BodyDistance(capsule_canonical().vertices, capsule_canonical().faces)


def debug_config(**decoder: object) -> GeneratorConfig:
    """The debug preset on the capsule figure, with some of the decoder's settings changed."""
    config = for_body(PRESETS["debug"], capsule_canonical())
    return replace(config, decoder=replace(config.decoder, **decoder))  # pyright: ignore[reportArgumentType]


def random_generator(seed: int = 0, **decoder: object) -> AvatarGenerator:
    """A debug generator in which every parameter is random: nothing rests at a zero start."""
    generator = AvatarGenerator(debug_config(**decoder))
    fit_reach(generator.decoder, capsule_canonical())
    randomize(generator, seed)
    return generator


def randomize(module: nn.Module, seed: int = 0) -> None:
    draw = torch.Generator().manual_seed(seed)
    with torch.no_grad():
        for parameter in module.parameters():
            parameter.copy_(torch.randn(parameter.shape, generator=draw) * 0.5)


def points_near_body(
    count: int, people: int = 1, spread: float = 0.03
) -> tuple[Float[Tensor, "B N 3"], BodyPoints]:
    """Points around the capsule figure, the same for each person, and what the field needs of the body."""
    body, draw = capsule_canonical(), torch.Generator().manual_seed(0)
    chosen = torch.randint(len(body.vertices), (count,), generator=draw)
    points = torch.from_numpy(body.vertices)[chosen] + torch.randn(count, 3, generator=draw) * spread
    one = body_points(capsule_distance().query(points.numpy()), torch.from_numpy(body.faces))
    repeated = BodyPoints(
        distance=one.distance.expand(people, -1),
        vertices=one.vertices.expand(people, -1, -1),
        barycentric=one.barycentric.expand(people, -1, -1),
    )
    return points.expand(people, -1, -1), repeated
