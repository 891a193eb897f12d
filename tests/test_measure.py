import numpy as np
import pytest
import torch
from shapes import icosphere, sphere

from assets.mesh.measure import (
    MeasureConfig,
    distances,
    missed_error,
    points_on,
    sample_surface,
    surface_error,
)
from assets.mesh.surface import Surface, face_areas
from avatargen.errors import FieldError


def test_a_concentric_sphere_is_off_by_the_difference_of_the_radii():
    error = surface_error(icosphere(0.5, rounds=5), sphere(0.503))
    assert error.mean_mm == pytest.approx(3.1, abs=0.1)  # chords lie up to .2 mm inside
    assert error.max_mm == pytest.approx(3.2, abs=0.1)


@pytest.mark.parametrize("scale", [0.3, 4.0])
def test_distance_is_measured_in_space_not_in_the_fields_own_units(scale):
    error = surface_error(icosphere(0.5, rounds=5), lambda points: scale * sphere(0.503)(points))
    assert error.mean_mm == pytest.approx(3.1, abs=0.1)


def test_curved_fields_are_followed_to_their_zero():
    def squared(points):  # |p|^2 - r^2: its slope changes on the way
        return (points.double().norm(dim=1) ** 2 - 0.503**2).float()

    assert surface_error(icosphere(0.5, rounds=5), squared).mean_mm == pytest.approx(3.1, abs=0.1)


def test_samples_are_even_over_the_area_and_repeatable():
    ball = icosphere(rounds=2)
    face, barycentric = sample_surface(ball, 20_000, seed=1)
    share = np.bincount(face, minlength=len(ball.faces)) / len(face)

    assert np.abs(share - face_areas(ball) / face_areas(ball).sum()).max() < 1e-3
    assert barycentric.min() >= 0
    assert barycentric.sum(axis=1) == pytest.approx(1)
    assert np.linalg.norm(points_on(ball, face, barycentric).mean(axis=0)) < 0.02
    assert np.array_equal(face, sample_surface(ball, 20_000, seed=1)[0])


def test_what_a_mesh_has_lost_is_seen_from_the_finer_surface_alone():
    """A ball without its second ball is exact where it is, and misses all that is farther."""
    ball, other = icosphere(0.5, rounds=4), icosphere(0.1, rounds=3)
    both = Surface(
        vertices=np.concatenate([ball.vertices, other.vertices + np.array([0.8, 0, 0])]),
        faces=np.concatenate([ball.faces, other.faces + len(ball.vertices)]),
    )
    assert missed_error(ball, both).max_mm == pytest.approx(1000 * (0.9 - 0.5), abs=1.0)
    assert missed_error(both, ball).max_mm < 1e-3


def test_nan_is_named():
    with pytest.raises(FieldError, match="NaN"):
        surface_error(
            icosphere(), lambda points: torch.full((len(points),), torch.nan), MeasureConfig(samples=10)
        )


def test_samples_on_flat_places_of_the_field_are_found_along_their_normals():
    def stepped(points):  # constant but for a thin layer at the surface: the gradient leads nowhere
        distance = sphere(0.503)(points)
        return distance.clamp(-0.001, 0.001)

    error = surface_error(icosphere(0.5, rounds=5), stepped)
    assert error.mean_mm == pytest.approx(3.1, rel=0.02)
    assert error.max_mm < 3.4


def test_a_zero_beside_the_line_is_found():
    """The gradient points along y and the normals lead astray, but the zero level is near."""

    def jump(points):
        return torch.sign(points.norm(dim=1) - 0.503) * (2 + points[:, 1])

    rng = np.random.default_rng(0)
    points, normals = rng.normal(size=(2, 300, 3))
    points *= 0.5 / np.linalg.norm(points, axis=1, keepdims=True)
    found = distances(points, normals, jump, MeasureConfig.step)

    assert found.min() > 0.003 - 1e-6
    assert found.max() < 0.003 * 1.15


def test_no_zero_in_reach_is_as_far_as_the_search_goes():
    error = surface_error(icosphere(), lambda points: torch.ones(len(points)), MeasureConfig(samples=50))
    assert error.max_mm == 50


def test_a_coarse_mesh_is_measured_with_few_questions_and_the_same_error():
    """Where the field rises as distances do, far samples are believed; some are looked at all the same."""
    asked = []

    def sphere(points):
        asked.append(len(points))
        return points.norm(dim=1) - 0.5

    coarse = icosphere(0.5, rounds=1)  # 8 to 35 mm inside
    samples = 3000
    error = surface_error(coarse, sphere, MeasureConfig(samples=samples))
    face, barycentric = sample_surface(coarse, samples, 0)
    exact = 1000 * (0.5 - np.linalg.norm(points_on(coarse, face, barycentric), axis=1))
    assert error.mean_mm == pytest.approx(exact.mean(), rel=0.01)
    assert error.max_mm == pytest.approx(exact.max(), rel=0.05)
    assert sum(asked) < 30 * samples  # 300 if each were sought all around
