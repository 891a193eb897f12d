"""Signed distances against a brute-force version and against analytic shapes."""

import igl
import numpy as np
import pytest
import trimesh

from avatargen.body.distance import BodyDistance
from avatargen.body.model import canonical_body
from avatargen.errors import FieldError, InputError
from avatargen.mesh.closest import ClosestPoints
from tests.bodies import capsule_body

MESHES = {
    "sphere": trimesh.creation.icosphere(subdivisions=2, radius=0.3),
    "torus": trimesh.creation.torus(0.3, 0.1, major_sections=24, minor_sections=12),
    "box": trimesh.creation.box((0.3, 0.4, 0.5)),  # sharp edges and corners
}


def brute_force(points: np.ndarray, vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Distance to every triangle in float64; sign by the generalised winding number."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    best = np.full(len(points), np.inf)
    for i, p in enumerate(points):
        ends = [segment(p, s, e) for s, e in ((a, b), (b, c), (c, a))]
        normal = np.cross(b - a, c - a)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        height = ((p - a) * normal).sum(axis=1)
        foot = p - height[:, None] * normal
        within = np.all(
            [(np.cross(e - s, foot - s) * normal).sum(axis=1) >= 0 for s, e in ((a, b), (b, c), (c, a))],
            axis=0,
        )
        best[i] = min(np.min(ends), np.where(within, np.abs(height), np.inf).min())
    inside = np.asarray(igl.winding_number(vertices, faces, points)) > 0.5
    return np.where(inside, -best, best)


def segment(point: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    axis = end - start
    along = np.clip(((point - start) * axis).sum(axis=1) / (axis**2).sum(axis=1), 0, 1)
    return np.linalg.norm(point - start - along[:, None] * axis, axis=1)


@pytest.mark.parametrize("name", MESHES)
def test_signed_distance_matches_brute_force(name: str):
    vertices, faces = np.asarray(MESHES[name].vertices), np.asarray(MESHES[name].faces, dtype=np.int64)
    points = np.random.default_rng(0).uniform(-0.6, 0.6, size=(1500, 3))
    hit = BodyDistance(vertices, faces).query(points)

    assert np.abs(hit.distance - brute_force(points, vertices, faces)).max() < 1e-6


@pytest.mark.parametrize("name", MESHES)
def test_the_closest_point_is_where_the_distance_says(name: str):
    vertices, faces = np.asarray(MESHES[name].vertices), np.asarray(MESHES[name].faces, dtype=np.int64)
    points = np.random.default_rng(1).uniform(-0.6, 0.6, size=(6000, 3))  # enough to be reordered inside
    hit = BodyDistance(vertices, faces).query(points)
    closest = (vertices[faces[hit.face]] * hit.barycentric[..., None]).sum(axis=1)

    assert np.abs(np.linalg.norm(points - closest, axis=1) - np.abs(hit.distance)).max() < 1e-6
    assert hit.barycentric.min() > -1e-6
    assert np.abs(hit.barycentric.sum(axis=1) - 1).max() < 1e-6


def test_order_does_not_matter():
    body = canonical_body(capsule_body())
    distance = BodyDistance(body.vertices, body.faces)
    points = np.random.default_rng(2).uniform(-0.8, 1.5, size=(9000, 3)).astype(np.float32)
    whole = distance.query(points)
    parts = [distance.query(part) for part in np.array_split(points, 9)]

    for name in ("distance", "face", "barycentric"):
        assert np.array_equal(getattr(whole, name), np.concatenate([getattr(part, name) for part in parts]))


def test_threads_do_not_show(monkeypatch: pytest.MonkeyPatch):
    """On a symmetric shape many points are as near to one face as to another."""
    mesh = MESHES["box"]
    distance = BodyDistance(np.asarray(mesh.vertices), np.asarray(mesh.faces, dtype=np.int64))
    points = np.round(np.random.default_rng(5).uniform(-0.3, 0.3, size=(50_000, 3)), 1)
    hits = []
    for threads in ("1", "3"):
        monkeypatch.setenv("OMP_NUM_THREADS", threads)
        hits.append(distance.query(points))
    assert np.array_equal(hits[0].face, hits[1].face)
    assert np.array_equal(hits[0].barycentric, hits[1].barycentric)


def test_as_exact_as_libigl():
    body = canonical_body(capsule_body())
    vertices = body.vertices.astype(np.float64)
    points = np.random.default_rng(6).uniform(-0.8, 1.5, size=(20_000, 3))
    tree = igl.AABB()
    tree.init(vertices, body.faces)
    squared = np.asarray(tree.squared_distance(vertices, body.faces, points)[0])
    found = ClosestPoints(vertices, body.faces).query(points)[0]
    assert np.abs(np.sqrt(found) - np.sqrt(squared)).max() < 1e-12


def test_a_point_on_a_vertex_is_at_zero():
    body = canonical_body(capsule_body())
    hit = BodyDistance(body.vertices, body.faces).query(body.vertices)
    assert np.abs(hit.distance).max() < 1e-7


def test_faces_without_area_do_no_harm():
    """Splitting an edge at a point adds a face without area; distances stay those of the mesh."""
    mesh = MESHES["box"]
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces, dtype=np.int64)
    a, b, c = faces[0]
    middle = (vertices[a] + vertices[b]) / 2
    m = len(vertices)
    split = np.concatenate([faces[1:], [[a, m, c], [m, b, c], [a, b, m]]])
    points = np.random.default_rng(3).uniform(-0.6, 0.6, size=(2000, 3))
    hit = BodyDistance(np.concatenate([vertices, [middle]]), split).query(points)

    assert np.abs(hit.distance - BodyDistance(vertices, faces).query(points).distance).max() < 1e-6
    assert np.isfinite(hit.barycentric).all()


def test_bad_input_is_refused():
    mesh = MESHES["box"]
    distance = BodyDistance(np.asarray(mesh.vertices), np.asarray(mesh.faces, dtype=np.int64))
    assert distance.query(np.zeros((0, 3))).distance.shape == (0,)
    with pytest.raises(FieldError, match="NaN"):
        distance.query(np.array([[0.0, np.nan, 0.0]]))
    with pytest.raises(InputError, match="no faces"):
        BodyDistance(np.asarray(mesh.vertices), np.zeros((0, 3), dtype=np.int64))
