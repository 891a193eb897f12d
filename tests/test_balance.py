"""Which side is seen, and how often it is shown."""

import json
from pathlib import Path

import numpy as np
import pytest
import torch

from avatargen.data.balance import MOST, PARTS, azimuths, parts_of, view_weights
from avatargen.data.dataset import Pictures, open_pictures
from avatargen.data.labels import Labels, encode_labels, read_labels
from avatargen.errors import InputError


def cameras(angles: np.ndarray) -> np.ndarray:
    """Cameras around the person, looking at the axis."""
    back = np.stack([np.sin(angles), 0 * angles, np.cos(angles)], axis=1)
    matrix = np.tile(np.eye(4), (len(angles), 1, 1))
    matrix[:, :3, 3] = 3 * back
    rest = np.tile(np.eye(3).ravel(), (len(angles), 1))
    return np.concatenate([matrix.reshape(-1, 16), rest], axis=1).astype(np.float32)


def labels(angles: np.ndarray, weights: np.ndarray | None) -> Labels:
    N = len(angles)
    return Labels(
        names=tuple(f"images/{i}.png" for i in range(N)),
        camera=cameras(angles),
        pose=np.zeros((N, 2, 3), dtype=np.float32),
        betas=np.zeros((N, 1), dtype=np.float32),
        weights=weights,
    )


def test_azimuth_is_counted_from_the_front_to_the_persons_left():
    angles = np.array([0.0, 1.0, -2.0, 3.0])
    assert np.allclose(azimuths(cameras(angles)), angles, atol=1e-6)
    step = 2 * np.pi / PARTS
    assert parts_of(cameras(np.array([-0.4, 0.0, 0.4, 0.6, -0.6]) * step)).tolist() == [0, 0, 0, 1, PARTS - 1]


def test_shown_by_weight_every_side_is_seen_as_often_as_the_others(tmp_path: Path):
    """Nine in ten pictures from the front become as many as from the other three sides that there are."""
    angles = np.repeat([0.0, 1.5, 3.1, -1.5], [40, 10, 10, 10])
    weights = view_weights(cameras(angles))
    assert weights.mean() == pytest.approx(1)
    pictures = Pictures(folder=tmp_path, labels=labels(angles, weights), size=8)
    drawn = pictures.choose((20_000,), torch.Generator().manual_seed(0))
    shares = np.bincount(parts_of(pictures.labels.camera)[drawn.numpy()], minlength=PARTS) / len(drawn)
    assert np.allclose(shares[shares > 0], 0.25, atol=0.015)
    within = np.bincount(drawn.numpy())[:40]
    assert within.min() > 0.5 * within.mean() > 0  # every picture of a side alike


def test_one_odd_picture_is_not_shown_over_and_over():
    weights = view_weights(cameras(np.append(np.zeros(1000), np.pi)))
    assert weights[-1] / weights[0] == pytest.approx(MOST / (1001 / 2 / 1000), rel=1e-3)


def test_without_weights_the_draws_are_as_they_were(tmp_path: Path):
    pictures = Pictures(folder=tmp_path, labels=labels(np.zeros(7), None), size=8)
    one, other = (torch.Generator().manual_seed(3) for _ in range(2))
    assert torch.equal(pictures.choose((3, 4), one), torch.randint(7, (3, 4), generator=other))


def test_weights_are_kept_in_the_file_and_bad_ones_refused(tmp_path: Path):
    path = tmp_path / "dataset.json"
    weights = np.array([0.1, 1.9], dtype=np.float32)
    path.write_bytes(encode_labels(labels(np.zeros(2), weights), prepared_from="ag3d"))
    found = open_pictures(tmp_path, 8).labels.weights
    assert found is not None and np.array_equal(found, weights)
    content = json.loads(path.read_bytes())
    for bad in ([1.0], [1.0, 0.0], [1.0, float("nan")], [1.0, "x"]):
        path.write_text(json.dumps(content | {"weights": bad}))
        with pytest.raises(InputError, match="damaged"):
            read_labels(path)
