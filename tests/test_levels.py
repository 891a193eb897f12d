"""Coarser levels on the vertices of the finest: closed, near, on the same texture and skeleton."""

from dataclasses import replace

import numpy as np
import pytest
from shapes import icosphere, sphere

from assets.asset.asset import PlainAsset, TexturedAsset
from assets.asset.level_mesh import signed_areas
from assets.asset.levels import at_level, level_error, with_levels
from assets.errors import GeometryError
from assets.mesh.measure import points_on, sample_surface
from assets.mesh.surface import Surface, compact, find_defects, opposite_edges, volume
from assets.texture.atlas import AtlasConfig, unwrap
from assets.texture.normal_map import NormalMap
from avatargen.errors import InputError
from tests.tube import tube
from tests.tube import welded as welded_tube


def textured_ball(rounds: int = 4) -> TexturedAsset:
    """A ball cut by xatlas into the charts of eight parts, so that seams meet in many places."""
    ball = icosphere(0.6, rounds=rounds)
    middles = ball.vertices[ball.faces].mean(axis=1)
    parts = (middles > 0) @ np.array([1, 2, 4])
    atlas = unwrap(ball, parts.astype(np.int64), AtlasConfig(texture_size=256))
    assert atlas.plain == ""
    vertices = ball.vertices[atlas.vertex_map].astype(np.float32)
    rig = tube()
    return TexturedAsset(
        vertices=vertices,
        normals=vertices / np.float32(0.6),
        faces=atlas.faces,
        uv=atlas.uv,
        texture=rig.texture,
        info=rig.info,
        welded=atlas.vertex_map,
        canonical=vertices,
    )


def welded(asset: PlainAsset, faces: np.ndarray) -> Surface:
    assert asset.welded is not None
    points = np.zeros((int(asset.welded.max()) + 1, 3))
    points[asset.welded] = asset.vertices
    return compact(points, asset.welded[faces])


def test_levels_of_a_ball_are_closed_and_near():
    ball = textured_ball()
    levelled = with_levels(ball, (2000, 800, 300))

    assert [len(level) for level in levelled.levels] == pytest.approx([2000, 800, 300], abs=1)
    for level, off in zip(levelled.levels, (0.02, 0.05, 0.12), strict=True):
        surface = welded(levelled, level)
        assert not find_defects(surface)
        assert volume(surface) == pytest.approx(4 / 3 * np.pi * 0.6**3, rel=off)


def test_the_finest_level_and_its_vertices_are_untouched():
    ball = textured_ball()
    levelled = with_levels(ball, (800, 300))
    first = len(ball.vertices)

    assert np.array_equal(levelled.faces, ball.faces)
    for name in ("vertices", "normals", "uv", "welded", "canonical"):
        assert np.array_equal(getattr(levelled, name)[:first], getattr(ball, name))
    added = np.arange(first, len(levelled.vertices))
    assert np.isin(added, np.concatenate(levelled.levels)).all()  # none is idle
    assert np.isin(levelled.vertices[added], ball.vertices).all()


def test_the_texture_stays_where_it_is():
    """What each level looks up at its corners and within its faces is what lies there on the ball."""
    ball = textured_ball()
    levelled = with_levels(ball, (1500,))
    level = levelled.levels[0]
    fine = ball.uv[ball.faces].astype(np.float64)
    kept = level[(level < len(ball.vertices)).all(axis=1)]
    assert len(kept) > 0.9 * len(level)
    coarse = levelled.uv[kept].astype(np.float64)
    nearest = np.linalg.norm(coarse.mean(axis=1)[:, None] - fine.mean(axis=1), axis=2).argmin(axis=1)
    same_way = np.sign(signed_areas(coarse)) == np.sign(signed_areas(fine))[nearest]
    assert same_way.mean() > 0.995  # no face is turned over in the texture, but for one or two at borders
    there = ball.vertices[ball.faces[nearest]].mean(axis=1)
    middle = ball.vertices[kept].mean(axis=1)
    middle *= 0.6 / np.linalg.norm(middle, axis=1, keepdims=True)
    assert np.quantile(np.linalg.norm(there - middle, axis=1), 0.95) < 0.08  # an edge is .07 m long


def test_seams_shrink_on_both_sides_together():
    """Every edge of a level has two faces once welded, also along the seam of a tube."""
    levelled = with_levels(welded_tube(tube(rings=20, sides=20)), (500, 200))
    assert levelled.welded is not None
    for level in levelled.levels:
        assert (opposite_edges(levelled.welded[level], int(levelled.welded.max()) + 1) >= 0).all()
        assert not find_defects(welded(levelled, level))
    assert levelled.weights.shape == levelled.joints.shape == (len(levelled.vertices), 4)
    seam = np.abs(levelled.uv[levelled.levels[1]][:, :, 0] - 0.5).max()
    assert seam == pytest.approx(0.5)  # the chart still ends at the seam


def test_a_vertex_that_a_level_adds_has_the_tangent_of_its_place_in_the_texture():
    ball = textured_ball()
    rows = np.arange(len(ball.vertices))
    tangents = np.stack([np.cos(rows), np.sin(rows), 0 * rows, 1 - 2 * (rows % 2)], axis=1)  # each its own
    mapped = replace(ball, normal_map=NormalMap(texels=ball.texture, tangents=tangents.astype(np.float32)))
    levelled = with_levels(mapped, (120,))
    assert levelled.normal_map is not None and mapped.normal_map is not None
    assert len(levelled.vertices) > len(rows)
    assert np.array_equal(levelled.normal_map.tangents[rows], mapped.normal_map.tangents)
    for uv, tangent in zip(levelled.uv[len(rows) :], levelled.normal_map.tangents[len(rows) :], strict=True):
        there = (ball.uv == uv).all(axis=1)
        assert (mapped.normal_map.tangents[there] == tangent).all(axis=1).any()


def test_a_level_alone_has_its_faces_and_no_vertex_more():
    levelled = with_levels(welded_tube(tube(rings=20, sides=20)), (500, 200))
    for number, faces in enumerate((levelled.faces, *levelled.levels)):
        alone = at_level(levelled, number)
        assert alone.levels == ()
        assert np.array_equal(np.unique(alone.faces), np.arange(len(alone.vertices)))
        for name in ("vertices", "normals", "uv", "joints", "weights", "welded"):
            assert np.array_equal(getattr(alone, name)[alone.faces], getattr(levelled, name)[faces]), name


def test_a_levels_error_is_that_of_its_faces_where_the_field_has_them():
    ball = with_levels(textured_ball(), (300,))
    moved = replace(ball, vertices=ball.vertices + np.float32(1))  # a pose changes nothing
    fine, coarse = (level_error(moved, faces, sphere(0.6)) for faces in (ball.faces, ball.levels[0]))
    inside = 1000 * (0.6 - np.linalg.norm(points_inside(ball, ball.levels[0]), axis=1))
    assert coarse.mean_mm == pytest.approx(inside.mean(), rel=0.05)
    assert coarse.mean_mm > 5 * fine.mean_mm
    with pytest.raises(GeometryError, match="not built from a field"):
        level_error(replace(ball, canonical=None), ball.faces, sphere(0.6))


def points_inside(asset: PlainAsset, faces: np.ndarray) -> np.ndarray:
    """Points spread over faces."""
    surface = welded(asset, faces)
    return points_on(surface, *sample_surface(surface, 4000, seed=1))


def test_without_a_texture():
    ball = textured_ball(rounds=3)
    parts = ("vertices", "normals", "faces", "info", "welded", "canonical")
    plain = PlainAsset(**{name: getattr(ball, name) for name in parts})
    assert not find_defects(welded(with_levels(plain, (300,)), with_levels(plain, (300,)).levels[0]))


@pytest.mark.parametrize("faces", [(5120,), (6000, 100), (300, 300), (200, 400), (400, 50)])
def test_numbers_that_make_no_sense(faces):
    with pytest.raises(InputError, match="falling numbers"):
        with_levels(textured_ball(), faces)


def test_a_mesh_with_holes_is_refused():
    ball = textured_ball(rounds=3)
    with pytest.raises(GeometryError, match="not closed"):
        with_levels(replace(ball, faces=ball.faces[1:]), (300,))


def test_same_asset_same_levels():
    first, second = (with_levels(textured_ball(rounds=3), (400,)) for _ in range(2))
    assert np.array_equal(first.levels[0], second.levels[0])
