"""Vertices laid on the field: curved surfaces in the mean, creases where their sides meet."""

import numpy as np
import pytest
import torch
from shapes import BOX, box, cylinder, icosphere, sphere, union

from assets.isosurface.extract import ExtractConfig, extract
from assets.mesh.measure import surface_error
from assets.mesh.surface import Surface, face_normals, find_defects, smallest_angles, volume
from assets.simplify.fit import FitConfig, best_moves, fit, tangent_planes
from assets.simplify.flip import flip
from assets.simplify.simplify import SimplifyConfig, simplify
from avatargen.body.pose import axis_angle_to_matrix

TURN = torch.tensor(axis_angle_to_matrix(np.array([[0.5, 0.3, 0.4]]))[0], dtype=torch.float32)
HALF = np.array([0.5, 0.4, 0.3])
CELL = 2 / 64  # metres


def coarse(field, faces: int) -> Surface:
    return simplify(extract(field, BOX, ExtractConfig(resolution=64)), SimplifyConfig(target_faces=faces))


def box_edges() -> np.ndarray:
    """Points along the twelve edges, metres."""
    corners = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T * HALF
    ends = [(a, b) for a in corners for b in corners if ((a < b).sum() == 1) and (a != b).sum() == 1]
    along = np.linspace(0.02, 0.98, 40)[:, None]
    return np.concatenate([(1 - along) * a + along * b for a, b in ends]) @ TURN.numpy().T


def rims() -> np.ndarray:
    angle = np.linspace(0, 2 * np.pi, 300)
    rim = np.stack([0.5 * np.cos(angle), 0.4 * np.ones(300), 0.5 * np.sin(angle)], axis=1)
    return np.concatenate([rim, rim * [1, -1, 1]]) @ TURN.numpy().T


def from_mesh(points: np.ndarray, surface: Surface) -> np.ndarray:
    """Distances, millimetres."""
    import igl

    points = np.ascontiguousarray(points, dtype=np.float64)
    return 1000 * np.sqrt(igl.point_mesh_squared_distance(points, surface.vertices, surface.faces)[0])


@pytest.mark.parametrize(
    ("field", "edges"),
    [(box(tuple(HALF.tolist()), TURN), box_edges()), (cylinder(0.5, 0.4, TURN), rims())],
    ids=["box", "cylinder"],
)
def test_creases_are_found_again(field, edges):
    before = coarse(field, 1500)
    after = before
    for _ in range(3):
        after = fit(flip(after, field), field)
    was, now = surface_error(before, field), surface_error(after, field)

    assert now.mean_mm < was.mean_mm / 4
    assert now.p99_mm < was.p99_mm / 6
    assert from_mesh(edges, before).mean() > 0.25 * 1000 * CELL  # marching cubes cut the edges off
    assert from_mesh(edges, after).mean() < 0.05 * 1000 * CELL
    assert not find_defects(after)
    assert 0.98 * 1500 <= len(after.faces) <= 1500


def test_one_round_on_two_spheres_halves_the_error():
    field = union(sphere(0.5, (-0.35, 0.0, 0.0)), sphere(0.5, (0.35, 0.0, 0.0)))
    before = coarse(field, 1500)
    after = fit(flip(before, field), field)

    assert surface_error(after, field).mean_mm < 0.55 * surface_error(before, field).mean_mm
    assert surface_error(after, field).p99_mm < 0.75 * surface_error(before, field).p99_mm
    assert not find_defects(after)


def test_spheres_keep_their_volume():
    before = coarse(sphere(), 800)
    after = fit(before, sphere())

    assert surface_error(after, sphere()).mean_mm < 0.75 * surface_error(before, sphere()).mean_mm
    assert not find_defects(after)
    assert volume(after) == pytest.approx(4 / 3 * np.pi * 0.6**3, rel=2e-3)


def test_planes_are_those_of_the_field():
    field = box(tuple(HALF.tolist()), TURN)
    planes = tangent_planes(coarse(field, 1500), field, uneven=0.2)
    local = np.abs(planes.normals.reshape(-1, 3) @ TURN.numpy())  # a side's is one axis

    assert np.linalg.norm(planes.normals, axis=2) == pytest.approx(1, abs=1e-6)
    assert (local.max(axis=1) > 0.98).mean() > 0.9  # but for points that an edge is nearest to


@pytest.mark.parametrize("damping", [0.2, FitConfig.damping])
def test_moves_are_the_least_squares_solution(damping):
    """Against a dense solve in float64; little damping leaves sliding along the surface nearly free."""
    ball = icosphere(0.6, rounds=1)
    planes = tangent_planes(ball, sphere(0.61), uneven=0.2)
    pattern = np.array([(4, 1, 1), (1, 4, 1), (1, 1, 4)]) / 6
    area = np.linalg.norm(face_normals(ball), axis=1)
    size = 3 * len(ball.vertices)
    square, wanted = np.zeros((size, size)), np.zeros(size)
    for f, face in enumerate(ball.faces):
        for s in range(3):
            row = np.zeros(size)
            for corner in range(3):
                row[3 * face[corner] : 3 * face[corner] + 3] += pattern[s, corner] * planes.normals[f, s]
            square += area[f] / area.mean() * np.outer(row, row)
            wanted -= area[f] / area.mean() * planes.residuals[f, s] * row
    held = np.repeat(np.diag(square).reshape(-1, 3).sum(axis=1), 3) * damping / 3 + 1e-9
    exact = np.linalg.solve(square + np.diag(held), wanted).reshape(-1, 3)

    assert (
        np.abs(best_moves(ball, planes, np.full(len(ball.vertices), damping)) - exact).max()
        < 5e-3 * np.abs(exact).max()
    )


def test_the_scale_of_the_field_does_not_matter():
    small = simplify(icosphere(rounds=4), SimplifyConfig(target_faces=400))
    plain, scaled = fit(small, sphere(1.0)), fit(small, lambda points: 7 * sphere(1.0)(points))
    assert np.abs(plain.vertices - scaled.vertices).max() < 1e-4


def test_no_face_turns_or_gets_thin():
    """A field that would fold the mesh: its zero level is a much smaller ball beside the mesh."""
    before = icosphere(0.6, rounds=3)
    for _ in range(2):
        after = fit(before, sphere(0.1, (0.5, 0.0, 0.0)))
        was, now = face_normals(before), face_normals(after)
        facing = (was * now).sum(axis=1) / np.linalg.norm(was, axis=1) / np.linalg.norm(now, axis=1)
        assert facing.min() > FitConfig.largest_turn
        assert smallest_angles(after).min() > FitConfig.thin
        before = after
