"""A photograph's own colours on a surface: which points of it are seen well, and in what colour.

The light of the photograph is evened out: where its brightness differs over long ways from the colours that
the person has anyway, that difference is taken away; so nothing shows where the photograph's colours end.

Letters: N vertices, F faces, H W pixels, T points of the surface.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float32, Float64, Int64, UInt8
from scipy.ndimage import binary_opening, distance_transform_edt, gaussian_filter, map_coordinates

from avatargen.photo.camera import Pinhole
from avatargen.photo.face_shift import FaceShift
from avatargen.photo.raster import Seen, look_at
from avatargen.smoothstep import smoothstep
from avatargen.wardrobe.appearance import rgb_of
from avatargen.wardrobe.colour_names import lab

FACING = (0.25, 0.55)  # cosines with the view, between which a point comes to be seen well
BEHIND = 0.012  # m behind what is seen, from which a point is hidden
STEP = 0.04  # m between neighbours, from which one hides what is beside it
BORDER = 0.012  # of the person's height in the picture: how soft the border is
LONG_WAY = 0.035  # of the same: over which light is evened out
GREY = np.array([0.6, 1.0, 1.0])  # what lightness counts, when stuffs are told apart
DIFFERENT, NEARER = 14.0, 0.6  # CIELAB off a stuff, and how much nearer another one is
OTHER = 28.0  # CIELAB from the person's colours, from which it is another thing and not another light


@dataclass(frozen=True, kw_only=True, eq=False)
class Shown:
    """Points of a surface in a photograph: sRGB 0..1, and how well each is seen, 0..1."""

    color: Float64[np.ndarray, "T 3"]
    weight: Float64[np.ndarray, " T"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Scene:
    """A surface in a photograph: its vertices in the camera's space, and what the camera sees of them."""

    vertices: Float64[np.ndarray, "N 3"]
    faces: Int64[np.ndarray, "F 3"]
    camera: Pinhole
    seen: Seen


def scene_of(vertices: Float64[np.ndarray, "N 3"], faces: Int64[np.ndarray, "F 3"], camera: Pinhole) -> Scene:
    """Look at a surface."""
    return Scene(vertices=vertices, faces=faces, camera=camera, seen=look_at(vertices, faces, camera))


def show(
    scene: Scene,
    face: Int64[np.ndarray, " T"],
    barycentric: Float64[np.ndarray, "T 3"],
    photograph: Float[np.ndarray, "H W 3"],
    trusted: Float[np.ndarray, "H W"],
    shift: FaceShift | None = None,
) -> Shown:
    """Points of a surface, each on a face, in a photograph (sRGB 0..1) as far as that is `trusted`."""
    corners = scene.vertices[scene.faces[face]]
    points = np.einsum("tk,tkd->td", barycentric, corners)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1) * np.linalg.norm(points, axis=1)
    facing = -np.einsum("td,td->t", normals, points) / np.maximum(lengths, 1e-15)
    places, away = scene.camera.see(points)
    front = read(np.where(scene.seen.mask, scene.seen.away, 0.0), places, order=0)
    inside = ((places > 0) & (places < [scene.camera.width, scene.camera.height])).all(axis=1)
    weight = smoothstep(facing, *FACING) * inside * (away < front + BEHIND)
    if shift is not None:
        places = places + shift.at(places)
    weight = weight * np.clip(read(trusted, places), 0, 1)
    color = np.stack([read(photograph[..., c], places) for c in range(3)], axis=1)
    return Shown(color=color.clip(0, 1), weight=weight)


def trust(seen: Seen, mask: Float32[np.ndarray, "H W"], height: float) -> Float64[np.ndarray, "H W"]:
    """How far each pixel is trusted to show what the surface has there: 0 beside the person's outline, beside
    the surface's and where one part hides another, 1 within."""
    away = np.where(seen.mask, seen.away, 1e3)
    steps = np.zeros(away.shape, dtype=bool)
    for axis in (0, 1):
        jump = np.abs(np.diff(away, axis=axis)) > STEP
        along = [slice(None)] * 2
        for part in (slice(1, None), slice(None, -1)):
            along[axis] = part
            steps[tuple(along)] |= jump
    within = (mask > 0.8) & seen.mask & ~steps
    return smoothstep(np.asarray(distance_transform_edt(within)), 1.0, 1.0 + max(BORDER * height, 2.0))


def of_one_stuff(
    photograph: UInt8[np.ndarray, "H W 3"],
    own: Float64[np.ndarray, "H W 3"],
    stuffs: Float64[np.ndarray, "K 3"],
    trusted: Float64[np.ndarray, "H W"],
    height: float,
) -> Float64[np.ndarray, "H W"]:
    """`trusted`, but 0 where the photograph shows another of the person's stuffs (CIELAB) than the surface
    has there: a hand before a shirt, a sleeve that ends elsewhere."""
    picture, ours = (lab(each.reshape(-1, 3)) * GREY for each in (photograph / 255, own))
    colors = stuffs * GREY
    apart = np.linalg.norm(picture - ours, axis=1)
    to_stuffs = np.linalg.norm(picture[:, None] - colors[None], axis=2)
    own_stuff = np.linalg.norm(ours[:, None] - colors[None], axis=2).argmin(axis=1)
    to_stuffs[np.arange(len(picture)), own_stuff] = np.inf
    other = (apart > DIFFERENT) & (to_stuffs.min(axis=1) < NEARER * apart)
    other = np.asarray(binary_opening(other.reshape(trusted.shape)), dtype=bool) & (trusted > 0)
    if not other.any():
        return trusted
    return trusted * smoothstep(
        np.asarray(distance_transform_edt(~other)), 1.0, 1.0 + max(BORDER * height, 2.0)
    )


def read(picture: Float[np.ndarray, "H W"], places: Float64[np.ndarray, "T 2"], order: int = 1) -> np.ndarray:
    """A picture at places, pixels."""
    return map_coordinates(picture, [places[:, 1] - 0.5, places[:, 0] - 0.5], order=order, mode="nearest")


def evened(
    photograph: UInt8[np.ndarray, "H W 3"],
    own: Float64[np.ndarray, "H W 3"],
    trusted: Float64[np.ndarray, "H W"],
    height: float,
) -> Float64[np.ndarray, "H W 3"]:
    """The photograph, sRGB 0..1, without the light's long ways: `own` is what the surface's own colours show
    in its place."""
    picture, ours = (lab(each.reshape(-1, 3)).reshape(each.shape) for each in (photograph / 255, own))
    apart = picture - ours
    alike = trusted * (np.linalg.norm(apart, axis=2) < OTHER)
    wide = max(LONG_WAY * height, 2.0)
    weight = gaussian_filter(alike, wide)
    for c, share in enumerate((1.0, 0.7, 0.7)):
        off = gaussian_filter(alike * apart[..., c], wide) / np.maximum(weight, 1e-3)
        picture[..., c] -= share * off * np.clip(weight / 0.02, 0, 1)
    return rgb_of(picture.reshape(-1, 3)).reshape(picture.shape)
