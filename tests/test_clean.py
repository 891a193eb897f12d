import numpy as np
import pytest
from shapes import BOX, icosphere, join, sphere, union

from assets.errors import GeometryError
from assets.isosurface.extract import ExtractConfig, extract
from assets.mesh.clean import clean
from assets.mesh.repair import repair
from assets.mesh.surface import Surface, find_defects, volume


def with_faces(surface, faces):
    return Surface(vertices=surface.vertices, faces=np.asarray(faces, dtype=np.int64))


def shifted(surface, offset):
    return Surface(vertices=surface.vertices + offset, faces=surface.faces)


def test_largest_of_two_spheres_is_kept():
    both = extract(union(sphere(0.4), sphere(0.1, (0.7, 0, 0))), BOX, ExtractConfig(resolution=64))
    result = clean(both)

    assert result.dropped_components == 1
    assert result.repaired == ""
    assert not find_defects(result.surface)
    assert np.abs(np.linalg.norm(result.surface.vertices, axis=1) - 0.4).max() < 1e-3


def test_inner_shell_is_dropped():
    inner = icosphere(0.5)
    result = clean(join(icosphere(1.0), with_faces(inner, inner.faces[:, ::-1])))
    assert result.dropped_components == 1
    assert volume(result.surface) == pytest.approx(4 / 3 * np.pi, rel=0.02)


def test_a_sound_surface_is_untouched():
    ball = icosphere()
    assert clean(ball).surface is ball


def test_inward_faces_are_turned():
    ball = icosphere()
    assert volume(clean(with_faces(ball, ball.faces[:, ::-1])).surface) > 0


@pytest.mark.parametrize("flaw", ["hole", "duplicate", "sliver", "fin", "flipped", "pinch", "loose vertex"])
def test_flaws_are_repaired(flaw):
    ball = icosphere()
    faces, vertices = ball.faces, ball.vertices
    if flaw == "hole":
        faces = faces[1:]
    if flaw == "duplicate":
        faces = np.concatenate([faces, faces[:1]])
    if flaw == "sliver":  # a face without area, closed by splitting an edge on one side
        vertices = np.concatenate([vertices, vertices[faces[:1, :2]].mean(axis=1)])
        new = len(vertices) - 1
        a, b, c = faces[0]
        faces = np.concatenate([faces[1:], [[a, new, c], [new, b, c], [a, b, new]]])
    if flaw == "fin":
        vertices = np.concatenate([vertices, [[0.0, 0.0, 2.0]]])
        faces = np.concatenate([faces, [[*faces[0, :2], len(vertices) - 1]]])
    if flaw == "flipped":
        faces = np.concatenate([faces[:5, ::-1], faces[5:]])
    if flaw == "pinch":  # a second, smaller ball that shares one vertex
        small = shifted(icosphere(0.5), vertices[0] * 1.0)
        small = shifted(small, vertices[0] - small.vertices[0])
        moved = np.where(small.faces == 0, 0, small.faces + len(vertices))
        vertices, faces = np.concatenate([vertices, small.vertices]), np.concatenate([faces, moved])
    if flaw == "loose vertex":
        vertices = np.concatenate([vertices, [[0.0, 0.0, 2.0]]])
    flawed = Surface(vertices=vertices, faces=faces.astype(np.int64))
    assert find_defects(flawed)

    cleaned = clean(flawed).surface

    assert not find_defects(cleaned)
    assert volume(cleaned) == pytest.approx(4 / 3 * np.pi, rel=0.02)


@pytest.mark.parametrize("seed", range(5))
def test_mending_closes_any_soup(seed):
    rng = np.random.default_rng(seed)
    ball = icosphere(rounds=2)
    faces = ball.faces[rng.random(len(ball.faces)) > 0.1]
    twisted = rng.random(len(faces)) < 0.05
    faces = np.where(twisted[:, None], faces[:, ::-1], faces)
    crossing = rng.integers(0, len(ball.vertices), (20, 3))
    doubled = faces[rng.integers(0, len(faces), 10)]
    defects = find_defects(repair(with_faces(ball, np.concatenate([faces, crossing, doubled]))))
    assert (defects.bad_edges, defects.bad_vertices) == (0, 0)


def test_nothing_to_keep():
    with pytest.raises(GeometryError, match="no faces"):
        clean(Surface(vertices=np.zeros((0, 3)), faces=np.zeros((0, 3), dtype=np.int64)))


def test_a_single_triangle_cannot_be_closed():
    with pytest.raises(GeometryError, match="clean"):
        clean(Surface(vertices=np.eye(3), faces=np.array([[0, 1, 2]])))


def test_faces_must_name_vertices():
    with pytest.raises(GeometryError, match="name vertices"):
        Surface(vertices=np.eye(3), faces=np.array([[0, 1, 3]]))
