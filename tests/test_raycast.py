"""Ray casting against analytic answers."""

import numpy as np
import pytest
import trimesh

from avatargen.data.raycast import DEPTH_UNIT, Light, Shot, orbit_camera, random_light, shoot
from avatargen.generator.camera import Camera, front_camera, rays

RADIUS = 0.5
FLAT = Light(ambient=1.0, direction=np.array([0.0, 1.0, 0.0]), strength=0.0)


def ball(center: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> tuple[np.ndarray, np.ndarray]:
    sphere = trimesh.creation.icosphere(subdivisions=5, radius=RADIUS)
    return np.asarray(sphere.vertices) + center, np.asarray(sphere.faces).astype(np.int64)


def picture(camera: Camera, light: Light = FLAT, size: int = 48) -> Shot:
    vertices, faces = ball()
    color = np.full((len(vertices), 3), (0.8, 0.4, 0.2), dtype=np.float32)
    return shoot(vertices, faces, color, camera, light, size)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_ball_is_seen_where_and_how_far_it_is(seed: int):
    camera = orbit_camera(0.1, np.random.default_rng(seed))
    shot = picture(camera)
    origin, direction = (r[0].double().numpy() for r in rays(camera, 48))
    along = -np.einsum("pd,pd->p", origin, direction)
    miss = np.linalg.norm(origin + along[:, None] * direction, axis=1).reshape(48, 48)
    depth = along.reshape(48, 48) - np.sqrt(np.maximum(RADIUS**2 - miss**2, 0))

    assert (shot.mask[miss < RADIUS - 0.05] == 255).all() and (shot.mask[miss > RADIUS + 0.05] == 0).all()
    inner = miss < 0.8 * RADIUS
    assert np.abs(shot.depth * DEPTH_UNIT - depth)[inner].max() < 4e-3  # 2 x 2 rays a pixel, and facets
    assert (shot.depth[miss > RADIUS + 0.05] == 0).all()
    assert np.abs(shot.image[inner].astype(int) - np.rint(np.array([0.8, 0.4, 0.2]) * 255)).max() <= 1
    assert (shot.image[miss > RADIUS + 0.05] == 255).all()


def test_the_lit_side_is_brighter():
    light = Light(ambient=0.5, direction=np.array([1.0, 0.0, 0.0]), strength=0.5)
    shot = picture(front_camera(), light)
    assert shot.image[24, 30].mean() > shot.image[24, 17].mean() + 20  # x grows to the right from the front


def test_cameras_stand_upright_around_and_see_the_axis():
    rng, yaws = np.random.default_rng(0), []
    for _ in range(200):
        camera = orbit_camera(0.2, rng)
        R, eye = camera.cam2world[0, :3, :3].numpy(), camera.cam2world[0, :3, 3].numpy()
        assert np.abs(R @ R.T - np.eye(3)).max() < 1e-6 and np.linalg.det(R) > 0
        assert R[1, 1] < -0.8 and abs(R[1, 0]) < 1e-6  # y points down in the picture, x is level
        beside = np.cross(np.array([0, 0.2, 0]) - eye, R[:, 2])
        assert np.linalg.norm(beside) < 0.2  # the optical axis passes the person's
        yaws.append(np.arctan2(eye[0], eye[2]))
    assert np.histogram(yaws, bins=4, range=(-np.pi, np.pi))[0].min() > 25


def test_light_comes_from_above_and_does_not_overexpose():
    rng = np.random.default_rng(0)
    for _ in range(50):
        light = random_light(rng)
        assert light.direction[1] > 0 and np.linalg.norm(light.direction) == pytest.approx(1)
        assert light.ambient + light.strength <= 1.06
