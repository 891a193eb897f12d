"""Orthographic cameras around an asset: the whole figure from any side, or its face.

Azimuth 0 is the front, 90 degrees the person's left; elevation is how far the camera looks down, degrees.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float64

from assets.asset.asset import Asset, PlainAsset
from assets.asset.names import NAME_PRESETS

VIEWS = {"front": 0.0, "quarter": 35.0, "left": 90.0, "back": 180.0, "right": 270.0, "face": 0.0}
ELEVATION = 6.0  # degrees: enough to see the ground
MARGIN = 0.05  # of the figure's height, around it
HEADS = {table.get("head", "head") for table in NAME_PRESETS.values()}  # whatever names the joints have


@dataclass(frozen=True, kw_only=True)
class Camera:
    """Looks along -`towards` at `centre`; `width` x `height` metres fill the picture."""

    centre: Float64[np.ndarray, "3"]
    right: Float64[np.ndarray, "3"]
    up: Float64[np.ndarray, "3"]
    towards: Float64[np.ndarray, "3"]  # from the asset to the camera
    width: float
    height: float

    def see(self, points: Float[np.ndarray, "N 3"]) -> Float64[np.ndarray, "N 3"]:
        """Points in metres right of, above and before the centre."""
        axes = np.stack([self.right, self.up, self.towards], axis=1)
        return (np.asarray(points, dtype=np.float64) - self.centre) @ axes


def turn(azimuth: float, elevation: float) -> Float64[np.ndarray, "3 3"]:
    """Rows: right, up and towards of a camera on that side."""
    a, e = np.radians(azimuth), np.radians(elevation)
    right = np.array([np.cos(a), 0.0, -np.sin(a)])
    towards = np.array([np.sin(a) * np.cos(e), np.sin(e), np.cos(a) * np.cos(e)])
    return np.stack([right, np.cross(towards, right), towards])


def view_camera(asset: PlainAsset, view: str) -> Camera:
    """The camera of a named view."""
    if view == "face":
        return face_camera(asset)
    return figure_camera(asset.vertices, VIEWS[view])


def figure_camera(vertices: Float[np.ndarray, "W 3"], azimuth: float) -> Camera:
    """The whole figure from one side, as tight as the margin allows."""
    right, up, towards = turn(azimuth, ELEVATION)
    axes = np.stack([right, up, towards], axis=1)
    seen = vertices.astype(np.float64) @ axes
    low, high = seen.min(axis=0), seen.max(axis=0)
    width, height = (high - low)[:2] + 2 * MARGIN * (high - low)[1]
    centre = axes @ ((low + high) / 2)
    return Camera(centre=centre, right=right, up=up, towards=towards, width=width, height=height)


def orbit(vertices: Float[np.ndarray, "W 3"], count: int) -> list[Camera]:
    """Cameras of equal size all around the figure, the first in front of it."""
    middle = (vertices.min(axis=0) + vertices.max(axis=0)).astype(np.float64) / 2
    reach = np.linalg.norm((vertices - middle)[:, [0, 2]], axis=1).max()
    cameras = [figure_camera(vertices, 360 * step / count) for step in range(count)]
    height = max(camera.height for camera in cameras)
    width = 2 * (float(reach) + MARGIN * height)
    return [
        Camera(centre=middle, right=c.right, up=c.up, towards=c.towards, width=width, height=height)
        for c in cameras
    ]


def face_camera(asset: PlainAsset) -> Camera:
    """The head from the front: from the joint of that name, or the top of the figure where none has it."""
    right, up, towards = turn(0.0, 0.0)
    low, high = asset.vertices.min(axis=0).astype(np.float64), asset.vertices.max(axis=0).astype(np.float64)
    neck = low + np.array([0.5, 0.85, 0.5]) * (high - low)
    if isinstance(asset, Asset):
        found = [i for i, name in enumerate(asset.skeleton.joint_names) if name in HEADS]
        neck = asset.skeleton.joints[found[0]] if found else neck
    height = 1.6 * max(high[1] - neck[1], 0.01)
    centre = np.array([neck[0], neck[1] + 0.25 * height, neck[2]])
    return Camera(centre=centre, right=right, up=up, towards=towards, width=0.8 * height, height=height)
