"""Moments of an animation are what plain skinning gives, and a film keeps all of them in view."""

import numpy as np

from assets.picture.play import moments, pictures
from assets.picture.preview import BACKGROUND, PreviewConfig
from tests.figure import figure, in_motion


def test_each_moment_is_the_asset_posed_by_its_transforms() -> None:
    asset = in_motion(figure())
    animation = asset.animations[0]
    weights = np.zeros((len(asset.vertices), len(asset.skeleton.parents)))
    np.add.at(weights, (np.arange(len(weights))[:, None], asset.joints), asset.weights)
    flat = np.concatenate([asset.vertices.astype(np.float64), np.ones((len(weights), 1))], axis=1)
    found = list(moments(asset, animation))
    assert len(found) == len(animation.times)
    for moment, transforms in zip(found, animation.T_posed_rest(asset.skeleton), strict=True):
        slow = sum(weights[:, j, None] * (flat @ transforms[j].T)[:, :3] for j in range(len(transforms)))
        assert np.abs(moment.vertices - slow).max() < 1e-5
        assert np.abs(np.linalg.norm(moment.normals, axis=1) - 1).max() < 1e-5
        assert moment.animations == ()


def test_the_camera_stands_still_and_sees_every_frame() -> None:
    asset = in_motion(figure())
    seen = pictures(asset, asset.animations[0], PreviewConfig(height=64, views=("front",)))
    assert len(seen) == len(asset.animations[0].times) and len({picture.shape for picture in seen}) == 1
    background = 255 * BACKGROUND.min()
    for picture in seen:
        figure_there = picture.min(axis=2) < 0.6 * background
        assert figure_there.mean() > 0.02
        edge = np.concatenate([figure_there[0], figure_there[:, 0], figure_there[:, -1]])
        assert not edge.any()
