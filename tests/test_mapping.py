"""Mapping network."""

from dataclasses import replace

import torch

from avatargen.generator.camera import front_camera
from avatargen.generator.config import PRESETS
from avatargen.generator.mapping import Mapping
from tests.generators import randomize

CONFIG = PRESETS["debug"].mapping


def test_paper_preset_ignores_the_length_of_z_and_the_shipped_one_does_not():
    z, camera = torch.randn(3, 16), front_camera(3).vector
    for normalize in (True, False):
        mapping = Mapping(replace(CONFIG, normalize=normalize, sign_gain=0.0))
        change = (mapping(2 * z, camera) - mapping(z, camera)).abs().max()
        assert (change < 1e-4) == normalize


def test_signs_of_z_switch_sharply():
    mapping = Mapping(replace(CONFIG, sign_gain=200.0))
    plain = Mapping(replace(CONFIG, sign_gain=0.0))
    z = torch.zeros(2, 16)
    z[:, 0] = torch.tensor([0.02, -0.02])
    camera = front_camera(2).vector
    sharp, smooth = (torch.diff(m(z, camera), dim=0).norm() for m in (mapping, plain))
    assert sharp > 10 * smooth


def test_the_camera_moves_w_unless_left_out():
    z = torch.randn(1, 16)
    cameras = front_camera(1).vector, front_camera(1).vector.flip(1)
    for features in (8, 0):
        mapping = Mapping(replace(CONFIG, camera_features=features))
        changed = not torch.equal(mapping(z, cameras[0]), mapping(z, cameras[1]))
        assert changed == (features > 0)


def test_truncation_moves_toward_the_running_mean():
    mapping = Mapping(replace(CONFIG, average_decay=0.9))
    randomize(mapping)
    z, camera = torch.randn(50, 16), front_camera(50).vector
    with torch.no_grad():
        for _ in range(150):
            mapping.track_average(mapping(z, camera))
        w = mapping(z, camera)
        mean = w.mean(dim=0)
        assert (mapping.average - mean).norm() < 1e-2 * mean.norm()
        assert torch.allclose(mapping(z, camera, truncation=0.0), mapping.average.expand(50, -1))
        halfway = mapping(z, camera, truncation=0.5)
        assert torch.allclose(halfway, (w + mapping.average) / 2, atol=1e-4)
