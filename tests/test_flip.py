"""Edges turned to where the field is, and nothing else changed."""

import numpy as np
import pytest
import torch
from shapes import BOX, box, icosphere, sphere

from assets.isosurface.extract import ExtractConfig, extract
from assets.mesh.measure import surface_error
from assets.mesh.surface import Surface, directed_edges, find_defects, smallest_angles
from assets.simplify.flip import FlipConfig, diagonals, flip
from assets.simplify.simplify import SimplifyConfig, simplify
from avatargen.body.pose import axis_angle_to_matrix


def ridge(far: bool) -> Surface:
    """A roof of two slopes on a closed block, its ridge along x there or cut across by the wrong diagonal."""
    points = np.array(
        [[0, 0, 0], [2, 0, 0], [2, 0, 2], [0, 0, 2], [0, 1, 1], [2, 1, 1], [1, 0.5, 0], [1, 0.5, 2]],
        dtype=np.float64,
    )
    top = [[4, 5, 6], [5, 4, 7]] if far else [[6, 4, 7], [7, 5, 6]]
    rest = [[4, 6, 0], [5, 1, 6], [4, 3, 7], [5, 7, 2], [0, 3, 4], [1, 5, 2], [0, 6, 1], [3, 2, 7]]
    floor = [[0, 1, 2], [0, 2, 3]]
    return Surface(vertices=points, faces=np.array(top + rest + floor, dtype=np.int64))


def edges_of(surface: Surface) -> set[frozenset[int]]:
    return {frozenset(pair) for pair in directed_edges(surface.faces).tolist()}


def roof(points: torch.Tensor) -> torch.Tensor:
    """Two slopes of 45 degrees that meet in the line y = 1, z = 1; nothing else is asked."""
    return (points[:, 1] - 1 + (points[:, 2] - 1).abs()) / 2**0.5


def test_a_wrong_diagonal_across_a_ridge_is_turned():
    wrong = ridge(far=False)
    assert not find_defects(wrong)
    turned = flip(wrong, roof, FlipConfig(rounds=1))

    assert frozenset((4, 5)) in edges_of(turned)
    assert frozenset((6, 7)) not in edges_of(turned)
    assert not find_defects(turned)
    assert np.array_equal(turned.vertices, wrong.vertices)


def test_the_right_diagonal_stays():
    assert frozenset((4, 5)) in edges_of(flip(ridge(far=True), roof))


def test_flips_lower_the_error_and_keep_the_surface_sound():
    turn = torch.tensor(axis_angle_to_matrix(np.array([[0.5, 0.3, 0.4]]))[0], dtype=torch.float32)
    field = box((0.5, 0.4, 0.3), turn)
    small = simplify(extract(field, BOX, ExtractConfig(resolution=64)), SimplifyConfig(target_faces=600))
    turned = flip(small, field)

    assert surface_error(turned, field).mean_mm < surface_error(small, field).mean_mm
    assert (smallest_angles(turned) < 5).sum() <= (smallest_angles(small) < 5).sum()
    assert len(turned.faces) == len(small.faces)
    assert not find_defects(turned)


def test_a_good_sphere_is_left_alone():
    ball = icosphere(0.6, rounds=3)
    assert np.array_equal(flip(ball, sphere(0.6)).faces, ball.faces)


def test_what_a_diagonal_is():
    """Rise, area and angles of one edge against hand-made ones."""
    found = diagonals(ridge(far=False), largest_turn=-1.0)
    row = np.flatnonzero((np.sort(found.ends[:, :2], axis=1) == [6, 7]).all(axis=1))[0]

    assert set(found.ends[row, 2:].tolist()) == {4, 5}
    assert found.height[row] == pytest.approx(-0.5)  # the middle of the wrong diagonal lies so far inside
    assert found.area[row] == pytest.approx(5**0.5)
    assert found.angle[row] == pytest.approx(np.degrees(np.arccos(2 / 3)))
