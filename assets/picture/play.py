"""Moments of an animation: the asset as it stands in each frame, and pictures of all of them from one place.

Letters: T frames, W vertices, H and L height and length of a picture in pixels, C channels: 3, or 4 with
transparency.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from jaxtyping import UInt8

from assets.asset.asset import Asset
from assets.asset.rig import Animation
from assets.asset.shaped import shaped
from assets.picture.camera import VIEWS, face_camera, figure_camera
from assets.picture.preview import PreviewConfig, light_up, render_view


def moments(asset: Asset, animation: Animation) -> Iterator[Asset]:
    """The asset's mesh in each frame of the animation, with morphs and joints moved; its skeleton stays."""
    shares, names = asset.weights.astype(np.float64), [morph.name for morph in asset.morphs]
    for frame, T_posed_rest in enumerate(animation.T_posed_rest(asset.skeleton)):
        weights = () if animation.weights is None else animation.weights[frame].tolist()
        still = shaped(asset, dict(zip(names, weights, strict=False)))
        blended = np.einsum("wk,wkab->wab", shares, T_posed_rest[asset.joints, :3])
        vertices = np.einsum("wab,wb->wa", blended[:, :, :3], still.vertices) + blended[:, :, 3]
        normals = np.einsum("wab,wb->wa", blended[:, :, :3], still.normals)
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)
        yield replace(
            asset,
            vertices=vertices.astype(np.float32),
            normals=normals.astype(np.float32),
            animations=(),
            morphs=(),
        )


def pictures(asset: Asset, animation: Animation, config: PreviewConfig) -> list[UInt8[np.ndarray, "H L C"]]:
    """A picture a frame, from the first of the views; the camera stands still and sees every frame whole."""
    frames = list(moments(asset, animation))
    view = config.views[0]
    if view == "face":
        camera = face_camera(frames[0])
    else:
        camera = figure_camera(np.concatenate([frame.vertices for frame in frames]), VIEWS[view])
    return [render_view(light_up(frame), camera, config) for frame in frames]
