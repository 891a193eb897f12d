import numpy as np
import pytest
from shapes import BOX, PERSON_BOX, icosphere, person, torus

from assets.isosurface.extract import ExtractConfig, extract
from assets.mesh.surface import find_defects, volume
from assets.simplify.simplify import SimplifyConfig, simplify
from avatargen.errors import InputError


@pytest.mark.parametrize("target", [50, 300, 1500, 5000])
def test_simplified_sphere_stays_a_sphere(target):
    small = simplify(icosphere(rounds=5), SimplifyConfig(target_faces=target))

    assert abs(len(small.faces) - target) <= max(0.02 * target, 2)
    assert not find_defects(small)
    assert np.abs(np.linalg.norm(small.vertices, axis=1) - 1).max() < (0.15 if target == 50 else 0.03)


@pytest.mark.parametrize(("target", "loss"), [(60, 0.25), (400, 0.05), (4000, 0.01)])
def test_simplified_person_keeps_its_volume_and_topology(target, loss):
    dense = extract(person(), PERSON_BOX, ExtractConfig(resolution=200))
    small = simplify(dense, SimplifyConfig(target_faces=target))

    assert not find_defects(small)
    assert len(small.vertices) - len(small.faces) // 2 == 2
    assert volume(small) == pytest.approx(volume(dense), rel=loss)


def test_simplified_torus_keeps_its_hole():
    small = simplify(extract(torus(), BOX, ExtractConfig(resolution=100)), SimplifyConfig(target_faces=200))
    assert not find_defects(small)
    assert len(small.vertices) == len(small.faces) // 2


def test_fewer_faces_than_the_target_come_back_unchanged():
    ball = icosphere(rounds=1)
    assert simplify(ball, SimplifyConfig(target_faces=1000)) is ball


def test_same_input_same_arrays():
    ball = icosphere(rounds=4)
    first, second = (simplify(ball, SimplifyConfig(target_faces=500)) for _ in range(2))
    assert np.array_equal(first.vertices, second.vertices)
    assert np.array_equal(first.faces, second.faces)


@pytest.mark.parametrize("target", [0, -5, 3])
def test_impossible_targets(target):
    with pytest.raises(InputError, match="at least 4"):
        SimplifyConfig(target_faces=target)
