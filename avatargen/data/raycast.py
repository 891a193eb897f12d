"""Pictures of a coloured mesh by ray casting, for training data with exact depth and mask.

Letters: V vertices, F faces, S pixels a side, R rays a side. Metres; cameras as in
`avatargen.generator.camera`.
"""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Float32, Int64, UInt8, UInt16

from avatargen.compiled import compiled, inner
from avatargen.data.units import DEPTH_UNIT
from avatargen.generator.camera import Camera

OVERSAMPLING = 2
GAMMA = 2.2
CLOSEST = 1e-6  # metres before the camera; a face that comes nearer is looked for in the whole picture
SLACK = 1e-6  # pixels, by which rounding may put a corner elsewhere


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
    cam2world, intrinsics = camera.cam2world[0].double().numpy(), camera.intrinsics[0].double().numpy()
    pixels_local = np.diag([fine, fine, 1.0]) @ intrinsics
    seen = (vertices - cam2world[:3, 3]) @ (pixels_local @ np.linalg.inv(cam2world[:3, :3])).T
    nearness, place = np.zeros((fine, fine)), np.zeros((fine, fine, 2))
    face = np.full((fine, fine), -1, dtype=np.int32)
    cast(seen, faces, nearness, face, place)
    image = np.full((size, size, 3), 255, dtype=np.uint8)
    mask, depth = np.zeros((size, size), dtype=np.uint8), np.zeros((size, size), dtype=np.uint16)
    lamp = np.array([light.ambient, light.strength, *light.direction])
    surface = (faces, colors, vertex_normals(vertices, faces))
    develop(nearness, face, place, np.linalg.inv(pixels_local), surface, lamp, image, mask, depth)
    return Shot(image=image, mask=mask, depth=depth)


@compiled
def cast(seen, faces, nearness, face, place):
    """Follow the ray through the centre of every pixel of an [R R] picture to the first face that it meets.

    `seen` [V 3] are vertices by the camera: column and row in pixels, both times the distance z along the
    axis, and z. Filled in are `nearness` [R R], 1 over z or 0, `face` [R R] and `place` [R R 2], the second
    and the third barycentric coordinate there.

    With q0 q1 q2 the corners and d = (column, row, 1) the ray, the coordinates are as d . (q1 x q2) and so on
    to their sum, and z is as the volume q0 . (q1 x q2) to it. Neighbours compute the same product for their
    common edge, so no ray passes between them.
    """
    size = len(face)
    for f in range(len(faces)):
        ax, ay, az = seen[faces[f, 0], 0], seen[faces[f, 0], 1], seen[faces[f, 0], 2]
        bx, by, bz = seen[faces[f, 1], 0], seen[faces[f, 1], 1], seen[faces[f, 1], 2]
        cx, cy, cz = seen[faces[f, 2], 0], seen[faces[f, 2], 1], seen[faces[f, 2], 2]
        ux, uy, uz = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
        vx, vy, vz = cy * az - cz * ay, cz * ax - cx * az, cx * ay - cy * ax
        wx, wy, wz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        volume = ax * ux + ay * uy + az * uz
        if volume == 0 or max(az, bz, cz) <= 0:  # seen along its plane, or behind the camera
            continue
        low_x, high_x, low_y, high_y = 0, size - 1, 0, size - 1
        if min(az, bz, cz) > CLOSEST:
            low_x = max(int(np.ceil(min(ax / az, bx / bz, cx / cz) - 0.5 - SLACK)), 0)
            high_x = min(int(np.floor(max(ax / az, bx / bz, cx / cz) - 0.5 + SLACK)), size - 1)
            low_y = max(int(np.ceil(min(ay / az, by / bz, cy / cz) - 0.5 - SLACK)), 0)
            high_y = min(int(np.floor(max(ay / az, by / bz, cy / cz) - 0.5 + SLACK)), size - 1)
        for row in range(low_y, high_y + 1):
            for column in range(low_x, high_x + 1):
                x, y = column + 0.5, row + 0.5
                u, v, w = x * ux + y * uy + uz, x * vx + y * vy + vz, x * wx + y * wy + wz
                if not ((u >= 0 and v >= 0 and w >= 0) or (u <= 0 and v <= 0 and w <= 0)):
                    continue
                whole = u + v + w
                here = whole / volume
                if here > nearness[row, column]:
                    nearness[row, column], face[row, column] = here, f
                    place[row, column, 0], place[row, column, 1] = v / whole, w / whole


@compiled
def develop(nearness, face, place, local_pixels, surface, lamp, image, mask, depth):
    """Average the rays of each pixel: colour and coverage of all, distance of those that met something.

    The first three are what `cast` found. `local_pixels` [3 3] takes a pixel to a ray of the camera,
    `surface` are faces [F 3], colours [V 3] and normals [V 3], `lamp` is ambient, strength and direction.
    Filled in are `image` [S S 3], which was white, and `mask` and `depth` [S S], which were 0.
    """
    faces, colors, normals = surface
    rays, light, ray = OVERSAMPLING * OVERSAMPLING, np.zeros(3), np.zeros(3)
    for row in range(len(mask)):
        for column in range(len(mask)):
            hits, far = 0, 0.0
            light[:] = 0
            for i in range(rays):
                r, c = row * OVERSAMPLING + i // OVERSAMPLING, column * OVERSAMPLING + i % OVERSAMPLING
                if face[r, c] < 0:
                    continue
                hits += 1
                for k in range(3):
                    ray[k] = local_pixels[k, 0] * (c + 0.5) + local_pixels[k, 1] * (r + 0.5)
                    ray[k] += local_pixels[k, 2]
                far += np.sqrt(ray[0] ** 2 + ray[1] ** 2 + ray[2] ** 2) / nearness[r, c]
                shade(faces[face[r, c]], place[r, c], colors, normals, lamp, light)
            if hits == 0:
                continue
            for k in range(3):
                linear = min(max((light[k] + rays - hits) / rays, 0.0), 1.0)
                image[row, column, k] = np.rint(255 * linear ** (1 / GAMMA))
            mask[row, column] = np.rint(255 * hits / rays)
            if 2 * hits >= rays:
                depth[row, column] = min(max(np.rint(far / hits / DEPTH_UNIT), 0), 65535)


@inner
def shade(corners, place, colors, normals, lamp, light):
    """Add to `light` [3] the linear colour at a place of a face; the lamp is soft and reaches a little around
    the edge.
    """
    a, b, c = 1 - place[0] - place[1], place[0], place[1]
    facing, length = 0.0, 0.0
    for k in range(3):
        normal = a * normals[corners[0], k] + b * normals[corners[1], k] + c * normals[corners[2], k]
        facing += normal * lamp[2 + k]
        length += normal * normal
    facing /= max(np.sqrt(length), 1e-12)
    brightness = lamp[0] + lamp[1] * min(max((facing + 0.3) / 1.3, 0.0), 1.0)
    for k in range(3):
        color = a * colors[corners[0], k] + b * colors[corners[1], k] + c * colors[corners[2], k]
        light[k] += min(max(color, 0.0), 1.0) ** GAMMA * brightness


@compiled
def vertex_normals(vertices, faces):
    """Unit normals [V 3] of `vertices` [V 3]: area-weighted sums over the `faces` [F 3] around each."""
    normals = np.zeros((len(vertices), 3))
    for f in range(len(faces)):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        ux, uy, uz = (
            vertices[b, 0] - vertices[a, 0],
            vertices[b, 1] - vertices[a, 1],
            vertices[b, 2] - vertices[a, 2],
        )
        vx, vy, vz = (
            vertices[c, 0] - vertices[a, 0],
            vertices[c, 1] - vertices[a, 1],
            vertices[c, 2] - vertices[a, 2],
        )
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        for corner in (a, b, c):
            normals[corner, 0] += nx
            normals[corner, 1] += ny
            normals[corner, 2] += nz
    for v in range(len(vertices)):
        length = np.sqrt(normals[v, 0] ** 2 + normals[v, 1] ** 2 + normals[v, 2] ** 2)
        for k in range(3):
            normals[v, k] /= max(length, 1e-12)
    return normals


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
