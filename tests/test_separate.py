"""A person in parts: each closed and on one skeleton, none coming through another, in files as in memory."""

# USD's modules fill themselves when they load, so their names are unknown before.
# pyright: reportAttributeAccessIssue=false

import functools
import json
import subprocess
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import igl
import numpy as np
import pytest

from assets import BuildConfig
from assets.asset.asset import Asset, Part, apart
from assets.asset.drop import faces_left, without_hidden
from assets.asset.levels import with_levels
from assets.asset.parts import join, keep
from assets.errors import GeometryError
from assets.mesh.surface import Surface, count_pieces, find_defects
from assets.poke import depth_outside, poke_through, surface_of
from assets.separate import Hidden, build_parts
from assets.skin.attach import attach
from assets.skin.follow import Above, follow
from assets.skin.skin import SkinConfig, skin_attached
from avatargen.body.pose import named_pose
from avatargen.errors import InputError
from exporters.check_usd import check_usd
from exporters.check_vrm import check_vrm
from exporters.export import export
from exporters.read_glb import read_glb
from tests.layered import Dressed, Layer, person
from tests.shapes import icosphere
from tests.verdicts import JUDGES, blender_python, khronos_issues

CONFIG = BuildConfig(resolution=96, faces=2400, texture=64)
ARRAYS = ("vertices", "normals", "faces", "canonical", "joints", "weights")


def taken(asset: Asset) -> dict[str, Any]:
    """Its parts by name, with all that these may have."""
    return dict(apart(asset))


@functools.cache
def built(hidden: Hidden = "drop", pose="a", **settings) -> Any:
    return build_parts(person(), replace(CONFIG, pose=pose, **settings), hidden)


def canonical(part: Asset) -> Surface:
    return surface_of(replace(part, vertices=part.canonical))


def surely(layer: Layer, points: np.ndarray) -> np.ndarray:
    return layer.cover(points) == 1


def nearest(inner: Surface, outer: Surface) -> Any:
    """Of each vertex the corners and weights of the closest point of another surface, by libigl."""
    found: Any = igl.point_mesh_squared_distance(inner.vertices, outer.vertices, outer.faces)
    _, face, closest = found
    corners = outer.faces[face]
    a, b, c = (np.ascontiguousarray(outer.vertices[corners[:, k]]) for k in range(3))
    return corners, igl.barycentric_coordinates(np.ascontiguousarray(closest), a, b, c), closest


def in_pose(turns: dict[str, tuple[float, float, float]]) -> np.ndarray:
    names = built().skeleton.joint_names
    rotations = np.zeros((len(names), 3))
    for joint, degrees in turns.items():
        rotations[names.index(joint)] = np.radians(degrees)
    return rotations


@pytest.mark.parametrize("hidden", ["drop", "keep"])
def test_every_part_is_closed_and_the_faces_add_up(hidden):
    asset = built(hidden)
    parts = taken(asset)
    assert list(parts) == ["body", "shoes", "top"]
    assert abs(len(asset.faces) - 2400) <= 0.02 * 2400
    for name, part in parts.items():
        surface = canonical(part)
        pieces = count_pieces(surface)
        assert not find_defects(surface, pieces=pieces), name
        assert part.skeleton is asset.skeleton
        assert part.texture.shape == ((64, 64, 3) if name == "body" else (32, 32, 3))
    assert count_pieces(canonical(parts["shoes"])) == 2
    assert asset.vertices[:, 1].min() == pytest.approx(0, abs=1e-6)
    assert (count_pieces(canonical(parts["body"])) > 1) == (hidden == "drop")
    said = [each.what for each in asset.report.left_out]
    assert ("the body under clothes" in said) == (hidden == "drop")


def test_what_is_seen_gets_the_faces_that_what_is_hidden_had():
    kept, dropped = (taken(built(hidden)) for hidden in ("keep", "drop"))
    assert len(dropped["top"].faces) > 1.1 * len(kept["top"].faces)
    assert len(dropped["body"].faces) < len(kept["body"].faces)


@dataclass(frozen=True)
class Loose(Dressed):
    """The same person, whose layers know of nothing that they cover."""

    @property
    def layers(self):
        found = super().layers
        return {name: Bare(**vars(layer)) for name, layer in found.items()}


@dataclass(frozen=True)
class Bare(Layer):
    def cover(self, points):
        return np.zeros(len(points))


def test_what_is_hidden_stays_inside_as_it_moves_along():
    """The body kept under the shirt, which is 12 mm over it, in four poses; and as it would be by itself."""
    asset = built("keep")
    loose = build_parts(Loose(**vars(person())), CONFIG, "keep")
    covers = {name: partial(surely, layer) for name, layer in person().layers.items()}
    poses: tuple[dict[str, tuple[float, float, float]], ...] = (
        {},
        {"left_shoulder": (0, 0, 80), "right_shoulder": (0, 0, -80)},
        {"left_hip": (-90, 0, 0), "right_hip": (-90, 0, 0), "left_knee": (90, 0, 0)},
        {"left_hip": (-30, 0, 0), "right_hip": (25, 0, 0), "spine1": (15, 20, 0)},
    )
    for turns in poses:
        found = poke_through(asset, covers, in_pose(turns))
        alone = poke_through(loose, covers, in_pose(turns))
        assert set(found) == {"body"}
        assert found["body"].mean_mm <= max(0.02, 0.9 * alone["body"].mean_mm), turns


def test_depth_is_the_way_out_of_a_ball():
    ball = icosphere(1.0, 5)
    rng = np.random.default_rng(0)
    points = rng.normal(size=(500, 3))
    depth = depth_outside(points, ball)
    wanted = np.maximum(np.linalg.norm(points, axis=1) - 1, 0)
    assert np.abs(depth - wanted).max() < 0.002


def test_what_is_hidden_takes_the_weights_above_it_and_the_rest_keeps_its_own():
    body = person().body
    skin_of = lambda surface: skin_attached(attach(surface, body), body, SkinConfig())  # noqa: E731
    inner, outer = (canonical(taken(built("keep"))[name]) for name in ("body", "top"))
    own, above = skin_of(inner), skin_of(outer)
    share = (np.abs(inner.vertices[:, 0]) < 0.3).astype(np.float64)
    over = Above(surface=outer, skin=above, attachment=attach(outer, body), share=share)
    skin, carrier = follow(inner, own, attach(inner, body), [over], len(body.parents))
    free = share == 0
    assert np.allclose(skin.dense(24)[free], own.dense(24)[free], atol=2e-3)
    corners, shares, _ = nearest(inner, outer)
    there = np.einsum("vk,vkj->vj", shares, above.dense(24)[corners])
    follows = share == 1
    assert follows.sum() > 100 and free.sum() > 100
    assert np.abs(skin.dense(24)[follows] - there[follows]).sum(axis=1).mean() < 0.1  # four of them are kept
    ones = carrier.carry(np.ones((len(body.vertices), 1)))
    assert np.abs(ones - 1).max() < 1e-6


def test_nothing_hidden_changes_nothing_and_a_hole_is_closed_by_a_fan():
    part = taken(built("keep"))["body"]
    assert without_hidden(part, np.zeros(len(part.vertices), bool)) is part
    hidden = np.abs(part.canonical[:, 0]) < 0.25
    left = without_hidden(part, hidden)
    surface = canonical(left)
    assert not find_defects(surface, pieces=count_pieces(surface))
    welded = np.zeros(int(part.welded.max()) + 1, bool)
    welded[part.welded] = hidden
    assert len(left.faces) == faces_left(part.welded[part.faces], welded)
    assert np.abs(left.weights.sum(axis=1) - 1).max() < 1e-5


def test_parts_come_apart_as_they_were_joined():
    parts = taken(built(normal_map=32, ambient_occlusion=32, morphs=True))
    again = taken(join(parts))
    for name, part in parts.items():
        for field in (
            "vertices",
            "normals",
            "faces",
            "canonical",
            "joints",
            "weights",
            "texture",
            "occlusion",
        ):
            assert np.array_equal(getattr(part, field), getattr(again[name], field)), field
        assert np.abs(part.uv - again[name].uv).max() < 1e-6
        assert np.array_equal(part.normal_map.texels, again[name].normal_map.texels)
        assert np.array_equal(part.morphs[3].vertices, again[name].morphs[3].vertices)


@pytest.mark.parametrize("names", [{"top"}, {"shoes", "body"}, {"body", "shoes", "top"}])
def test_some_parts_are_kept_as_they_are(names):
    whole = built("keep", normal_map=32, ambient_occlusion=32, morphs=True)
    some, every = taken(keep(whole, names)), taken(whole)
    assert list(some) == [name for name in every if name in names]
    for name, part in some.items():
        for field in (*ARRAYS, "texture", "occlusion", "uv"):
            assert np.array_equal(getattr(part, field), getattr(every[name], field)), field
        assert np.array_equal(part.normal_map.tangents, every[name].normal_map.tangents)
        assert np.array_equal(part.morphs[3].vertices, every[name].morphs[3].vertices)
        assert find_defects(canonical(part)) == find_defects(canonical(every[name]))


def test_a_part_that_is_not_there_cannot_be_kept():
    with pytest.raises(InputError, match="found none of cape among body, shoes, top"):
        keep(built("keep"), {"cape"})


def test_every_sum_of_sliders_moves_all_parts_together():
    """A slider moves a shirt as it moves the skin beneath it."""
    asset = built("keep", morphs=True)
    parts = taken(asset)
    inner, outer = parts["body"], parts["top"]
    cover = surely(person().layers["top"], inner.canonical)
    corners, shares, _ = nearest(canonical(inner), canonical(outer))
    welded = np.zeros((int(outer.welded.max()) + 1, 3))
    welded[outer.welded] = outer.morphs[0].vertices
    above = np.einsum("vk,vkd->vd", shares, welded[corners])[inner.welded]
    assert cover.sum() > 100
    assert np.abs(inner.morphs[0].vertices - above)[cover].max() < 0.002  # m
    assert np.abs(above[cover]).max() > 0.005


@pytest.mark.parametrize(
    ("flaw", "words"),
    [
        (lambda parts: (parts[0], replace(parts[1], name="body"), parts[2]), "share a name"),
        (lambda parts: parts[:2], "one after another"),
        (lambda parts: (parts[1], parts[0], parts[2]), "one after another"),
    ],
)
def test_an_asset_checks_its_parts(flaw, words):
    asset = built()
    with pytest.raises(GeometryError, match=words):
        replace(asset, parts=flaw(asset.parts))


def test_what_is_of_one_mesh_is_refused(tmp_path):
    with pytest.raises(InputError, match="several parts"):
        with_levels(built(), [500])
    for name in ("a.obj", "a.gltf", "a.usda", "a.ply"):
        with pytest.raises(InputError, match="not parts"):
            export(built(), tmp_path / name)
    with pytest.raises(InputError, match="rigged"):
        build_parts(person(), replace(CONFIG, content="textured"))
    with pytest.raises(InputError, match="300 at least"):
        build_parts(person(), replace(CONFIG, faces=200))
    with pytest.raises(InputError, match="1 to 13"):
        join({str(n): taken(built())["top"] for n in range(14)})
    assert list(tmp_path.iterdir()) == []


def test_a_glb_holds_every_part_with_its_material_and_picture(tmp_path):
    asset = built(normal_map=32)
    export(asset, tmp_path / "a.glb")
    assert khronos_issues(tmp_path / "a.glb")["messages"] == []
    found = read_glb(tmp_path / "a.glb")
    assert isinstance(found, Asset)
    assert [part.name for part in found.parts] == ["body", "shoes", "top"]
    parts: Any = taken(found)
    for name, part in parts.items():
        wanted: Any = taken(asset)[name]
        assert np.array_equal(part.faces, wanted.faces)
        assert np.abs(part.vertices - wanted.vertices).max() < 1e-6
        assert np.array_equal(part.texture, wanted.texture)
        assert np.array_equal(part.normal_map.texels, wanted.normal_map.texels)
        assert np.abs(part.uv - wanted.uv).max() < 1e-6


def test_vrm_and_usd_hold_every_part(tmp_path):
    asset = built(pose="t")
    export(asset, tmp_path / "a.vrm")
    assert khronos_issues(tmp_path / "a.vrm")["numErrors"] == 0 and check_vrm(tmp_path / "a.vrm") == []
    export(asset, tmp_path / "a.usdz")
    assert check_usd(tmp_path / "a.usdz") == []


def test_usd_names_meshes_and_materials_by_their_parts(tmp_path):
    from pxr import Usd, UsdShade

    export(built(), tmp_path / "a.usdz")
    stage = Usd.Stage.Open(str(tmp_path / "a.usdz"))
    for part in built().parts:
        mesh = stage.GetPrimAtPath(f"/avatar/{part.name}")
        material, _ = UsdShade.MaterialBindingAPI(mesh).ComputeBoundMaterial()
        assert material.GetPath() == f"/avatar/{part.name}_material"
        assert len(mesh.GetAttribute("faceVertexCounts").Get()) == part.faces[1] - part.faces[0]


@pytest.mark.parametrize("name", ["a.glb", "a.usdz"])
def test_blender_bends_every_part_by_one_armature(name, tmp_path):
    python, asset = blender_python(), built()
    export(asset, tmp_path / name)
    command = [str(python), str(JUDGES / "blender_parts.py"), str(tmp_path / name), str(tmp_path / "o.json")]
    subprocess.run(command, check=True, capture_output=True, timeout=300)
    found = json.loads(Path(tmp_path / "o.json").read_text())
    assert found["armatures"] == 1
    assert set(found["meshes"]) == {part.name for part in asset.parts}
    for part in asset.parts:
        mesh = found["meshes"][part.name]
        assert mesh["bent"] and mesh["triangles"] == part.faces[1] - part.faces[0]
        assert len(mesh["materials"]) == 1 and mesh["materials"][0].startswith(part.name)
        assert len(mesh["images"]) == 1 and mesh["images"][0].startswith(part.name)


def test_a_part_must_have_faces_of_its_own():
    asset = built()
    first, *others = asset.parts
    short = Part(**{**vars(first), "faces": (0, 0)})
    longer = replace(others[0], faces=(0, others[0].faces[1]))
    with pytest.raises(GeometryError, match="other parts, or there are none"):
        replace(asset, parts=(short, longer, *others[1:]))


def test_a_part_rests_where_its_person_does():
    """Parts share the pose and the ground of the whole: shoes do not stand where the body alone would."""
    parts = taken(built("keep"))
    assert parts["top"].vertices[:, 1].min() > 0.8
    assert named_pose("a", built().skeleton.joint_names).shape == (24, 3)
