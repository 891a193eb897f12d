"""Ray casting against analytic answers, and against every ray asking every face."""

import numpy as np
import pytest
import trimesh

from avatargen.data.raycast import DEPTH_UNIT, GAMMA, Light, Shot, orbit_camera, random_light, shoot
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


def slow_shoot(
    vertices: np.ndarray, faces: np.ndarray, colors: np.ndarray, camera: Camera, light: Light, size: int
) -> Shot:
    """Two by two rays a pixel, each asked of every face: o + t d = a + v (b - a) + w (c - a)."""
    cam2world, intrinsics = camera.cam2world[0].double().numpy(), camera.intrinsics[0].double().numpy()
    centers = (np.arange(2 * size) + 0.5) / (2 * size)
    v, u = (part.ravel() for part in np.meshgrid(centers, centers, indexing="ij"))
    direction = np.stack([u, v, 0 * u + 1], axis=1) @ np.linalg.inv(intrinsics).T @ cam2world[:3, :3].T
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    origin = cam2world[:3, 3]
    corners = vertices[faces]
    a, b, c = corners.swapaxes(0, 1)
    sides = np.stack([b - a, c - a], axis=2)[None].repeat(len(direction), axis=0)  # P F 3 2
    back = -direction[:, None, :, None].repeat(len(faces), axis=1)
    found = np.linalg.solve(
        np.concatenate([sides, back], axis=3), np.broadcast_to(origin - a, sides.shape[:3])[..., None]
    )[..., 0]
    v, w, t = np.moveaxis(found, 2, 0)
    t = np.where((v >= 0) & (w >= 0) & (v + w <= 1) & (t > 0), t, np.inf)
    first, every = t.argmin(axis=1), np.arange(len(t))
    away, v, w = t[every, first], v[every, first], w[every, first]
    weights = np.stack([1 - v - w, v, w], axis=1)
    area = np.cross(b - a, c - a)
    normals = np.zeros_like(vertices)
    for f, face in enumerate(faces):
        normals[face] += area[f]
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    normal = np.einsum("pc,pcd->pd", weights, normals[faces[first]])
    facing = normal @ light.direction / np.linalg.norm(normal, axis=1)
    brightness = light.ambient + light.strength * np.clip((facing + 0.3) / 1.3, 0, 1)
    color = np.einsum("pc,pcd->pd", weights, colors[faces[first]].astype(np.float64))
    hit = np.isfinite(away)
    linear = np.where(hit[:, None], color.clip(0, 1) ** GAMMA * brightness[:, None], 1.0)
    blocks = hit.reshape(size, 2, size, 2)
    count = blocks.sum(axis=(1, 3))
    mean = linear.reshape(size, 2, size, 2, 3).mean(axis=(1, 3))
    far = np.where(hit, away, 0).reshape(size, 2, size, 2).sum(axis=(1, 3)) / np.maximum(count, 1)
    return Shot(
        image=np.rint(255 * np.clip(mean, 0, 1) ** (1 / GAMMA)).astype(np.uint8),
        mask=np.rint(255 * count / 4).astype(np.uint8),
        depth=(np.rint(far / DEPTH_UNIT).clip(0, 65535) * (count >= 2)).astype(np.uint16),
    )


@pytest.mark.parametrize("seed", [0, 1, 2, 3])
def test_every_ray_sees_what_it_sees_when_asked_of_every_face(seed: int):
    """Triangles that cross each other and lie before, around and behind the camera, seen from both sides."""
    rng = np.random.default_rng(seed)
    camera = orbit_camera(0.1, rng)
    centers = rng.normal(0, 0.5, (40, 1, 3))
    if seed > 1:
        centers[::3] += camera.cam2world[0, :3, 3].numpy()
    vertices = (centers + rng.normal(0, 0.3, (40, 3, 3))).reshape(-1, 3)
    faces = rng.permutation(len(vertices)).reshape(-1, 3) if seed % 2 else np.arange(120).reshape(-1, 3)
    faces = np.concatenate([faces, faces[:, [1, 2, 0]][:5]]).astype(np.int64)
    colors = rng.random((len(vertices), 3), dtype=np.float32)
    given = (vertices, faces, colors, camera, random_light(rng), 24)
    fast, slow = shoot(*given), slow_shoot(*given)

    assert (slow.mask > 0).mean() > 0.1
    assert np.array_equal(fast.mask, slow.mask)
    assert np.abs(fast.image.astype(int) - slow.image).max() <= 1
    assert np.abs(fast.depth.astype(int) - slow.depth).max() <= 1


def test_no_ray_passes_between_faces():
    """Of a wall of slivers and right angles that meet on the rays themselves."""
    x = np.concatenate([np.linspace(-4, 4, 33), np.linspace(-0.2, 0.2, 41)])
    columns = np.unique(np.concatenate([x, (np.arange(96) + 0.5 - 48) / 96 * 3.2 / 1.4]))
    u, v = np.meshgrid(columns, np.linspace(-4, 4, 7))
    vertices = np.stack([u, v, 0 * u], axis=-1).reshape(-1, 3)
    n, rows = len(columns), len(u)
    corner = (np.arange(rows - 1)[:, None] * n + np.arange(n - 1)).reshape(-1)
    faces = np.concatenate(
        [
            np.stack([corner, corner + 1, corner + n], axis=1),
            np.stack([corner + 1, corner + n + 1, corner + n], axis=1),
        ]
    )
    shot = shoot(vertices, faces, np.zeros((len(vertices), 3), np.float32), front_camera(), FLAT, 48)
    assert (shot.mask == 255).all() and (shot.image == 0).all()


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
