"""Pictures of an asset on the CPU: views side by side or a turn around it, textured, as clay where it has no
texture, or as a wireframe.

Soft light from all around with a main lamp beside the camera, shadows on the figure and on the ground. Twice
the pixels a side for smooth edges; numpy only. Shading is done in linear light; pictures are sRGB.
Letters: W vertices, F faces, N fragments, D lamps, H and L height and length of a picture in pixels, C
channels: 3, or 4 with transparency.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64, UInt8
from scipy.ndimage import gaussian_filter, map_coordinates

from assets.asset.asset import PlainAsset, TexturedAsset
from assets.mesh.surface import Surface
from assets.picture.camera import VIEWS, Camera, orbit, view_camera
from assets.picture.light import cast_samples, lamps_around, received
from assets.texture.raster import rasterise
from avatargen.errors import InputError

OVERSAMPLING = 2
GAMMA = 2.2
BACKGROUND = np.array([0.93, 0.935, 0.94])  # sRGB, at the top; it falls off a little towards the ground
FALL_OFF = 0.10
LEAST_TILT = 0.02  # of a camera that sees the ground
SKY, GROUND = 0.60, 0.25  # strength of the lamps above and below
# of the main and the edge light: direction seen from the camera, strength, sharpness
LOBES = (((-0.6, 0.8, 0.7), 2.6, 4.0), ((0.9, 0.35, -0.8), 2.0, 4.0))
EXPOSURE = 1.15  # light on what faces the camera unshaded
SHOULDER = 0.6  # linear light from which on bright places are compressed, so that none burns out
CLAY = np.array([0.72, 0.72, 0.74])  # sRGB of a wireframe's faces
LINE = np.array([0.10, 0.16, 0.28])
LINE_WIDTH = 0.7  # pixels of the oversampled picture on either side of an edge
GROUND_CELL, GROUND_REACH = 0.02, 0.6  # metres: fineness of the ground's shadow, and how far it reaches


@dataclass(frozen=True, kw_only=True)
class PreviewConfig:
    """Height in pixels; the length follows from the views."""

    height: int = 768
    wireframe: bool = False
    views: tuple[str, ...] = ("front", "back", "face")
    transparent: bool = False

    def __post_init__(self) -> None:
        if not 32 <= self.height <= 4096:
            raise InputError(f"preview: {self.height} pixels high; choose 32 to 4096")
        unknown = set(self.views) - set(VIEWS)
        if unknown or not self.views:
            raise InputError(
                f"preview: no view is named {', '.join(sorted(unknown)) or 'nothing'}; use {', '.join(VIEWS)}"
            )


@dataclass(frozen=True, kw_only=True)
class Lit:
    """An asset with the light that its vertices and the ground around it receive from each lamp."""

    asset: PlainAsset
    lamps: Float64[np.ndarray, "D 3"]
    light: Float64[np.ndarray, "W D"]
    floor: Float64[np.ndarray, "X Z D"]  # at the height of the lowest vertex, from `corner` on along x and z
    corner: Float64[np.ndarray, "3"]


def render(asset: PlainAsset, config: PreviewConfig | None = None) -> UInt8[np.ndarray, "H L C"]:
    """The asset from each of the views, side by side."""
    config = config or PreviewConfig()
    lit = light_up(asset)
    return np.concatenate(
        [render_view(lit, view_camera(asset, view), config) for view in config.views], axis=1
    )


def turntable(
    asset: PlainAsset, frames: int, config: PreviewConfig | None = None
) -> list[UInt8[np.ndarray, "H L C"]]:
    """Pictures of equal size all around the asset, the first from the front; the light follows the camera."""
    lit = light_up(asset)
    return [render_view(lit, camera, config or PreviewConfig()) for camera in orbit(asset.vertices, frames)]


def light_up(asset: PlainAsset) -> Lit:
    """Send light from all lamps to the asset and the ground it stands on."""
    lamps = lamps_around()
    vertices = asset.vertices.astype(np.float64)
    normals = asset.normals.astype(np.float64)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)
    casters = cast_samples(Surface(vertices=vertices, faces=asset.faces))
    low, high = vertices.min(axis=0) - GROUND_REACH, vertices.max(axis=0) + GROUND_REACH
    corner = np.array([low[0], vertices[:, 1].min(), low[2]])
    x, z = (np.arange(0, high[axis] - low[axis], GROUND_CELL) for axis in (0, 2))
    floor = corner + np.stack(np.broadcast_arrays(x[:, None], 0.0, z[None]), axis=-1)
    points = np.concatenate([vertices, floor.reshape(-1, 3)])
    upward = np.broadcast_to([0.0, 1.0, 0.0], (len(points) - len(vertices), 3))
    light = received(points, np.concatenate([normals, upward]), casters, lamps)
    return Lit(
        asset=asset,
        lamps=lamps,
        light=light[: len(vertices)],
        floor=light[len(vertices) :].reshape(*floor.shape[:2], -1),
        corner=corner,
    )


def render_view(lit: Lit, camera: Camera, config: PreviewConfig) -> UInt8[np.ndarray, "H L C"]:
    """One view, `config.height` pixels high."""
    height = config.height * OVERSAMPLING
    width = round(config.height * camera.width / camera.height) * OVERSAMPLING
    scale = height / camera.height
    asset, seen = lit.asset, camera.see(lit.asset.vertices)
    places = np.array([width, height]) / 2 + scale * seen[:, :2] * [1, -1]
    face, barycentric, _ = nearest_faces(places[asset.faces], seen[asset.faces, 2], width, height)
    pixel, strength = np.flatnonzero(face >= 0), lamp_strengths(lit.lamps, camera)
    face, barycentric = face[pixel], barycentric[pixel]
    light = np.einsum("nc,nc->n", barycentric, (lit.light @ strength)[asset.faces[face]])
    color = np.broadcast_to(CLAY**GAMMA, (len(face), 3))
    if isinstance(asset, TexturedAsset) and not config.wireframe:
        color = sample_texture(asset, face, barycentric)
    color = soften(color * light[:, None])
    if config.wireframe:
        line = edge_nearness(places[asset.faces], face, barycentric)[:, None]
        color = color * (1 - line) + LINE**GAMMA * line
    shade = floor_shade(lit, camera, strength, width, height)
    if config.transparent:
        picture = np.concatenate([np.zeros((height * width, 3)), 1 - shade], axis=1)
        picture[pixel] = np.concatenate([color, np.ones((len(color), 1))], axis=1)
    else:
        picture = np.repeat(backdrop(height), width, axis=0) * shade
        picture[pixel] = color
    return to_srgb(shrink(picture.reshape(height, width, -1)))


def lamp_strengths(lamps: Float64[np.ndarray, "D 3"], camera: Camera) -> Float64[np.ndarray, " D"]:
    """How strong each lamp shines for a camera: sky, ground, and a main and an edge light that go with it."""
    strength = GROUND + (SKY - GROUND) * (0.5 + 0.5 * lamps[:, 1])
    axes = np.stack([camera.right, np.array([0.0, 1.0, 0.0]), camera.towards])
    for seen_from_camera, peak, sharpness in LOBES:
        direction = np.array(seen_from_camera) @ axes
        direction /= np.linalg.norm(direction)
        strength = strength + peak * np.clip(lamps @ direction, 0, None) ** sharpness
    facing = 4 / len(lamps) * np.clip(lamps @ camera.towards, 0, None) @ strength
    return strength * EXPOSURE / facing


def floor_shade(
    lit: Lit, camera: Camera, strength: Float64[np.ndarray, " D"], width: int, height: int
) -> Float64[np.ndarray, "P 1"]:
    """Share of its light that the ground behind each pixel receives: 1 away from the figure."""
    if camera.towards[1] < LEAST_TILT:
        return np.ones((height * width, 1))
    light = gaussian_filter(lit.floor @ strength, 1.5, mode="nearest")
    shade = light / np.maximum(light.max(), 1e-9)
    across = (np.arange(0.5, width // OVERSAMPLING) * OVERSAMPLING / width - 0.5) * camera.width
    above = (0.5 - np.arange(0.5, height // OVERSAMPLING) * OVERSAMPLING / height) * camera.height
    ahead = (lit.corner[1] - camera.centre[1] - above * camera.up[1]) / camera.towards[1]
    place = camera.centre - lit.corner + across[:, None] * camera.right
    cell = [
        (place[None, :, axis] + (above * camera.up[axis] + ahead * camera.towards[axis])[:, None])
        / GROUND_CELL
        for axis in (0, 2)
    ]
    rim = np.minimum.reduce([np.minimum(c, n - 1 - c) for c, n in zip(cell, shade.shape, strict=True)])
    fade = np.clip(rim * GROUND_CELL / (0.5 * GROUND_REACH), 0, 1)
    found = 1 - fade * (1 - map_coordinates(shade, cell, order=1, mode="nearest"))
    return enlarge(found, OVERSAMPLING).reshape(-1, 1)


def nearest_faces(
    triangles: Float64[np.ndarray, "F 3 2"], depth: Float64[np.ndarray, "F 3"], width: int, height: int
) -> tuple[Int64[np.ndarray, " P"], Float64[np.ndarray, "P 3"], Float64[np.ndarray, " P"]]:
    """For each pixel the face nearest to the camera (-1 for none), the place on it, and its depth
    (-inf for none).
    """
    u, v = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    facing = np.flatnonzero(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0] < 0)  # y grows downward here
    face = np.full(width * height, -1, dtype=np.int64)
    barycentric, front = np.zeros((width * height, 3)), np.full(width * height, -np.inf)
    for fragments in rasterise(triangles[facing], width, height):
        number = facing[fragments.triangle]
        here = np.einsum("nc,nc->n", fragments.barycentric, depth[number])
        order = np.argsort(here, kind="stable")  # of several fragments of a pixel the nearest is written last
        order = order[here[order] > front[fragments.pixel[order]]]
        pixel = fragments.pixel[order]
        face[pixel], barycentric[pixel], front[pixel] = (
            number[order],
            fragments.barycentric[order],
            here[order],
        )
    return face, barycentric, front


def soften(color: Float64[np.ndarray, "N 3"]) -> Float64[np.ndarray, "N 3"]:
    """Linear light, as it is up to the shoulder and from there on ever closer to 1."""
    room = 1 - SHOULDER
    return np.where(color < SHOULDER, color, SHOULDER + room * np.tanh((color - SHOULDER) / room))


def enlarge(values: Float64[np.ndarray, "H L"], times: int) -> Float64[np.ndarray, "M K"]:
    """Each value as a square of equal ones."""
    return np.repeat(np.repeat(values, times, axis=0), times, axis=1)


def shrink(picture: Float64[np.ndarray, "H L C"]) -> Float64[np.ndarray, "h l C"]:
    """Means over the squares of pixels that became one."""
    height, width, channels = picture.shape
    squares = picture.reshape(
        height // OVERSAMPLING, OVERSAMPLING, width // OVERSAMPLING, OVERSAMPLING, channels
    )
    return squares.mean(axis=(1, 3))


def to_srgb(linear: Float64[np.ndarray, "H L C"]) -> UInt8[np.ndarray, "H L C"]:
    """Linear light to sRGB; a fourth channel is coverage, which the colours were averaged with and stays
    linear."""
    color, alpha = linear[..., :3], linear[..., 3:]
    if alpha.size:
        color = color / np.maximum(alpha, 1e-6)
    picture = np.concatenate([np.clip(color, 0, 1) ** (1 / GAMMA), alpha], axis=2)
    return np.rint(255 * np.clip(picture, 0, 1)).astype(np.uint8)


def sample_texture(
    asset: TexturedAsset, face: Int64[np.ndarray, " N"], barycentric: Float64[np.ndarray, "N 3"]
) -> Float64[np.ndarray, "N 3"]:
    """The texture with bilinear filtering, in linear light."""
    size = len(asset.texture)
    uv = np.einsum("nc,ncd->nd", barycentric, asset.uv[asset.faces[face]].astype(np.float64))
    place = np.clip(uv * size - 0.5, 0, size - 1)
    low = np.minimum(place.astype(np.int64), size - 2)
    t = place - low
    linear = (np.arange(256) / 255) ** GAMMA
    color = np.zeros((len(face), 3))
    for dx in (0, 1):
        for dy in (0, 1):
            share = (t[:, 0] if dx else 1 - t[:, 0]) * (t[:, 1] if dy else 1 - t[:, 1])
            color += share[:, None] * linear[asset.texture[low[:, 1] + dy, low[:, 0] + dx]]
    return color


def edge_nearness(
    triangles: Float64[np.ndarray, "F 3 2"],
    face: Int64[np.ndarray, " N"],
    barycentric: Float64[np.ndarray, "N 3"],
) -> Float64[np.ndarray, " N"]:
    """1 on an edge of the face, 0 from `LINE_WIDTH` pixels on."""
    opposite = np.roll(triangles, -2, axis=1) - np.roll(triangles, -1, axis=1)  # edge opposite each corner
    length = np.linalg.norm(opposite, axis=2)
    double_area = np.abs(opposite[:, 0, 0] * opposite[:, 1, 1] - opposite[:, 0, 1] * opposite[:, 1, 0])
    heights = double_area[:, None] / np.maximum(length, 1e-9)
    return np.clip(1 + 0.5 - (barycentric * heights[face]).min(axis=1) / LINE_WIDTH, 0, 1)


def backdrop(height: int) -> Float64[np.ndarray, "H 3"]:
    """Rows of the background in linear light."""
    down = np.linspace(0, 1, height)[:, None]
    return (BACKGROUND * (1 - FALL_OFF * down**2)) ** GAMMA
