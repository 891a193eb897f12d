"""Painted assets: colours stand for numbers, and the numbers are right."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from assets.errors import GeometryError
from assets.picture.paint import HEAT, joint_weights, painted, scale, vertex_errors
from tests.tube import RADIUS, tube


def test_the_scale_runs_through_its_colours():
    colors = scale(("#000000", "#ff0000", "#ffffff"))
    assert colors[0, 0].tolist() == [0, 0, 0]
    assert colors[7, -1].tolist() == [255, 255, 255]
    assert np.abs(colors[0, len(colors) // 2].astype(int) - [255, 0, 0]).max() <= 2
    assert (np.diff(colors.astype(int), axis=1) >= 0).all()


def test_each_vertex_has_the_colour_of_its_value():
    asset = tube()
    values = np.linspace(-0.5, 1.5, len(asset.vertices))
    made = painted(asset, values)
    texel = np.floor(made.uv * len(made.texture)).astype(int)
    found = made.texture[texel[:, 1], texel[:, 0]].astype(int)
    for value, color in ((0.0, HEAT[0]), (1.0, HEAT[-1]), (0.4, HEAT[2])):
        wanted = [int(color[i : i + 2], 16) for i in (1, 3, 5)]
        assert np.abs(found[np.abs(values - value).argmin()] - wanted).max() < 6
    assert np.array_equal(made.uv[values <= 0], np.broadcast_to(made.uv[0], made.uv[values <= 0].shape))
    assert np.array_equal(made.vertices, asset.vertices)


def test_weights_of_all_joints_sum_to_one():
    asset = tube(joint_count=3)
    shares = np.stack([joint_weights(asset, name) for name in asset.skeleton.joint_names])
    assert shares.sum(axis=0) == pytest.approx(np.ones(len(asset.vertices)), abs=1e-6)
    assert shares[0].argmax() < shares[1].argmax() < shares[2].argmax()  # up the tube


def test_errors_are_distances_to_the_field():
    asset = tube(rings=30, sides=64)

    def wider(points: torch.Tensor) -> torch.Tensor:  # an endless cylinder 3 mm around the tube
        return points[:, [0, 2]].norm(dim=1) - (RADIUS + 0.003)

    side = np.abs(asset.normals[:, 1]) < 0.5
    inner = side & (asset.vertices[:, 1] > 0.1) & (asset.vertices[:, 1] < 0.9)
    found = vertex_errors(replace(asset, canonical=asset.vertices), wider)[inner]
    assert found.min() > 2.99
    assert found.max() < 3.2  # faces lie a little inside the circle of their corners
    with pytest.raises(GeometryError, match="build it"):
        vertex_errors(asset, wider)
