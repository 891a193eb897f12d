"""The shell around a body: nothing within reach is left out, and samples measure the length within it."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.spatial import KDTree

from avatargen.errors import InputError
from avatargen.generator.camera import front_camera, rays
from avatargen.generator.config import GEOMETRY_CHOICES, GeometryConfig
from avatargen.generator.generator import AvatarGenerator
from avatargen.generator.picture import CanonicalSurface, make_people, picture_people
from avatargen.generator.renderer import Samples
from avatargen.generator.shell import CELL, Shell, shell_around, shell_samples
from tests.bodies import capsule_body
from tests.generators import capsule_canonical, debug_config

REACH = 0.1
VERTICES = capsule_canonical().vertices
BODIES = torch.from_numpy(VERTICES)[None]
DOWN = torch.tensor([0.0, 0.8, 0.0])  # the capsule figure stands on y = 0; look at its middle


def rays_at_body(size: int) -> tuple[torch.Tensor, torch.Tensor]:
    origin, direction = (r[0] for r in rays(front_camera(), size))
    return origin + DOWN, direction


def samples_of(
    shell: Shell, origin: torch.Tensor, direction: torch.Tensor, count: int, seeds: torch.Tensor | None = None
) -> tuple[Samples, torch.Tensor]:
    """Of one person."""
    samples, far = shell_samples(shell, origin[None], direction[None], count, seeds)
    return Samples(depth=samples.depth[0], length=samples.length[0]), far[0]


def test_every_point_within_reach_is_in_the_shell_and_far_ones_are_not():
    shell, rng = shell_around(BODIES, REACH), np.random.default_rng(0)
    points = rng.uniform(VERTICES.min(0) - 0.4, VERTICES.max(0) + 0.4, size=(20_000, 3))
    away = KDTree(VERTICES).query(points)[0]
    held = shell.holds(torch.from_numpy(points.astype(np.float32))[None])[0].numpy()
    assert held[away < REACH].all()
    assert not held[away > REACH + 2 * np.sqrt(3) * CELL].any()


def test_samples_are_equally_dense_in_the_shell_and_nowhere_else():
    shell, (origin, direction) = shell_around(BODIES, REACH), rays_at_body(24)
    samples, far = samples_of(shell, origin, direction, 16, torch.tensor([3]))
    dense = torch.linspace(2.0, 4.5, 2501)
    held = shell.holds((origin[:, None] + dense[:, None] * direction[:, None])[None])[0]
    length = held.sum(dim=1) * 0.001  # metres
    hit = samples.length.any(dim=1)

    assert 20 < hit.sum() < 400 and (length[~hit] < 0.03).all()
    error = (samples.length.sum(dim=1) - length)[hit].abs()
    assert error.max() < 0.1  # as fine as a piece of the ray at each end
    assert error.mean() < 0.02
    assert (torch.diff(samples.depth[hit], dim=1) > -1e-6).all()
    assert (samples.depth[hit] < far[hit, None]).all()
    points = origin[hit, None] + samples.depth[hit, :, None] * direction[hit, None]
    assert shell.holds(points[None]).float().mean() > 0.95  # a piece is marked by its middle


def test_the_middles_of_bins_need_no_draw():
    shell, (origin, direction) = shell_around(BODIES, REACH), rays_at_body(8)
    first, again = (samples_of(shell, origin, direction, 5)[0].depth for _ in range(2))
    assert torch.equal(first, again)


def picture(geometry: GeometryConfig, **render: object):
    config = debug_config(**({"vertex_features": 0} if geometry.prior == "none" else {}))
    settings = {"raw_size": 16, "image_size": 16, "samples": 24, "initial_alpha": 0.004} | render
    config = replace(config, geometry=geometry, render=replace(config.render, **settings))  # pyright: ignore
    torch.manual_seed(0)
    generator = AvatarGenerator(config)
    surface, w = CanonicalSurface(capsule_body(0.04)), torch.randn(1, 32)
    poses, betas = torch.zeros(1, 24, 3), torch.zeros(1, 10)
    people = make_people(generator, surface, w, generator.planes(w), poses, betas)
    camera = front_camera()
    camera.cam2world[:, :3, 3].add_(DOWN)
    return generator, picture_people(generator, people, camera, None)


def test_few_samples_in_the_shell_see_what_many_see():
    with torch.no_grad():
        few = picture(GeometryConfig(), samples=24, shell=0.08)[1]
        many = picture(GeometryConfig(), samples=300, shell=0.2)[1]
    assert (few.mask - many.mask).abs().mean() < 0.02
    both = (few.mask > 0.95) & (many.mask > 0.95)
    assert both.sum() > 15
    assert (few.depth - many.depth)[both].abs().median() < 0.01


@pytest.mark.parametrize(
    ("name", "value"), [(name, value) for name, choices in GEOMETRY_CHOICES.items() for value in choices]
)
def test_every_choice_of_table_2_renders_and_learns(name: str, value: str):
    choice = {"distance": "raw"} if value == "none" else {}
    generator, seen = picture(GeometryConfig(**{name: value, **choice}))
    assert torch.isfinite(seen.image).all() and seen.mask.max() > 0.2
    seen.raw.square().mean().backward()
    slopes = {n: p.grad.abs().max() for n, p in generator.named_parameters() if p.grad is not None}
    assert all(torch.isfinite(slope) for slope in slopes.values())
    assert slopes["decoder.networks.0.geometry.weight"] > 0
    assert ("deformation.leave.weight" in slopes) == (value != "inverse_skinning")


def test_choices_that_are_none_or_do_not_fit_are_refused():
    with pytest.raises(InputError, match="choose sdf, density"):
        GeometryConfig(representation="mesh")
    with pytest.raises(InputError, match="distance raw"):
        GeometryConfig(prior="none")
    with pytest.raises(InputError, match="vertex features"):
        replace(debug_config(), geometry=GeometryConfig(prior="none", distance="raw"))
