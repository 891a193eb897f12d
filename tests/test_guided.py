"""Charts along the seams of clothes: of the body itself, of people and of a stranger."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.ndimage import distance_transform_edt
from test_atlas import require_whole

import avatargen
from assets import charting
from assets.build_config import BuildConfig
from assets.charting import cut_along_seams, cut_charts
from assets.draft import open_draft
from assets.errors import GeometryError
from assets.mesh.surface import Surface, face_areas
from assets.pipeline import plan_for, run
from assets.simplify.simplify import SimplifyConfig, simplify
from assets.skin.attach import attach
from assets.skin.skin import SkinConfig, skin_attached
from assets.texture.atlas import Atlas, AtlasConfig, uv_areas
from assets.texture.bake import cover_texels
from assets.texture.pattern import HEAD, MOST_SIDES, NAMES, find_pattern, parts_of_joints, texel_scale
from assets.texture.seams import components
from assets.texture.stretch import measure_atlas
from avatargen.body.model import canonical_body
from tests.bodies import capsule_body

CONFIG = BuildConfig(resolution=128, faces=6000, texture=1024, content="textured")


@cache
def sampled(seed):
    return avatargen.load_generator().sample(seed)


@cache
def surface_of(who):
    """The canonical body itself, or the person of a seed."""
    if who == "body":
        body = sampled(0).body
        whole = Surface(vertices=body.vertices.astype(np.float64), faces=body.faces)
        return simplify(whole, SimplifyConfig(target_faces=8000))
    config = BuildConfig(content="mesh", resolution=CONFIG.resolution, faces=CONFIG.faces)
    with open_draft(sampled(who), config, charts=False) as draft:
        run(plan_for(config), draft)
    return draft.surface


@cache
def made(who):
    return cut_along_seams(surface_of(who), sampled(0).body, CONFIG)


def islands(atlas):
    """The island of each face."""
    sides = atlas.faces[:, [0, 1, 0, 2]].reshape(-1, 2)
    return components(len(atlas.uv), *sides.T)[1][atlas.faces[:, 0]]


@pytest.mark.parametrize("who", ["body", 0, 3])
class TestPeople:
    def test_every_face_has_its_own_room_and_none_is_turned_over(self, who):
        surface, atlas = surface_of(who), made(who)
        require_whole(surface, atlas)
        assert (uv_areas(atlas) < 0).all()  # v runs down: shown as seen from outside

    def test_few_islands_and_much_of_the_texture_is_used(self, who):
        surface, atlas = surface_of(who), made(who)
        pattern = find_pattern(surface, sampled(0).body)
        density = texel_scale(pattern.detail, CONFIG.head_detail)
        found = measure_atlas(surface, atlas, density)
        assert found.islands == len(np.unique(islands(atlas))) <= 40
        assert found.used > 0.57
        assert found.stretch < 1.03

    def test_face_and_each_hand_are_in_one_piece(self, who):
        surface, body = surface_of(who), sampled(0).body
        island = islands(made(who))
        face = find_pattern(surface, body).panel == MOST_SIDES * NAMES.index(HEAD)
        area = np.bincount(island[face], face_areas(surface)[face])
        assert area.max() > 0.95 * area.sum()  # but for an eye's or a mouth's inside
        skin = skin_attached(attach(surface, body), body, SkinConfig())
        part = skin.dense(len(body.joint_names)) @ np.eye(len(NAMES))[parts_of_joints(body)]
        for side in ("left", "right"):
            share = part[surface.faces, NAMES.index(f"{side}_hand")].min(axis=1)
            found, count = np.unique(island[share > 0.9], return_counts=True)
            assert count.max() > 0.97 * count.sum(), found

    def test_the_face_is_upright(self, who):
        surface, atlas = surface_of(who), made(who)
        face = find_pattern(surface, sampled(0).body).panel == MOST_SIDES * NAMES.index(HEAD)
        island = islands(atlas)
        vertex = np.unique(atlas.faces[island == np.bincount(island[face]).argmax()])
        height = surface.vertices[atlas.vertex_map[vertex], 1]
        u, v = ((height - height.mean()) @ (atlas.uv[vertex] - atlas.uv[vertex].mean(axis=0))).tolist()
        assert v < 0 and abs(u) < 0.05 * abs(v)

    def test_islands_keep_their_distance(self, who):
        """As many texels as padding asks for, and half as many from the border."""
        atlas, size = made(who), 512
        island = islands(atlas)
        face = cover_texels(atlas.uv[atlas.faces].astype(np.float64) * size, size)
        owner = np.where(face >= 0, island[face], -1)
        config = AtlasConfig(texture_size=CONFIG.texture)
        gap = size * config.padding / config.packing
        for one in np.unique(island):
            far = np.asarray(distance_transform_edt(owner != one))
            assert far[(owner >= 0) & (owner != one)].min() > gap - 1
        rows, columns = np.nonzero(owner >= 0)
        assert min(rows.min(), columns.min()) >= gap / 2 - 1
        assert max(rows.max(), columns.max()) <= size - gap / 2

    def test_same_input_same_arrays(self, who):
        again = cut_along_seams(surface_of(who), sampled(0).body, CONFIG)
        assert np.array_equal(again.uv, made(who).uv)
        assert np.array_equal(again.faces, made(who).faces)


def test_a_stranger_with_smpl_joints_has_seams_too_or_is_told_why_not():
    body = canonical_body(capsule_body())
    surface = simplify(
        Surface(vertices=body.vertices.astype(np.float64), faces=body.faces),
        SimplifyConfig(target_faces=3000),
    )
    atlas = cut_charts(surface, body, CONFIG)
    require_whole(surface, atlas)
    assert atlas.plain == ""
    assert atlas.unguided or len(np.unique(islands(atlas))) <= 40


def test_where_a_panel_fails_xatlas_cuts_its_own(monkeypatch):
    def fail(*args):
        raise GeometryError("atlas: a panel does not become a disk")

    monkeypatch.setattr(charting, "guided_atlas", fail)
    atlas = cut_charts(surface_of("body"), sampled(0).body, CONFIG)
    require_whole(surface_of("body"), atlas)
    assert "disk" in atlas.unguided
    assert atlas.plain == ""


def test_a_body_without_the_joints_is_told_so():
    body = canonical_body(capsule_body())
    names = tuple(name.replace("left_knee", "left_leg") for name in body.joint_names)
    with pytest.raises(GeometryError, match="left_knee"):
        find_pattern(surface_of("body"), replace(body, joint_names=names))


def test_stretch_is_that_of_the_map():
    """Of a square whose texture is twice as wide as high."""
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=np.float64)
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    uv = (square[:, :2] * [0.8, -0.4] + [0.1, 0.9]).astype(np.float32)
    atlas = Atlas(vertex_map=np.arange(4), uv=uv, faces=faces)
    found = measure_atlas(Surface(vertices=square, faces=faces), atlas, np.ones(2))
    assert found.islands == 1
    assert found.stretch == pytest.approx(np.sqrt(0.5 * (0.5 + 2)), rel=1e-5)
    assert found.shear_p99 == pytest.approx(2, rel=1e-5)
    assert found.used == pytest.approx(0.32, abs=0.01)
