"""What a photograph shows of a person, small enough to compare many clothes with, and what they would show.

Letters: H W pixels of the view, F faces.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Float32, Float64, Int64
from PIL import Image

from avatargen.photo.camera import Pinhole
from avatargen.photo.raster import look_at
from avatargen.photo.sighting import Sighting
from avatargen.wardrobe.colour_names import lab

TALL = 190  # pixels of a view
FAR = np.float32(1e3)  # m, where nothing is


@dataclass(frozen=True, kw_only=True, eq=False)
class View:
    """A part of the photograph: colours in CIELAB, where the person is, and the camera that sees the part."""

    camera: Pinhole
    color: Float64[np.ndarray, "H W 3"]
    mask: Bool[np.ndarray, "H W"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Layer:
    """A piece alone: metres away, and the artist's colours, CIELAB."""

    away: Float32[np.ndarray, "H W"]
    color: Float32[np.ndarray, "H W 3"]


def view_of(sighting: Sighting, low: Float[np.ndarray, "2"], high: Float[np.ndarray, "2"]) -> View:
    """The part between two corners, pixels, some 190 pixels tall."""
    size = np.array(sighting.picture.size)
    first = np.clip(np.floor(low), 0, size - 2).astype(int)
    last = np.clip(np.ceil(high), first + 2, size).astype(int)
    box = (slice(first[1], last[1]), slice(first[0], last[0]))
    share = TALL / (last[1] - first[1])
    part = sighting.camera.part((int(first[0]), int(first[1])), (int(last[0]), int(last[1])))
    camera = part.resized(share)
    wanted = (camera.width, camera.height)
    how = Image.Resampling.BOX if share < 1 else Image.Resampling.BILINEAR
    pixels = np.asarray(Image.fromarray(sighting.picture.pixels[box]).resize(wanted, how))
    mask = np.asarray(Image.fromarray(sighting.mask[box]).resize(wanted, how))
    color = lab(pixels.reshape(-1, 3) / 255).reshape(pixels.shape)
    return View(camera=camera, color=color, mask=mask > 0.5)


def draw_layer(
    vertices: Float64[np.ndarray, "N 3"],
    faces: Int64[np.ndarray, "F 3"],
    color: Float64[np.ndarray, "N 3"],
    camera: Pinhole,
) -> Layer:
    """A piece as the view's camera sees it."""
    seen = look_at(vertices, faces, camera)
    away = np.where(seen.mask, seen.away, FAR).astype(np.float32)
    return Layer(away=away, color=seen.read(color[faces]).astype(np.float32))
