"""Thin faces go, the surface stays."""

import numpy as np
import pytest
from shapes import BOX, PERSON_BOX, icosphere, person, torus

from assets.extract import ExtractConfig, extract
from assets.slivers import SliverConfig, remove_slivers
from assets.surface import Surface, find_defects, smallest_angles, volume


def with_needles(count: int) -> Surface:
    """A ball with vertices pulled almost onto a neighbour."""
    ball = icosphere(0.6, rounds=4)
    vertices = ball.vertices.copy()
    for face in ball.faces[:: len(ball.faces) // count]:
        vertices[face[0]] = 0.97 * vertices[face[1]] + 0.03 * vertices[face[0]]
    return Surface(vertices=vertices, faces=ball.faces)


def test_needles_are_taken_out():
    spoilt = with_needles(12)
    assert (smallest_angles(spoilt) < 5).sum() >= 12
    mended = remove_slivers(spoilt)

    assert (smallest_angles(mended) < 5).sum() == 0
    assert 0.99 * len(spoilt.faces) <= len(mended.faces) < len(spoilt.faces)
    assert not find_defects(mended)
    assert volume(mended) == pytest.approx(volume(spoilt), rel=2e-3)


@pytest.mark.parametrize(("field", "bounds", "genus"), [(person(), PERSON_BOX, 0), (torus(), BOX, 1)])
def test_marching_cubes_lose_slivers_and_nothing_else(field, bounds, genus):
    dense = extract(field, bounds, ExtractConfig(resolution=100))
    mended = remove_slivers(dense, SliverConfig(largest_share=0.5, rounds=8))

    assert (smallest_angles(mended) < 5).mean() < 0.15 * (smallest_angles(dense) < 5).mean()
    assert not find_defects(mended)
    assert len(mended.vertices) - len(mended.faces) // 2 == 2 - 2 * genus
    assert volume(mended) == pytest.approx(volume(dense), rel=2e-3)


def test_a_sound_mesh_is_left_as_it_is():
    ball = icosphere(rounds=3)
    mended = remove_slivers(ball)
    assert np.array_equal(mended.faces, ball.faces)
    assert np.array_equal(mended.vertices, ball.vertices)
