"""Pictures of a coloured mesh by ray casting (embree), for training data with exact depth and mask.

Letters: V vertices, F faces, S pixels a side, P rays. Metres; cameras as in `avatargen.generator.camera`.
"""

from dataclasses import dataclass

import numpy as np
import torch
from embreex import rtcore_scene
from embreex.mesh_construction import TriangleMesh
from jaxtyping import Float, Float32, Int64, UInt8, UInt16

from avatargen.data.units import DEPTH_UNIT
from avatargen.generator.camera import Camera, rays

OVERSAMPLING = 2
GAMMA = 2.2


@dataclass(frozen=True, kw_only=True)
class Light:
    """Light from all around and from one side, linear, adding up to about 1 on a surface that faces it."""

    ambient: float
    direction: Float[np.ndarray, "3"]  # unit, from the surface to the lamp
    strength: float


@dataclass(frozen=True, kw_only=True)
class Shot:
    """What the camera saw: colour on white, coverage, and distance along the ray (0 beside the person)."""

    image: UInt8[np.ndarray, "S S 3"]
    mask: UInt8[np.ndarray, "S S"]
    depth: UInt16[np.ndarray, "S S"]  # in steps of DEPTH_UNIT; where at least half the pixel is covered


def random_light(rng: np.random.Generator) -> Light:
    """Soft light, the lamp anywhere above."""
    direction = rng.normal(size=3)
    direction[1] = abs(direction[1]) + 0.3
    ambient = rng.uniform(0.5, 0.75)
    return Light(ambient=ambient, direction=direction / np.linalg.norm(direction), strength=1.05 - ambient)


def shoot(
    vertices: Float[np.ndarray, "V 3"],
    faces: Int64[np.ndarray, "F 3"],
    colors: Float32[np.ndarray, "V 3"],
    camera: Camera,
    light: Light,
    size: int,
) -> Shot:
    """A picture of `size` pixels a side, each the mean of 2 x 2 rays in linear light."""
    fine = size * OVERSAMPLING
    origin, direction = (r[0].numpy().astype(np.float32) for r in rays(camera, fine))
    asked = np.flatnonzero(in_frame(vertices, camera, fine))
    scene = rtcore_scene.EmbreeScene()  # pyright: ignore[reportAttributeAccessIssue]
    TriangleMesh(scene, vertices.astype(np.float32), faces.astype(np.int32))
    found = scene.run(np.ascontiguousarray(origin[asked]), np.ascontiguousarray(direction[asked]), output=1)
    hit = found["primID"] >= 0
    rows, corner = asked[hit], faces[found["primID"][hit]]
    u, v = found["u"][hit], found["v"][hit]
    barycentric = np.stack([1 - u - v, u, v], axis=1)
    color = np.einsum("pc,pcd->pd", barycentric, colors[corner])
    normal = np.einsum("pc,pcd->pd", barycentric, vertex_normals(vertices, faces)[corner])
    picture, depth = np.ones((fine * fine, 3)), np.zeros(fine * fine)
    picture[rows] = np.clip(color, 0, 1) ** GAMMA * brightness(normal, light)[:, None]
    depth[rows] = found["tfar"][hit]
    return develop(picture, depth, size)


def in_frame(vertices: Float[np.ndarray, "V 3"], camera: Camera, size: int) -> np.ndarray:
    """[size * size] bool: pixels within the box around the person; the other rays need no casting."""
    T_camera_world = np.linalg.inv(camera.cam2world[0].double().numpy())
    seen = vertices @ T_camera_world[:3, :3].T + T_camera_world[:3, 3]
    pixels = seen @ camera.intrinsics[0].double().numpy().T
    place = pixels[:, :2] / np.maximum(pixels[:, 2:], 1e-6) * size
    low, high = np.floor(place.min(axis=0)) - 1, np.ceil(place.max(axis=0)) + 1
    x, y = ((np.arange(size) >= low[d]) & (np.arange(size) <= high[d]) for d in (0, 1))
    return (y[:, None] & x[None]).reshape(-1)


def vertex_normals(
    vertices: Float[np.ndarray, "V 3"], faces: Int64[np.ndarray, "F 3"]
) -> Float[np.ndarray, "V 3"]:
    """Unit normals: area-weighted sums over the faces around each vertex."""
    corners = vertices[faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal = np.stack(
        [np.bincount(faces.ravel(), np.repeat(cross[:, d], 3), len(vertices)) for d in range(3)], axis=1
    )
    return normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)


def brightness(normal: Float[np.ndarray, "P 3"], light: Light) -> Float[np.ndarray, " P"]:
    """Linear brightness; the lamp is soft and reaches a little around the edge."""
    length = np.maximum(np.linalg.norm(normal, axis=1), 1e-12)
    facing = normal @ light.direction / length
    return light.ambient + light.strength * np.clip((facing + 0.3) / 1.3, 0, 1)


def develop(picture: np.ndarray, depth: np.ndarray, size: int) -> Shot:
    """Averages the rays of each pixel: colour and coverage of all, distance of those that hit."""
    hit = (depth > 0).reshape(size, OVERSAMPLING, size, OVERSAMPLING)
    cover = hit.mean(axis=(1, 3))
    linear = picture.reshape(size, OVERSAMPLING, size, OVERSAMPLING, 3).mean(axis=(1, 3))
    far = depth.reshape(hit.shape).sum(axis=(1, 3)) / np.maximum(hit.sum(axis=(1, 3)), 1)
    steps = np.clip(np.rint(far / DEPTH_UNIT), 0, 65535) * (cover >= 0.5)
    return Shot(
        image=np.rint(255 * np.clip(linear, 0, 1) ** (1 / GAMMA)).astype(np.uint8),
        mask=np.rint(255 * cover).astype(np.uint8),
        depth=steps.astype(np.uint16),
    )


def orbit_camera(height: float, rng: np.random.Generator) -> Camera:
    """A camera that looks from anywhere around, a little from above or below, at the axis of the person at
    `height` metres.
    """
    yaw, pitch = rng.uniform(0, 2 * np.pi), rng.normal(0.06, 0.12)
    back = np.array([np.cos(pitch) * np.sin(yaw), np.sin(pitch), np.cos(pitch) * np.cos(yaw)])
    target = np.array([0, height, 0]) + rng.normal(0, (0.02, 0.03, 0.02))
    right = np.cross([0, 1, 0], back)
    right /= np.linalg.norm(right)
    cam2world = np.eye(4, dtype=np.float32)
    cam2world[:3, :3] = np.stack([right, -np.cross(back, right), -back], axis=1)
    cam2world[:3, 3] = target + back * rng.uniform(3.1, 3.5)
    intrinsics = np.array([[1.4, 0, 0.5], [0, 1.4, 0.5], [0, 0, 1]], dtype=np.float32)
    return Camera(cam2world=torch.from_numpy(cam2world)[None], intrinsics=torch.from_numpy(intrinsics)[None])
