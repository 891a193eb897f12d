"""Photographs made in code: somebody before a camera, in light from somewhere, before a wall and a floor.

Letters: W vertices, F faces, S texels along a side, J joints, H L pixels.
"""

from dataclasses import dataclass
from math import cos, sin

import numpy as np
from jaxtyping import Float, Float64, Int64, UInt8
from PIL import Image
from scipy.spatial.transform import Rotation

from avatargen.data.poses import random_pose
from avatargen.photo.camera import Pinhole
from avatargen.photo.raster import look_at

WIDTH, HEIGHT = 600, 700
FOCAL = (0.8, 1.3)  # of the longer side; whoever reads the picture is not told
SPAN = 0.75  # of the picture's height, that a person takes
TURN, TILT = 0.45, 0.05  # standard deviations of how people stand to the camera, radians
LOOKS_DOWN = 0.06  # radians, of the camera on the whole
AMBIENT, LAMP = 0.45, 0.75  # strengths of light
OVERSAMPLING = 2
GAMMA = 2.2


@dataclass(frozen=True, kw_only=True, eq=False)
class Figure:
    """A textured surface in the camera's space."""

    vertices: Float64[np.ndarray, "W 3"]
    faces: Int64[np.ndarray, "F 3"]
    uv: Float[np.ndarray, "W 2"]
    texture: UInt8[np.ndarray, "S S 3"]


def stand(joint_names: tuple[str, ...], rng: np.random.Generator) -> Float64[np.ndarray, "J 3"]:
    """An everyday pose, turned to the camera more or less."""
    rotations = random_pose(joint_names, rng).astype(np.float64)
    angles = [rng.normal(0, TURN), LOOKS_DOWN + rng.normal(0, TILT), rng.normal(0, TILT)]
    rotations[0] = (Rotation.from_euler("yxz", angles) * Rotation.from_rotvec(rotations[0])).as_rotvec()
    return rotations


def put_camera(
    vertices: Float[np.ndarray, "W 3"], rng: np.random.Generator
) -> tuple[Pinhole, Float64[np.ndarray, "3"]]:
    """A camera, and the move that puts somebody before it."""
    focal = rng.uniform(*FOCAL) * max(WIDTH, HEIGHT)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    away = focal * float(high[1] - low[1]) / (HEIGHT * SPAN)
    aside = rng.normal(0, 0.05, 2)
    move = np.array([*aside, -away]) - (low + high) / 2
    return Pinhole(width=WIDTH, height=HEIGHT, focal=focal), move


def lamp_on(normals: Float[np.ndarray, "W 3"], rng: np.random.Generator) -> Float64[np.ndarray, " W"]:
    """How bright each vertex is under one lamp, somewhere above and before."""
    way = np.array([rng.normal(0, 0.5), 0.8, 0.8])
    return AMBIENT + LAMP * np.clip(normals.astype(np.float64) @ (way / np.linalg.norm(way)), 0, None)


def draw(
    figure: Figure, camera: Pinhole, light: Float64[np.ndarray, " W"] | None = None
) -> UInt8[np.ndarray, "H L 4"]:
    """The figure and how far it covers each pixel; without light in its own colours."""
    seen = look_at(figure.vertices, figure.faces, camera.resized(float(OVERSAMPLING)))
    at, size = seen.mask, len(figure.texture)
    place = np.clip((seen.read(figure.uv[figure.faces])[at] * size).astype(np.int64), 0, size - 1)
    color = np.zeros((*at.shape, 3))
    color[at] = (figure.texture[place[:, 1], place[:, 0]] / 255) ** GAMMA
    if light is not None:
        color[at] *= seen.read(light[figure.faces][..., None])[at]
    cover = at[..., None].astype(np.float64)
    linear = shrunk(color.clip(0, 1)) / np.maximum(shrunk(cover), 1e-6)
    found = np.concatenate([linear ** (1 / GAMMA), shrunk(cover)], axis=2)
    return np.rint(255 * found.clip(0, 1)).astype(np.uint8)


def shrunk(picture: Float64[np.ndarray, "_ _ C"]) -> Float64[np.ndarray, "H L C"]:
    """Means over the squares of pixels that become one."""
    height, width, channels = picture.shape
    n = OVERSAMPLING
    return picture.reshape(height // n, n, width // n, n, channels).mean(axis=(1, 3))


def before_wall(picture: UInt8[np.ndarray, "H L 4"], rng: np.random.Generator) -> UInt8[np.ndarray, "H L 3"]:
    """The photograph: the figure before a stained wall and a floor."""
    height, width = picture.shape[:2]

    def stains(cells: int, strength: float) -> np.ndarray:
        noise = rng.integers(0, 256, (cells, cells, 3), dtype=np.uint8)
        large = Image.fromarray(noise).resize((width, height), Image.Resampling.BICUBIC)
        return strength * (np.asarray(large) / 255 - 0.5)

    wall = rng.uniform(0.3, 0.85, 3) + stains(4, 0.35) + stains(40, 0.15)
    wall[int(height * rng.uniform(0.6, 0.9)) :] *= rng.uniform(0.5, 0.9)
    color, cover = picture[..., :3] / 255, picture[..., 3:] / 255
    linear = color**GAMMA * cover + wall.clip(0, 1) ** GAMMA * (1 - cover)
    return np.rint(255 * linear ** (1 / GAMMA)).astype(np.uint8)


def turned(figure: Figure, middle: Float64[np.ndarray, "3"], angle: float) -> Figure:
    """The figure turned about the upright through a place, radians."""
    c, s = cos(angle), sin(angle)
    turn = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    vertices = (figure.vertices - middle) @ turn.T + middle
    return Figure(vertices=vertices, faces=figure.faces, uv=figure.uv, texture=figure.texture)
