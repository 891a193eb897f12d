import numpy as np
import pytest
from shapes import BOX, PERSON_BOX, box, icosphere, join, person, sphere, torus, union

from assets.isosurface.adaptive import trace_adaptively
from assets.isosurface.extract import ExtractConfig, extract
from assets.mesh.measure import surface_error
from assets.mesh.quadric import best_point, face_quadrics
from assets.mesh.surface import Surface, find_defects, smallest_angles, volume
from assets.simplify.decimate import decimate
from assets.simplify.simplify import collapse_carefully


def contoured(sdf, bounds, resolution=128, faces=3000):
    return trace_adaptively(sdf, bounds, ExtractConfig(resolution=resolution), faces).surface


@pytest.mark.parametrize("target", [4, 50, 301, 1500, 5000])
def test_the_number_of_faces_is_met(target):
    few = decimate(icosphere(rounds=5), target)
    assert len(few.faces) == target - target % 2
    assert not find_defects(few)
    if target > 4:
        assert np.abs(np.linalg.norm(few.vertices, axis=1) - 1).max() < (0.15 if target == 50 else 0.03)


@pytest.mark.parametrize(
    ("sdf", "bounds", "holes"), [(torus(), BOX, 1), (person(), PERSON_BOX, 0)], ids=["torus", "person"]
)
@pytest.mark.parametrize("target", [100, 1000])
def test_topology_and_volume_are_kept(sdf, bounds, holes, target):
    dense = contoured(sdf, bounds)
    few = decimate(dense, target)
    assert len(few.faces) == target
    assert not find_defects(few)
    assert len(few.vertices) - len(few.faces) // 2 == 2 - 2 * holes
    assert volume(few) == pytest.approx(volume(dense), rel=0.2 if target == 100 else 0.01)


@pytest.mark.parametrize(
    ("sdf", "bounds"),
    [(torus(), BOX), (person(), PERSON_BOX), (union(sphere(0.5), sphere(0.3, (0.5, 0, 0))), BOX)],
    ids=["torus", "person", "two balls"],
)
def test_it_is_as_near_as_slower_ways(sdf, bounds):
    """pymeshlab takes ten times as long."""
    dense = contoured(sdf, bounds)
    ours, others = (surface_error(way(dense, 1000), sdf) for way in (decimate, collapse_carefully))
    assert ours.mean_mm < 1.1 * others.mean_mm


def test_faces_are_not_too_thin():
    """But along straight limbs, where needles are nearest."""
    for faces in (1000, 6000):
        few = decimate(contoured(torus(), BOX, 256, faces), faces)
        assert (smallest_angles(few) < 5).mean() < 1e-3


def test_sharp_edges_stay():
    sdf = box((0.5, 0.4, 0.6))
    few = decimate(contoured(lambda points: sdf(points - 0.003), BOX), 200)
    assert volume(few) == pytest.approx(8 * 0.5 * 0.4 * 0.6, rel=0.01)
    assert surface_error(few, lambda points: sdf(points - 0.003)).mean_mm < 2


def test_a_quadric_is_the_area_times_the_squared_distance():
    surface = icosphere(rounds=1)
    quadric = face_quadrics(surface.vertices, surface.faces)
    corners = surface.vertices[surface.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(normal, axis=1) / 2
    at = np.array([0.3, -0.2, 0.9])
    distance = np.einsum("fd,fd->f", at - corners.mean(axis=1), normal) / (2 * area)
    symmetric = np.zeros((len(quadric), 4, 4))
    symmetric[:, *np.triu_indices(4)] = quadric
    symmetric += np.triu(symmetric, 1).transpose(0, 2, 1)
    found = np.einsum("i,vij,j->v", [*at, 1.0], symmetric, [*at, 1.0])
    wanted = np.zeros(len(quadric))
    np.add.at(wanted, surface.faces, (area * distance**2)[:, None])
    assert found == pytest.approx(wanted, abs=1e-14)


def test_the_best_point_is_where_the_planes_meet():
    """Against a dense solve, and beside it where three planes are all one."""
    rng = np.random.default_rng(0)
    ends, planes = rng.normal(size=(2, 3)), rng.normal(size=(5, 4))
    both = planes.T @ planes
    quadric = np.stack([both[np.triu_indices(4)], np.zeros(10)])
    *point, error = best_point.py_func(quadric, ends, 0, 1, 1e-12)
    assert point == pytest.approx(np.linalg.solve(both[:3, :3], -both[:3, 3]), abs=1e-6)
    assert error == pytest.approx([*point, 1] @ both @ [*point, 1], abs=1e-9)
    flat = np.outer([0, 0, 1, -2.0], [0, 0, 1, -2.0])
    quadric = np.stack([flat[np.triu_indices(4)], flat[np.triu_indices(4)]])
    x, y, z, error = best_point.py_func(quadric, ends, 0, 1, 1e-4)
    assert (x, y) == pytest.approx(ends.mean(axis=0)[:2])
    assert z == pytest.approx(2, abs=1e-3)


def test_what_is_not_closed_comes_back_as_it_is():
    ball = icosphere(rounds=3)
    open_ball = Surface(vertices=ball.vertices, faces=ball.faces[1:])
    assert decimate(open_ball, 100) is open_ball


def test_it_stops_where_nothing_may_go():
    tetrahedra = decimate(join(icosphere(rounds=1), icosphere(0.5, rounds=1)), 4)
    assert len(tetrahedra.faces) == 8
    assert not find_defects(tetrahedra, components=2).bad_edges


def test_faces_of_no_area_do_not_stop_it():
    dense = extract(lambda points: points.abs().amax(dim=1) - 0.5, BOX, ExtractConfig(resolution=32))
    few = decimate(dense, 400)
    assert len(few.faces) == 400
    assert not find_defects(few).bad_edges


def test_same_input_same_bytes():
    dense = contoured(person(), PERSON_BOX)
    first, second = decimate(dense, 500), decimate(dense, 500)
    assert first.vertices.tobytes() == second.vertices.tobytes()
    assert first.faces.tobytes() == second.faces.tobytes()


def test_where_more_counts_more_faces_are_left():
    """Of a ball whose upper half weighs eight times as much, that half keeps about twice the faces."""
    ball = icosphere(rounds=5)
    up = decimate(ball, 1500, importance=lambda points: np.where(points[:, 1] > 0, 8.0, 1.0))
    middles = up.vertices[up.faces].mean(axis=1)
    share = (middles[:, 1] > 0).mean()
    assert not find_defects(up) and 0.62 < share < 0.71
