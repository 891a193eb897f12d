import subprocess
from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np
import pytest
from shapes import BOX, PERSON_BOX, icosphere, person, torus

from assets.errors import GeometryError
from assets.isosurface.adaptive import trace_adaptively
from assets.isosurface.extract import ExtractConfig, extract
from assets.mesh.surface import Surface, face_areas
from assets.simplify.simplify import SimplifyConfig, simplify
from assets.texture import atlas as atlas_stage
from assets.texture import charts as charts_program
from assets.texture.atlas import Atlas, AtlasConfig, unwrap, uv_areas
from assets.texture.raster import rasterise
from avatargen.errors import InputError


def small_person(faces=1500):
    dense = trace_adaptively(person(), PERSON_BOX, ExtractConfig(resolution=128), faces).surface
    return simplify(dense, SimplifyConfig(target_faces=faces))


def parts_of(surface):
    middle = surface.vertices[surface.faces].mean(axis=1)
    return (2 * (middle[:, 0] > 0) + (middle[:, 1] > 0.5)).astype(np.int64)


def overlap(atlas, size=1024):
    """Share of covered pixels that lie well inside two faces."""
    count = np.zeros(size * size, dtype=np.int64)
    for fragments in rasterise(atlas.uv[atlas.faces].astype(np.float64) * size, size, size):
        inner = (fragments.barycentric > 1e-3).all(axis=1)
        np.add.at(count, fragments.pixel[inner], 1)
    return (count > 1).sum() / (count > 0).sum()


def require_whole(surface, atlas):
    assert np.array_equal(atlas.vertex_map[atlas.faces], surface.faces)
    assert set(atlas.vertex_map) == set(range(len(surface.vertices)))
    assert np.array_equal(np.unique(atlas.faces), np.arange(len(atlas.uv)))  # no vertex without a face
    assert atlas.uv.min() >= 0
    assert atlas.uv.max() <= 1
    assert overlap(atlas) < 1e-4


@pytest.mark.parametrize("shape", ["sphere", "torus", "person"])
def test_every_face_has_its_own_room(shape):
    surface = {
        "sphere": lambda: icosphere(rounds=3),
        "torus": lambda: simplify(
            extract(torus(), BOX, ExtractConfig(resolution=64)), SimplifyConfig(target_faces=900)
        ),
        "person": small_person,
    }[shape]()
    atlas = unwrap(surface, parts_of(surface))
    require_whole(surface, atlas)
    assert atlas.plain == ""
    assert len(atlas.uv) < 2 * len(surface.vertices)


def test_charts_do_not_cross_parts():
    surface = icosphere(rounds=3)
    parts = parts_of(surface)
    atlas = unwrap(surface, parts)
    owner = np.full(len(atlas.uv), -1)
    for part in np.unique(parts):
        used = np.unique(atlas.faces[parts == part])
        assert (owner[used] == -1).all()
        owner[used] = part


def test_density_is_even_but_for_the_parts_that_ask_for_more():
    surface = icosphere(rounds=4)
    parts = parts_of(surface)
    atlas = unwrap(surface, parts, AtlasConfig(scales=((1, 2.0),)))
    density = np.sqrt(np.abs(uv_areas(atlas)) / face_areas(surface))
    fine, plain = density[parts == 1], density[parts != 1]
    assert np.median(fine) == pytest.approx(2 * np.median(plain), rel=0.1)
    assert np.quantile(plain, 0.9) < 1.5 * np.quantile(plain, 0.1)


def with_a_sliver(surface):
    """The surface with a face of nearly no area, between an edge's two faces: the same bits anywhere."""
    a, b, c = surface.faces[0]
    vertices = np.round(surface.vertices * 2.0**12) / 2.0**12
    middle = vertices[[a, b]].mean(axis=0)
    tip = middle + 2.0**-20 * (vertices[c] - middle)
    m = len(vertices)
    return Surface(
        vertices=np.concatenate([vertices, tip[None]]),
        faces=np.concatenate([surface.faces[1:], [[a, m, c], [m, b, c], [a, b, m]]]),
    )


def test_a_face_that_xatlas_leaves_out_leaves_no_vertices_behind(monkeypatch):
    surface = with_a_sliver(icosphere(rounds=3))
    before = []
    add_left_out = atlas_stage.add_left_out

    def watched(surface, atlas, largest):
        before.append(atlas)
        return add_left_out(surface, atlas, largest)

    monkeypatch.setattr(atlas_stage, "add_left_out", watched)
    atlas = unwrap(surface, parts_of(surface))
    assert atlas.plain == ""
    assert np.flatnonzero(uv_areas(before[0]) == 0).tolist() == [len(surface.faces) - 1]
    assert len(atlas.uv) == len(before[0].uv) - 3 + 1  # its three are dropped, its tip is new
    require_whole(surface, atlas)


def replace_program(monkeypatch, tmp_path, lines):
    program = tmp_path / "program.py"
    program.write_text("\n".join(["import os", "import runpy", "import sys", *lines]))
    monkeypatch.setattr(atlas_stage, "charts_program", SimpleNamespace(__file__=program))


@pytest.mark.parametrize("failure", ["slow", "crash", "nonsense"])
def test_when_xatlas_fails_faces_are_packed_one_by_one(monkeypatch, tmp_path, failure):
    surface = icosphere(rounds=2)
    if failure == "crash":
        replace_program(monkeypatch, tmp_path, ["os.abort()"])
    else:
        error = GeometryError("atlas: xatlas changed the faces")
        if failure == "slow":
            error = subprocess.TimeoutExpired("xatlas", 1.0)
        monkeypatch.setattr(atlas_stage, "run_xatlas", Mock(side_effect=error))
    atlas = unwrap(surface, parts_of(surface))
    assert atlas.plain
    require_whole(surface, atlas)
    assert len(atlas.uv) == 3 * len(surface.faces)


def test_a_crash_is_tried_again(monkeypatch, tmp_path):
    surface = icosphere(rounds=2)
    whole = unwrap(surface, parts_of(surface))
    crash_once = [
        f"mark = {str(tmp_path / 'crashed')!r}",
        "if not os.path.exists(mark):",
        "    open(mark, 'w').close()",
        "    os.abort()",
        f"runpy.run_path({charts_program.__file__!r}, run_name='__main__')",
    ]
    replace_program(monkeypatch, tmp_path, crash_once)
    atlas = unwrap(surface, parts_of(surface))
    assert atlas.plain == ""
    assert np.array_equal(atlas.uv, whole.uv)


def test_a_real_time_limit_ends_the_program():
    surface = icosphere(rounds=3)
    atlas = unwrap(surface, parts_of(surface), AtlasConfig(time_limit=1e-3))
    assert "timed out" in atlas.plain


def test_same_input_same_arrays():
    surface = small_person(800)
    first, second = (unwrap(surface, parts_of(surface)) for _ in range(2))
    assert np.array_equal(first.uv, second.uv)
    assert np.array_equal(first.vertex_map, second.vertex_map)
    assert np.array_equal(first.faces, second.faces)


@pytest.mark.parametrize("values", [{"texture_size": 2}, {"texture_size": 10**6}, {"scales": ((0, 0.0),)}])
def test_settings_out_of_range(values):
    with pytest.raises(InputError):
        AtlasConfig(**values)


def test_uv_outside_the_texture_are_refused():
    uv = np.array([[0, 0], [1, 0], [0, 1.5]], dtype=np.float32)
    with pytest.raises(GeometryError, match="0 to 1"):
        Atlas(vertex_map=np.arange(3), uv=uv, faces=np.array([[0, 1, 2]]))


def test_labels_must_fit_the_faces():
    with pytest.raises(GeometryError, match="label"):
        unwrap(icosphere(rounds=1), np.zeros(3, dtype=np.int64))
