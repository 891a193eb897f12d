"""The generator as a whole: pictures of posed people."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from avatargen.body.distance import BodyDistance
from avatargen.body.model import pose, shape
from avatargen.body.pose import named_pose
from avatargen.generator.camera import Camera, front_camera, rays
from avatargen.generator.generator import AvatarGenerator
from avatargen.generator.picture import CanonicalSurface, take_picture
from tests.bodies import capsule_body
from tests.generators import debug_config, random_generator

BODY = capsule_body(0.04)


@pytest.fixture(scope="module")
def surface() -> CanonicalSurface:
    return CanonicalSurface(BODY)


def poses(*names: str) -> torch.Tensor:
    return torch.stack([torch.from_numpy(named_pose(name, BODY.joint_names)) for name in names])


def sharp_generator() -> AvatarGenerator:
    config = debug_config()
    render = replace(config.render, raw_size=32, image_size=64, samples=64, initial_alpha=2e-3, shell=0.1)
    return AvatarGenerator(replace(config, render=render))


def deepest(camera: Camera, vertices: np.ndarray, size: int) -> torch.Tensor:
    """The smallest signed distance to a mesh along each pixel's ray, by dense sampling."""
    origin, direction = rays(camera, size)
    points = origin[0, :, None] + direction[0, :, None] * torch.linspace(2.7, 3.7, 300)[:, None]
    distance = BodyDistance(vertices, BODY.faces).query(points.reshape(-1, 3).numpy()).distance
    return torch.from_numpy(distance).reshape(size * size, 300).amin(dim=1).reshape(size, size)


@torch.no_grad()
def test_an_untrained_picture_is_the_posed_body(surface: CanonicalSurface):
    generator = sharp_generator()
    pose_of = poses("a")
    pose_of[0, 4, 0] = 0.9  # a bent knee
    low = torch.tensor([[0.0, -0.8, 0.0]])  # the capsule figure stands on y = 0; bring it before the camera
    picture = take_picture(generator, surface, torch.randn(1, 16), lowered(low), pose_of, torch.zeros(1, 10))

    posed = pose(BODY, shape(BODY, np.zeros(10)), pose_of[0].numpy(), low[0].numpy())
    depth = deepest(front_camera(), posed.vertices, 32)
    assert (picture.mask[0][depth < -0.02] > 0.95).all()
    assert (picture.mask[0][depth > 0.03] < 0.01).all()
    along = -rays(front_camera(), 32)[1][0, :, 2].unflatten(0, (32, 32))
    before = (picture.depth[0] * along)[
        picture.mask[0] > 0.99
    ]  # 3.2 m before the camera; the bent shin is farther
    assert 3.0 < before.min() < before.max() < 3.5
    assert (picture.raw[0, :, picture.mask[0] == 0] == 1).all()  # white behind


def lowered(step: torch.Tensor) -> Camera:
    """The front camera, moved so that the world appears moved by `step`."""
    camera = front_camera()
    cam2world = camera.cam2world.clone()
    cam2world[:, :3, 3] -= step
    return replace(camera, cam2world=cam2world)


def test_pictures_are_the_same_twice_and_alone(surface: CanonicalSurface):
    generator, z = random_generator(), torch.randn(2, 16)
    args = poses("t", "a"), torch.zeros(2, 10)
    with torch.no_grad():
        first = take_picture(generator, surface, z, front_camera(2), *args)
        again = take_picture(generator, surface, z, front_camera(2), *args)
        alone = take_picture(generator, surface, z[1:], front_camera(), args[0][1:], args[1][1:])
    assert torch.equal(first.image, again.image)
    assert torch.allclose(first.image[1:], alone.image, rtol=1e-3, atol=1e-3)
    assert first.image.shape == (2, 3, 16, 16)
    assert first.raw.shape == (2, 3, 8, 8)


def test_every_parameter_learns_from_a_picture(surface: CanonicalSurface):
    generator = random_generator()
    generator.density.p.data.fill_(0.05)
    camera = lowered(torch.tensor([[0.0, -0.8, 0.0]]))
    seeds = torch.zeros(1, dtype=torch.long)
    picture = take_picture(
        generator, surface, torch.randn(1, 16), camera, poses("a"), torch.zeros(1, 10), seeds
    )
    (picture.image.square().mean() + picture.raw.square().mean()).backward()
    idle = [n for n, p in generator.named_parameters() if p.grad is None or not torch.isfinite(p.grad).all()]
    assert [name for name in idle if not name.startswith("shape.")] == []  # betas are given to a picture


def test_betas_stay_within_their_limit():
    generator = random_generator()
    betas = generator.betas(torch.randn(100, 32) * 100)
    assert betas.shape == (100, 10)
    assert 2.9 < betas.abs().max() <= 3
    assert not AvatarGenerator(debug_config()).betas(torch.randn(2, 32)).any()  # starts at the mean shape
