"""A picture of an asset on the CPU: front, back and face side by side in soft light, textured, as clay where
it has no texture, or as a wireframe.

Orthographic cameras at the asset's rest pose, twice the pixels a side for smooth edges, numpy only.
Letters: W vertices, F faces,
N fragments, H and L height and length of a picture in pixels. Shading is done in linear light; pictures are
sRGB.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64, UInt8
from scipy.ndimage import gaussian_filter

from assets.asset import Asset, PlainAsset, TexturedAsset
from assets.raster import rasterise
from avatargen.errors import InputError

OVERSAMPLING = 2
GAMMA = 2.2
BACKGROUND = np.array([0.93, 0.935, 0.94])  # sRGB, at the top; it falls off a little towards the ground
FALL_OFF = 0.10
# direction to the light seen from the camera, strength
LIGHTS = (((0.45, 0.5, 0.75), 0.78), ((-0.7, 0.25, 0.5), 0.22))
SKY, GROUND = 0.44, 0.20  # light from above and from below
CLAY = np.array([0.72, 0.72, 0.74])  # sRGB of a wireframe's faces
LINE = np.array([0.10, 0.16, 0.28])
LINE_WIDTH = 0.7  # pixels of the oversampled picture on either side of an edge
HOLLOW = 0.02  # metres: hollows of about this depth are darkened
MARGIN = 0.05  # of the figure's height, around it


@dataclass(frozen=True, kw_only=True)
class PreviewConfig:
    """Height in pixels; the length follows from the views."""

    height: int = 768
    wireframe: bool = False
    views: tuple[str, ...] = ("front", "back", "face")

    def __post_init__(self) -> None:
        if not 32 <= self.height <= 4096:
            raise InputError(f"preview: {self.height} pixels high; choose 32 to 4096")
        unknown = set(self.views) - {"front", "back", "face"}
        if unknown or not self.views:
            raise InputError(
                f"preview: no view is named {', '.join(sorted(unknown)) or 'nothing'}; use front, back, face"
            )


@dataclass(frozen=True, kw_only=True)
class Camera:
    """Looks along -z of its own frame at `centre`; `width` x `height` metres fill the picture."""

    centre: Float64[np.ndarray, "3"]
    right: Float64[np.ndarray, "3"]
    towards: Float64[np.ndarray, "3"]  # from the asset to the camera
    width: float
    height: float


def render(asset: PlainAsset, config: PreviewConfig | None = None) -> UInt8[np.ndarray, "H L 3"]:
    """The asset from each of the views, side by side."""
    config = config or PreviewConfig()
    return np.concatenate([render_view(asset, frame(asset, view), config) for view in config.views], axis=1)


def frame(asset: PlainAsset, view: str) -> Camera:
    """The camera of a view: the whole figure from the front or the back, or its face."""
    low, high = asset.vertices.min(axis=0).astype(np.float64), asset.vertices.max(axis=0).astype(np.float64)
    right, towards = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
    if view != "face":
        side = 1.0 if view == "front" else -1.0
        margin = 2 * MARGIN * (high[1] - low[1])
        width, height = high[0] - low[0] + margin, high[1] - low[1] + margin
        return Camera(
            centre=(low + high) / 2, right=side * right, towards=side * towards, width=width, height=height
        )
    neck = low + 0.85 * (high - low)
    if isinstance(asset, Asset) and "head" in asset.skeleton.joint_names:
        neck = asset.skeleton.joints[asset.skeleton.joint_names.index("head")]
    height = 1.6 * max(high[1] - neck[1], 0.01)
    centre = np.array([neck[0], neck[1] + 0.25 * height, neck[2]])
    return Camera(centre=centre, right=right, towards=towards, width=0.8 * height, height=height)


def render_view(asset: PlainAsset, camera: Camera, config: PreviewConfig) -> UInt8[np.ndarray, "H L 3"]:
    """One view, `config.height` pixels high."""
    height = config.height * OVERSAMPLING
    width = round(config.height * camera.width / camera.height) * OVERSAMPLING
    scale = height / camera.height
    seen = asset.vertices.astype(np.float64) - camera.centre
    x, y, depth = seen @ camera.right, seen[:, 1], seen @ camera.towards
    places = np.stack([width / 2 + scale * x, height / 2 - scale * y], axis=1)
    face, barycentric, front = nearest_faces(places[asset.faces], depth[asset.faces], width, height)
    picture = np.repeat(backdrop(height), width, axis=0)
    pixel = np.flatnonzero(face >= 0)
    face, barycentric = face[pixel], barycentric[pixel]
    light = (
        lighting(asset, camera, face, barycentric)
        * hollows(front.reshape(height, width), scale).reshape(-1)[pixel]
    )
    if isinstance(asset, TexturedAsset) and not config.wireframe:
        picture[pixel] = sample_texture(asset, face, barycentric) * light[:, None]
    else:
        picture[pixel] = CLAY**GAMMA * light[:, None]
    if config.wireframe:
        line = edge_nearness(places[asset.faces], face, barycentric)[:, None]
        picture[pixel] = picture[pixel] * (1 - line) + LINE**GAMMA * line
    small = picture.reshape(
        height // OVERSAMPLING, OVERSAMPLING, width // OVERSAMPLING, OVERSAMPLING, 3
    ).mean(axis=(1, 3))
    return np.rint(255 * np.clip(small, 0, 1) ** (1 / GAMMA)).astype(np.uint8)


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


def lighting(
    asset: PlainAsset, camera: Camera, face: Int64[np.ndarray, " N"], barycentric: Float64[np.ndarray, "N 3"]
) -> Float64[np.ndarray, " N"]:
    """Light on the surface: sky and ground, and two soft lamps that move with the camera."""
    normal = np.einsum("nc,ncd->nd", barycentric, asset.normals[asset.faces[face]].astype(np.float64))
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-9)
    up = np.array([0.0, 1.0, 0.0])
    light = GROUND + (SKY - GROUND) * (0.5 + 0.5 * normal[:, 1])
    for (right, above, ahead), strength in LIGHTS:
        direction = right * camera.right + above * up + ahead * camera.towards
        facing = normal @ (direction / np.linalg.norm(direction))
        # wraps a little around, as soft light does
        light = light + strength * np.clip((facing + 0.25) / 1.25, 0, 1)
    return light


def hollows(front: Float64[np.ndarray, "H L"], scale: float) -> Float64[np.ndarray, "H L"]:
    """Less light where the surface lies behind its surroundings: a cheap stand-in for ambient occlusion.

    `front` is the depth in metres, -inf beside the asset; `scale` pixels make a metre. Done at half the size.
    """
    coarse = front[::2, ::2]
    seen = np.isfinite(coarse)
    depth = np.where(seen, coarse, 0.0)
    light = np.ones_like(depth)
    for metres in (0.5 * HOLLOW, 2 * HOLLOW):
        blur = max(metres * scale / 4, 0.5)
        share = np.maximum(gaussian_filter(seen.astype(np.float64), blur, truncate=2), 1e-6)
        behind = gaussian_filter(depth, blur, truncate=2) / share - depth
        light *= 1 - 0.3 * np.clip(behind / HOLLOW, 0, 1)
    return np.repeat(np.repeat(light, 2, axis=0), 2, axis=1)


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
