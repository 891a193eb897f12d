import functools
from dataclasses import dataclass, replace

import numpy as np
import pytest
import torch
from bodies import capsule_body

from assets import (
    Asset,
    BuildConfig,
    ExtractConfig,
    PlainAsset,
    TexturedAsset,
    build,
    build_content,
    extract,
    stages,
)
from assets.asset.asset import AssetInfo, Skeleton
from assets.asset.joints import drop_idle_joints
from assets.draft import open_draft
from assets.errors import BoundsError, GeometryError
from assets.isosurface.extract import GROWTHS, ROOM, trace, trace_whole
from assets.mesh.surface import Surface, find_defects
from assets.pipeline import STAGES, plan_for
from assets.skin.attach import attach
from assets.skin.hang import hang
from assets.skin.skin import SkinConfig, skin_attached
from avatargen.body.distance import BodyDistance
from avatargen.body.model import CanonicalBody, canonical_body, forward_kinematics, from_rest_joints
from avatargen.body.pose import axis_angle_to_matrix, named_pose
from avatargen.body.skinning import skin as skin_points
from avatargen.errors import FieldError, InputError
from tests.figure import without_weight_on

SMALL = BuildConfig(resolution=128, faces=2000, texture=128)


@dataclass(frozen=True)
class Stranger:
    """An avatar without a network: the capsule body, a little thicker, coloured by place."""

    body: CanonicalBody
    distance: BodyDistance
    betas: np.ndarray
    info: AssetInfo
    thickness: float = 0.01

    @property
    def bounds(self):
        low, high = self.body.vertices.min(axis=0) - 0.06, self.body.vertices.max(axis=0) + 0.06
        return np.stack([low, high])

    def sdf(self, points):
        return torch.from_numpy(self.distance.query(points.numpy()).distance) - self.thickness

    def color(self, points):
        return 0.5 + 0.3 * torch.sin(3 * points)


@functools.cache
def stranger():
    body = canonical_body(capsule_body())
    info = AssetInfo(seed=3, weights_hash="ab" * 32, version="0.1.0", licence="CC0-1.0")
    betas = np.array([1.0, -0.5, 0.25], dtype=np.float32)
    return Stranger(body, BodyDistance(body.vertices, body.faces), betas, info)


@functools.cache
def built(pose="a"):
    return build(stranger(), replace(SMALL, pose=pose))


def report_of(asset):
    assert asset.report is not None
    return asset.report


def welded_surface(asset, vertices=None):
    """The asset's mesh with its seams closed again, by the index it carries."""
    vertices = asset.vertices.astype(np.float64) if vertices is None else vertices
    welded = np.zeros((asset.welded.max() + 1, 3))
    welded[asset.welded] = vertices
    return Surface(vertices=welded, faces=asset.welded[asset.faces])


def test_an_asset_has_everything_asked_for():
    asset = built()
    assert abs(len(asset.faces) - 2000) <= 40
    assert asset.texture.shape == (128, 128, 3)
    assert asset.skeleton.joint_names == stranger().body.joint_names
    assert asset.info == replace(stranger().info, betas=(1.0, -0.5, 0.25))
    assert np.abs(np.linalg.norm(asset.normals, axis=1) - 1).max() < 1e-5
    assert asset.vertices[:, 1].min() == pytest.approx(0, abs=1e-6)
    assert not find_defects(welded_surface(asset))


def test_weights_are_those_of_where_the_vertices_end_up():
    """Charts are cut before vertices are placed a last time; weights are not."""
    asset = built()
    surface = welded_surface(asset, asset.canonical)
    body = stranger().body
    skin = hang(skin_attached(attach(surface, body), body, SkinConfig()), surface, body)
    wanted = skin.dense(len(body.parents))[asset.welded]
    found = np.zeros_like(wanted)
    np.add.at(found, (np.arange(len(found))[:, None], asset.joints), asset.weights)
    assert np.quantile(np.abs(found - wanted).max(axis=1), 0.999) < 1e-4


def test_the_report_says_what_it_took():
    report = report_of(built())
    names = [name for name, _ in report.seconds]
    assert names == [
        *("extract", "clean", "simplify", "charts", "fit", "skin", "measure", "rest", "atlas"),
        "bake",
    ]
    assert report.total_seconds == pytest.approx(sum(dict(report.seconds).values()))
    assert 0 < report.error.mean_mm < report.error.p99_mm < report.error.max_mm < 20
    assert report.error.mean_mm < 0.6
    assert any("deformation network" in item.what for item in report.left_out)
    assert report.queries > 0


def test_every_stage_runs_for_someone_and_is_accounted_for_where_it_does_not():
    names = [stage.name for stage in STAGES]
    assert len(set(names)) == len(names)
    assert plan_for(BuildConfig(normal_map=64, ambient_occlusion=64)).names == tuple(names)
    least = plan_for(BuildConfig(content="mesh", faces=None))
    missing = [stage for item in least.left_out for stage in item.stages]
    assert sorted([*least.names, *missing]) == sorted(names)
    assert least.names == ("extract", "clean", "skin", "measure", "rest")
    assert least.share(0) == 0 and least.share(len(least.stages)) == 1


def test_same_avatar_same_arrays():
    first, second = build(stranger(), SMALL), build(stranger(), SMALL)
    for name in ("vertices", "normals", "uv", "faces", "joints", "weights", "texture", "welded"):
        assert np.array_equal(getattr(first, name), getattr(second, name)), name


def test_seams_stay_shut_in_any_pose():
    asset = built()
    turns = axis_angle_to_matrix(np.random.default_rng(0).normal(size=(24, 3)) * 0.3)
    rest = asset.skeleton.joints
    transforms = from_rest_joints(forward_kinematics(rest, turns, asset.skeleton.parents), rest)
    weights = np.zeros((len(asset.vertices), 24))
    np.add.at(weights, (np.arange(len(weights))[:, None], asset.joints), asset.weights)
    posed = skin_points(asset.vertices.astype(np.float64), weights, transforms)
    welded = welded_surface(asset, posed)
    np.testing.assert_allclose(welded.vertices[asset.welded], posed, rtol=0, atol=1e-12)  # m
    assert find_defects(welded).bad_edges == 0


def test_poses_by_name_and_by_rotations_agree():
    rotations = named_pose("t", stranger().body.joint_names)
    assert np.array_equal(built("t").vertices, build(stranger(), replace(SMALL, pose=rotations)).vertices)
    assert np.ptp(built("t").vertices[:, 0]) > 1.3 * np.ptp(built("a").vertices[:, 0])


def test_a_normal_map_is_made_on_request_alone():
    asset = build(stranger(), replace(SMALL, normal_map=64))
    assert asset.normal_map is not None
    assert asset.normal_map.texels.shape == (64, 64, 3)
    across = np.einsum("wd,wd->w", asset.normal_map.tangents[:, :3], asset.normals)
    assert np.abs(across).max() < 1e-5
    assert "normals" in dict(report_of(asset).seconds)
    assert "normal map" not in {item.what for item in report_of(asset).left_out}
    assert built().normal_map is None
    assert "normals" not in dict(report_of(built()).seconds)
    assert "normal map" in {item.what for item in report_of(built()).left_out}
    with pytest.raises(InputError, match="normal map"):
        replace(SMALL, content="mesh", normal_map=64)


def test_ambient_occlusion_is_made_on_request_alone():
    asset = build(stranger(), replace(SMALL, ambient_occlusion=64))
    assert asset.occlusion is not None
    assert asset.occlusion.shape == (64, 64)
    assert np.median(asset.occlusion) > 240
    assert asset.occlusion.min() < 128
    assert "occlusion" in dict(report_of(asset).seconds)
    assert "ambient occlusion" not in {item.what for item in report_of(asset).left_out}
    assert built().occlusion is None
    assert "ambient occlusion" in {item.what for item in report_of(built()).left_out}


@pytest.mark.parametrize("content", ["mesh", "textured"])
def test_what_is_left_out_is_not_there_and_the_rest_is_the_same(content):
    asset = build_content(stranger(), replace(SMALL, content=content))
    assert type(asset) is {"mesh": PlainAsset, "textured": TexturedAsset}[content]
    report = report_of(asset)
    assert ("bake" in dict(report.seconds)) == (content == "textured")
    assert {"skeleton and weights"} <= {item.what for item in report.left_out}
    assert np.array_equal(welded_surface(asset).vertices, welded_surface(built()).vertices)
    assert np.array_equal(welded_surface(asset).faces, welded_surface(built()).faces)


def test_every_face_is_kept_on_request():
    asset = build_content(stranger(), replace(SMALL, resolution=64, content="mesh", faces=None))
    dense = extract(stranger().sdf, stranger().bounds, ExtractConfig(resolution=64))
    assert len(asset.faces) == len(dense.faces)
    assert not {"simplify", "fit"} & set(dict(report_of(asset).seconds))


def test_idle_joints_go_and_nothing_moves_otherwise():
    asset = built()
    full = without_weight_on(asset, 22, 23, 20)
    lean = drop_idle_joints(full)
    names = full.skeleton.joint_names
    assert names[20] == "left_wrist"
    assert set(names) - set(lean.skeleton.joint_names) == {names[22], names[23]}
    for old, name in enumerate(names):
        if name in lean.skeleton.joint_names:
            new = lean.skeleton.joint_names.index(name)
            parent, new_parent = full.skeleton.parents[old], lean.skeleton.parents[new]
            assert (parent < 0) == (new_parent < 0)
            assert parent < 0 or names[parent] == lean.skeleton.joint_names[new_parent]
            assert np.array_equal(full.skeleton.T_world_joint[old], lean.skeleton.T_world_joint[new])
    used = full.weights > 0
    moved_by = np.array(names)[full.joints], np.array(lean.skeleton.joint_names)[lean.joints]
    assert np.array_equal(moved_by[0][used], moved_by[1][used])


def test_charts_of_every_face_are_refused():
    with pytest.raises(InputError, match="faces"):
        BuildConfig(faces=None)
    with pytest.raises(InputError, match="build_content"):
        build(stranger(), replace(SMALL, resolution=48, content="mesh"))


def test_progress_is_told_of_every_stage():
    told = []
    build(stranger(), SMALL, progress=lambda stage, share: told.append((stage, share)))
    assert [stage for stage, _ in told] == [name for name, _ in report_of(built()).seconds]
    shares = [share for _, share in told]
    assert shares[0] == 0
    assert shares == sorted(shares)
    assert shares[-1] < 1


def test_more_faces_than_there_are_is_said():
    asset = build(stranger(), BuildConfig(resolution=64, faces=50_000, texture=64))
    assert len(asset.faces) < 50_000
    assert any("only" in item.why for item in report_of(asset).left_out)


@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        ({"thickness": -1.0}, GeometryError, "no surface"),
        ({"thickness": 0.5}, GeometryError, "bounds"),
        ({"thickness": float("nan")}, FieldError, "NaN"),
        ({"betas": np.zeros(99, dtype=np.float32)}, InputError, "betas"),
    ],
)
def test_unusable_avatars(change, error, words):
    with pytest.raises(error, match=words):
        build(replace(stranger(), **change), SMALL)


@pytest.mark.parametrize("pose", ["y", np.zeros((3, 3)), np.full((24, 3), np.nan)])
def test_unusable_poses_fail_before_any_work(pose):
    with pytest.raises(InputError, match="pose"):
        build(replace(stranger(), thickness=float("nan")), replace(SMALL, pose=pose))


@pytest.mark.parametrize("values", [{"resolution": 1}, {"faces": 1}, {"texture": 1}, {"head_detail": 0.0}])
def test_settings_out_of_range(values):
    with pytest.raises(InputError):
        BuildConfig(**values)


@pytest.mark.parametrize("flaw", ["nan", "weights", "joints", "uv", "faces"])
def test_an_asset_checks_its_parts(flaw):
    asset = built()
    values = {name: getattr(asset, name).copy() for name in ("vertices", "weights", "joints", "uv", "faces")}
    if flaw == "nan":
        values["vertices"][0, 0] = np.nan
    if flaw == "weights":
        values["weights"][0] *= 0.5
    if flaw == "joints":
        values["joints"][0, 0] = 24
    if flaw == "uv":
        values["uv"][0, 0] = 1.5
    if flaw == "faces":
        values["faces"][0, 0] = len(asset.vertices)
    with pytest.raises(GeometryError, match="asset"):
        replace(asset, **values)


def test_a_skeleton_checks_its_parts():
    transforms = np.tile(np.eye(4), (2, 1, 1))
    with pytest.raises(GeometryError, match="parent"):
        Skeleton(joint_names=("a", "b"), parents=np.array([1, -1]), T_world_joint=transforms)
    with pytest.raises(GeometryError, match="names"):
        Skeleton(joint_names=("a",), parents=np.array([-1, 0]), T_world_joint=transforms)


def test_public_names():
    import assets

    assert sorted(assets.__all__) == sorted(
        [
            *("Asset", "BuildConfig", "ExtractConfig", "GeometryError", "PlainAsset", "SCENES", "Surface"),
            *("TexturedAsset", "animate", "build", "build_content", "choose_settings", "extract"),
            *("figure_of", "with_levels"),
        ]
    )
    assert assets.Asset is Asset


def ball(radius: float):
    """A sphere about the origin."""
    return lambda points: points.norm(dim=1) - radius


def test_bounds_grow_where_the_surface_leaves_them():
    config, low, wide = ExtractConfig(resolution=64), -0.72, -0.72 - 2 * ROOM
    short, enough = (np.array([[-1, -1, z], [1, 1, 1]]) for z in (low, wide))
    found, grown = trace_whole(ball(0.8), short, config), trace(ball(0.8), enough, config)
    assert not find_defects(found.surface)
    assert np.abs(found.surface.vertices - grown.surface.vertices).max() < 1e-12
    with pytest.raises(BoundsError, match="touches the bounds") as caught:
        trace(ball(0.8), short, config)
    assert caught.value.sides.tolist() == [[False, False, True], [False, False, False]]


def test_fewer_faces_left_take_fewer_questions_and_every_face_takes_all():
    few, many, every = (extracted(faces) for faces in (500, 20_000, None))
    assert few.queries < many.queries
    assert len(few.surface.faces) < len(many.surface.faces)
    exact = trace_whole(stranger().sdf, stranger().bounds, ExtractConfig(resolution=96))
    assert np.array_equal(every.surface.vertices, exact.surface.vertices)


def extracted(faces):
    config = BuildConfig(content="mesh", resolution=96, faces=faces)
    with open_draft(stranger(), config, charts=False) as draft:
        stages.extract(draft)
    return draft.extraction


def test_what_has_no_end_is_refused_after_a_few_bounds():
    bounds = np.array([[-1.0, -1, -1], [1, 1, 1]])
    with pytest.raises(BoundsError, match="give larger bounds"):
        trace_whole(ball(1.1 + GROWTHS * ROOM), bounds, ExtractConfig(resolution=32))
