"""Patches of faces that face much the same way."""

import numpy as np
import pytest
from shapes import icosphere

from assets.mesh.surface import normals_of, opposite_edges
from assets.skin.skin import connected_regions
from assets.texture.patches import find_patches

BALL = icosphere(rounds=4)
TWIN = opposite_edges(BALL.faces, len(BALL.vertices))
EVERY = np.ones(len(BALL.faces), dtype=bool)


@pytest.mark.parametrize("widest", [60.0, 30.0])
def test_faces_of_a_patch_are_neighbours_that_face_one_way(widest):
    patch = find_patches(BALL, TWIN, EVERY, widest, fewest=1)
    normals = normals_of(BALL.vertices[BALL.faces])
    for one in range(patch.max() + 1):
        mine = normals[patch == one]
        mean = mine.sum(axis=0) / np.linalg.norm(mine.sum(axis=0))
        # grown about the mean of a first try: it may be off its own by a little
        assert (mine @ mean > np.cos(np.radians(widest + 25)) * np.linalg.norm(mine, axis=1)).all()
    edge = np.flatnonzero(TWIN >= 0)
    region = connected_regions(patch, edge // 3, TWIN[edge] // 3)
    assert region.max() == patch.max()


def test_few_faces_join_a_neighbour():
    count = np.bincount(find_patches(BALL, TWIN, EVERY, 30.0, fewest=1))
    joined = np.bincount(find_patches(BALL, TWIN, EVERY, 30.0, fewest=12))
    assert count.min() < 12 <= joined.min()


def test_faces_that_are_not_chosen_are_left_alone():
    chosen = BALL.vertices[BALL.faces].mean(axis=1)[:, 1] > 0.5
    patch = find_patches(BALL, TWIN, chosen, 0.0, fewest=1)
    assert len(patch) == chosen.sum() and len(np.unique(patch)) == len(patch)
