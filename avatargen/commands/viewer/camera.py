"""Where the camera stands so that the whole person is in the picture, at rest or moving."""

from itertools import product

import numpy as np
from jaxtyping import Float64

from assets.asset.animate import boxes
from assets.asset.asset import Asset

UP = np.array([0.0, 1.0, 0.0])
FROM = np.array([0.26, 0.11, 0.96])  # the way from the person to the camera: a little aside, a little above
ROOM = 1.1  # height and width of the picture, of what the person takes


def place(
    box: Float64[np.ndarray, "2 3"], fov: float, aspect: float
) -> tuple[Float64[np.ndarray, "3"], Float64[np.ndarray, "3"]]:
    """Position of the camera and the point that it looks at, metres: as near as it can be to see the whole
    box, which is given by its lowest and its highest corner.

    Args:
        fov: vertical field of view, radians.
        aspect: width of the picture by its height.
    """
    middle = box.mean(axis=0)
    back = FROM / np.linalg.norm(FROM)
    right = np.cross(UP, back)
    right /= np.linalg.norm(right)
    corners = np.array(list(product(*box.T))) - middle  # 8 3
    half = np.tan(fov / 2) / ROOM
    aside = np.abs(corners @ np.stack([right / aspect, np.cross(back, right)], axis=1)).max(axis=1)
    return middle + float((corners @ back + aside / half).max()) * back, middle


def room_of(shape: Asset) -> Float64[np.ndarray, "2 3"]:
    """The low and the high corner of the box around the asset, or around its animations, metres."""
    if not shape.animations:
        return np.stack([shape.vertices.min(axis=0), shape.vertices.max(axis=0)]).astype(np.float64)
    played = np.concatenate([boxes(shape, animation) for animation in shape.animations])
    return np.stack([played[:, 0].min(axis=0), played[:, 1].max(axis=0)])
