"""USD files read back give what was put in, and USD's own validators and skinning agree with us."""

# USD's modules fill themselves when they load, so their names are unknown before.
# pyright: reportAttributeAccessIssue=false

import io
import os
import subprocess
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, UsdSkel, Vt

from assets.asset.asset import Asset
from exporters import export
from exporters.check_usd import check_usd
from exporters.file import File
from exporters.package import ALIGNMENT, HEADER, pack
from tests.figure import figure, in_motion
from tests.tube import chain, tube
from tests.usdskel import played_vertices, usdskel_vertices
from tests.verdicts import (
    AGREE,
    JUDGES,
    blender_python,
    blender_verdict,
    check_blender,
    our_vertices,
    random_poses,
)

SUFFIXES = [".usda", ".usdc", ".usdz"]


def opened(path: Path, **shape) -> Usd.Stage:
    export(tube(**shape), path)
    return Usd.Stage.Open(str(path))


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_what_was_written_is_read_back(tmp_path: Path, suffix: str) -> None:
    asset = tube(joint_count=3, tilt=0.4)
    stage = opened(tmp_path / f"tube{suffix}", joint_count=3, tilt=0.4)
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/avatar/mesh"))
    binding = UsdSkel.BindingAPI(mesh.GetPrim())

    np.testing.assert_array_equal(mesh.GetPointsAttr().Get(), asset.vertices)
    np.testing.assert_allclose(mesh.GetNormalsAttr().Get(), asset.normals, atol=1e-7)
    np.testing.assert_array_equal(np.reshape(mesh.GetFaceVertexIndicesAttr().Get(), (-1, 3)), asset.faces)
    st = np.asarray(UsdGeom.PrimvarsAPI(mesh).GetPrimvar("st").Get())
    np.testing.assert_allclose(st, asset.uv * [1, -1] + [0, 1], atol=1e-7)
    np.testing.assert_array_equal(np.reshape(binding.GetJointIndicesAttr().Get(), (-1, 4)), asset.joints)
    weights = np.reshape(binding.GetJointWeightsAttr().Get(), (-1, 4))
    np.testing.assert_allclose(weights, asset.weights, atol=1e-7)
    assert mesh.GetSubdivisionSchemeAttr().Get() == "none"
    assert mesh.GetOrientationAttr().Get() == "rightHanded"
    np.testing.assert_allclose(
        mesh.GetExtentAttr().Get(), [asset.vertices.min(axis=0), asset.vertices.max(axis=0)]
    )


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_skeleton_binds_and_rests(tmp_path: Path, suffix: str) -> None:
    expected = chain(4, tilt=0.3)
    stage = opened(tmp_path / f"tube{suffix}", joint_count=4, tilt=0.3)
    skeleton = UsdSkel.Skeleton(stage.GetPrimAtPath("/avatar/skeleton"))
    joints = skeleton.GetJointsAttr().Get()

    assert list(joints) == [
        "pelvis",
        "pelvis/spine1",
        "pelvis/spine1/spine2",
        "pelvis/spine1/spine2/spine3",
    ]
    assert list(skeleton.GetJointNamesAttr().Get()) == list(expected.joint_names)
    assert list(UsdSkel.Topology(joints).GetParentIndices()) == expected.parents.tolist()
    binds = np.asarray(skeleton.GetBindTransformsAttr().Get())
    np.testing.assert_allclose(binds.transpose(0, 2, 1), expected.T_world_joint, atol=1e-12)
    query = UsdSkel.Cache().GetSkelQuery(skeleton)
    np.testing.assert_allclose(query.ComputeJointSkelTransforms(0, atRest=True), binds, atol=1e-12)


def test_names_that_no_path_can_hold_stay_apart(tmp_path: Path) -> None:
    asset = tube(joint_count=3)
    parents, frames = np.array([-1, 0, 0]), asset.skeleton.T_world_joint
    skeleton = type(asset.skeleton)(
        joint_names=("rig:Hips", "rig:Leg", "rig Leg"), parents=parents, T_world_joint=frames
    )
    object.__setattr__(asset, "skeleton", skeleton)
    export(asset, tmp_path / "tube.usda")
    stage = Usd.Stage.Open(str(tmp_path / "tube.usda"))
    prim = UsdSkel.Skeleton(stage.GetPrimAtPath("/avatar/skeleton"))

    assert list(prim.GetJointsAttr().Get()) == ["rig_Hips", "rig_Hips/rig_Leg", "rig_Hips/rig_Leg_"]
    assert list(prim.GetJointNamesAttr().Get()) == ["rig:Hips", "rig:Leg", "rig Leg"]
    assert check_usd(tmp_path / "tube.usda") == []


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_stage_material_and_texture(tmp_path: Path, suffix: str) -> None:
    asset = tube(size=96)
    stage = opened(tmp_path / f"my täst{suffix}", size=96)
    mesh = stage.GetPrimAtPath("/avatar/mesh")
    material, _ = UsdShade.MaterialBindingAPI(mesh).ComputeBoundMaterial()
    surface = UsdShade.Shader(material.ComputeSurfaceSource()[0])
    texture = UsdShade.Shader(surface.GetInput("diffuseColor").GetConnectedSource()[0])
    path = texture.GetInput("file").Get()

    assert UsdGeom.GetStageUpAxis(stage) == "Y" and UsdGeom.GetStageMetersPerUnit(stage) == 1
    assert stage.GetDefaultPrim().GetPath() == "/avatar"
    assert surface.GetIdAttr().Get() == "UsdPreviewSurface"
    assert surface.GetInput("metallic").Get() == 0
    assert texture.GetInput("sourceColorSpace").Get() == "sRGB"
    assert path.path == ("base_color.png" if suffix == ".usdz" else "./my täst_base_color.png")
    with Image.open(io.BytesIO(texture_bytes(tmp_path / f"my täst{suffix}"))) as picture:
        np.testing.assert_array_equal(np.asarray(picture), asset.texture)
    source = stage.GetRootLayer().customLayerData["avatargen"]
    assert (source["seed"], source["weights_hash"], source["licence"]) == ("3", "0" * 64, "CC0-1.0")
    assert list(source["betas"]) == [0.5, -1.25]


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_occlusion_is_read_raw_by_its_own_input(tmp_path: Path, suffix: str) -> None:
    asset = replace(figure(), normal_map=None)
    export(asset, tmp_path / f"person{suffix}")
    stage = Usd.Stage.Open(str(tmp_path / f"person{suffix}"))
    surface = UsdShade.Shader(stage.GetPrimAtPath("/avatar/material/surface"))
    source, output, _ = surface.GetInput("occlusion").GetConnectedSource()
    texture = UsdShade.Shader(source)
    assert output == "r"
    assert texture.GetInput("sourceColorSpace").Get() == "raw"
    assert texture.GetInput("file").Get().path.endswith("occlusion.png")
    assert not surface.GetInput("normal")
    assert check_usd(tmp_path / f"person{suffix}") == []
    if suffix != ".usdz":
        with Image.open(tmp_path / "person_occlusion.png") as picture:
            np.testing.assert_array_equal(np.asarray(picture), asset.occlusion)


def texture_bytes(path: Path) -> bytes:
    if path.suffix == ".usdz":
        with zipfile.ZipFile(path) as package:
            return package.read("base_color.png")
    return path.with_name(f"{path.stem}_base_color.png").read_bytes()


@pytest.mark.parametrize("shape", [{}, {"joint_count": 300, "tilt": 0.01}], ids=["two joints", "many joints"])
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_validators_have_nothing_to_say(tmp_path: Path, suffix: str, shape: dict) -> None:
    export(tube(**shape), tmp_path / f"tube{suffix}")
    assert check_usd(tmp_path / f"tube{suffix}") == []


def damage(stage: Usd.Stage, attribute: str, change) -> None:
    found = stage.GetPropertyAtPath(f"/avatar/{attribute}")
    assert isinstance(found, Usd.Attribute)
    found.Set(change(found.Get()))


def first_replaced(value):
    return lambda array: type(array)([value, *list(array)[1:]])


@pytest.mark.parametrize(
    ("attribute", "change", "finding"),
    [
        ("mesh.primvars:skel:jointIndices", first_replaced(2), "joint indices reach from 0 to 2"),
        ("mesh.primvars:skel:jointWeights", first_replaced(float("nan")), "weights are not 0 or more"),
        ("mesh.primvars:skel:jointWeights", lambda old: old[:-4], "jointWeights has"),
        ("mesh.primvars:st", lambda old: old[:-1], "st has 205 values; 206 are needed"),
        ("mesh.points", first_replaced(Gf.Vec3f(np.inf)), "points hold NaN or infinity"),
        ("mesh.faceVertexIndices", first_replaced(206), "corners reach from 0 to 206"),
        ("skeleton.restTransforms", lambda old: old[:1], "restTransforms has 1 matrices"),
        ("skeleton.bindTransforms", first_replaced(Gf.Matrix4d(0.0)), "a matrix without inverse"),
        ("skeleton.joints", lambda old: type(old)(["a", "a"]), "two joints share a path"),
        ("material/base_color.inputs:file", lambda _: Sdf.AssetPath("/x/y.png"), "the absolute path"),
        ("material/base_color.inputs:file", lambda _: Sdf.AssetPath("./no.png"), "which is not there"),
    ],
)
def test_the_judge_is_awake(tmp_path: Path, attribute: str, change, finding: str) -> None:
    """Damage that USD's own validators mostly pass is found."""
    path = tmp_path / "tube.usda"
    stage = opened(path)
    damage(stage, attribute, change)
    stage.GetRootLayer().Export(str(tmp_path / "damaged.usda"))
    assert any(finding in found for found in check_usd(tmp_path / "damaged.usda"))


def test_a_skeleton_that_is_not_there_and_files_that_are_none_are_found(tmp_path: Path) -> None:
    stage = opened(tmp_path / "tube.usda")
    UsdSkel.BindingAPI(stage.GetPrimAtPath("/avatar/mesh")).GetSkeletonRel().SetTargets(["/avatar/gone"])
    stage.GetRootLayer().Export(str(tmp_path / "gone.usda"))
    assert any("names no Skeleton" in found for found in check_usd(tmp_path / "gone.usda"))
    export(tube(), tmp_path / "tube.usdz")
    (tmp_path / "cut.usdz").write_bytes((tmp_path / "tube.usdz").read_bytes()[:600])
    (tmp_path / "text.usda").write_text("hello")
    for name in ("cut.usdz", "text.usda"):
        assert check_usd(tmp_path / name) == [
            "the file cannot be read as USD; it is damaged, cut short or of another kind"
        ]


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_usdskel_bends_as_ours_does(tmp_path: Path, suffix: str) -> None:
    asset = tube(rings=24, joint_count=5, tilt=0.3)
    poses = random_poses(asset, count=3, angle=0.6)
    export(asset, tmp_path / f"tube{suffix}")
    posed = usdskel_vertices(tmp_path / f"tube{suffix}", poses)
    for vertices, transforms in zip(posed, poses, strict=True):
        np.testing.assert_allclose(vertices, our_vertices(asset, transforms), atol=AGREE / 10)
    assert np.abs(posed[0] - asset.vertices).max() > 0.05


@pytest.mark.parametrize(("suffix", "packed"), [(".usdc", False), (".usdz", True)])
def test_blender_bends_usd_as_ours_does(tmp_path: Path, suffix: str, packed: bool) -> None:
    asset = tube(rings=24, joint_count=4, tilt=0.3)
    poses = random_poses(asset, count=2, angle=0.6)
    verdict = blender_verdict(asset, poses, tmp_path, f"asset{suffix}")
    assert verdict.found["objects"] == {"avatar": "EMPTY", "mesh": "MESH", "skeleton": "ARMATURE"}
    check_blender(verdict, asset, poses)
    assert [image["packed"] for image in verdict.found["images"]] == [packed]


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_clips_move_the_mesh_in_usdskel(tmp_path: Path, suffix: str) -> None:
    """At every frame of every clip; the skeleton plays the first, a scene binds the others."""
    asset = in_motion(figure())
    export(asset, tmp_path / f"person{suffix}")
    assert check_usd(tmp_path / f"person{suffix}") == []
    stage = Usd.Stage.Open(str(tmp_path / f"person{suffix}"))
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (0, pytest.approx(24 * 3 / 30))
    for clip, path in zip(asset.animations, ("/avatar/mesh_", "/avatar/walk_it"), strict=True):
        source = UsdSkel.BindingAPI(stage.GetPrimAtPath("/avatar/skeleton")).GetAnimationSourceRel()
        assert source.GetTargets() == ["/avatar/mesh_"]
        for index, transforms in enumerate(clip.T_posed_rest(asset.skeleton)):
            played = played_vertices(stage, path, clip.times[index] * stage.GetTimeCodesPerSecond())
            np.testing.assert_allclose(played, our_vertices(asset, transforms), atol=AGREE / 10)


def walking_off(frames: int = 7) -> Asset:
    """A person who goes 2 m along z in the first clip, while the second lasts longer."""
    asset = in_motion(figure(), frames)
    first, second = asset.animations
    way = np.linspace(0, 2, frames)[:, None] * [0.0, 0.0, 1.0]
    first = replace(first, root=asset.skeleton.joints[0] + way)
    return replace(asset, animations=(first, replace(second, times=second.times * 3)))


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_extent_and_time_tell_of_what_plays(tmp_path: Path, suffix: str) -> None:
    """USD's own box around the stage holds the skinned points at every frame, and fits."""
    asset = walking_off()
    export(asset, tmp_path / f"person{suffix}")
    stage = Usd.Stage.Open(str(tmp_path / f"person{suffix}"))
    assert check_usd(tmp_path / f"person{suffix}") == []
    assert stage.GetEndTimeCode() == pytest.approx(24 * asset.animations[0].times[-1])
    ever = UsdGeom.Boundable(stage.GetDefaultPrim()).GetExtentAttr().Get()
    np.testing.assert_array_less(ever[0], asset.vertices.min(axis=0) + 1e-5)
    np.testing.assert_array_less(asset.vertices.max(axis=0) - 1e-5, ever[1])
    for time in asset.animations[0].times * stage.GetTimeCodesPerSecond():
        points = played_vertices(stage, "/avatar/mesh_", time)
        cache = UsdGeom.BBoxCache(Usd.TimeCode(time), [UsdGeom.Tokens.default_])
        for path in ("/avatar", "/avatar/mesh"):
            box = cache.ComputeWorldBound(stage.GetPrimAtPath(path)).ComputeAlignedRange()
            np.testing.assert_allclose(box.GetMin(), points.min(axis=0), atol=1e-5)
            np.testing.assert_allclose(box.GetMax(), points.max(axis=0), atol=1e-5)
        assert (points.min(axis=0) > np.asarray(ever[0]) - 1e-5).all()
        assert (points.max(axis=0) < np.asarray(ever[1]) + 1e-5).all()


def test_an_extent_that_what_plays_leaves_is_found(tmp_path: Path) -> None:
    export(walking_off(), tmp_path / "person.usda")
    stage = Usd.Stage.Open(str(tmp_path / "person.usda"))
    extent = UsdGeom.Boundable(stage.GetDefaultPrim()).GetExtentAttr()
    still = Vt.Vec3fArray.FromNumpy(np.stack([figure().vertices.min(axis=0), figure().vertices.max(axis=0)]))
    extent.Clear()
    extent.Set(still)
    stage.GetRootLayer().Export(str(tmp_path / "culled.usda"))
    (finding,) = check_usd(tmp_path / "culled.usda")
    assert finding.startswith("/avatar: extent at time ") and "leaves out points by" in finding


def test_clips_and_morphs_in_blender(tmp_path: Path) -> None:
    asset = in_motion(figure())
    export(asset, tmp_path / "person.usdz")
    script = JUDGES / "blender_play.py"
    command = [str(blender_python()), str(script), str(tmp_path / "person.usdz"), str(tmp_path / "out.npz")]
    times = [f"{time:.9f}" for time in asset.animations[0].times]
    run = subprocess.run([*command, *times], capture_output=True, text=True, timeout=240)
    assert run.returncode == 0, run.stdout + run.stderr
    with np.load(tmp_path / "out.npz") as found:
        assert found["morphs"].tolist() == ["Basis", "taller"]
        np.testing.assert_allclose(found["taller"], asset.vertices + asset.morphs[0].vertices, atol=AGREE)
        frames = asset.animations[0].T_posed_rest(asset.skeleton)
        for played, transforms in zip(found["played"], frames, strict=True):
            np.testing.assert_allclose(played, our_vertices(asset, transforms), atol=AGREE)


def test_morphs_are_blend_shapes(tmp_path: Path) -> None:
    asset = in_motion(figure())
    export(asset, tmp_path / "person.usdc")
    stage = Usd.Stage.Open(str(tmp_path / "person.usdc"))
    binding = UsdSkel.BindingAPI(stage.GetPrimAtPath("/avatar/mesh"))
    query = UsdSkel.BlendShapeQuery(binding)
    assert list(binding.GetBlendShapesAttr().Get()) == ["taller"]
    weights, indices, shapes = query.ComputeSubShapeWeights(Vt.FloatArray([0.5]))
    points = Vt.Vec3fArray.FromNumpy(asset.vertices)
    args = (query.ComputeBlendShapePointIndices(), query.ComputeSubShapePointOffsets(), points)
    assert query.ComputeDeformedPoints(weights, indices, shapes, *args)
    np.testing.assert_allclose(points, asset.vertices + 0.5 * asset.morphs[0].vertices, atol=1e-6)


@pytest.mark.parametrize("length", range(1, 70))
def test_packages_are_aligned_whatever_the_names(length: int) -> None:
    files = (File("n" * length + ".usdc", b"x" * length), File("ü" * (70 - length), b"y" * 1000))
    data = pack(files)
    with zipfile.ZipFile(io.BytesIO(data)) as package:
        assert package.testzip() is None
        for (name, content), entry in zip(files, package.infolist(), strict=True):
            head = data[entry.header_offset : entry.header_offset + HEADER]
            name_length, extra_length = (int.from_bytes(head[i : i + 2], "little") for i in (26, 28))
            begin = entry.header_offset + HEADER + name_length + extra_length
            assert begin % ALIGNMENT == 0
            assert (entry.filename, entry.compress_type) == (name, zipfile.ZIP_STORED)
            assert data[begin : begin + len(content)] == content


@pytest.mark.parametrize("stem", ["a[b]", "a<UDIM>", "line\nbreak", "a@b", os.fsdecode(b"caf\xe9")])
@pytest.mark.parametrize("suffix", [".usda", ".usdc"])
def test_pictures_have_names_that_usd_can_keep(tmp_path: Path, suffix: str, stem: str) -> None:
    """USD itself opens no file of some of these names, but finds the pictures once it is called otherwise."""
    export(tube(), tmp_path / f"{stem}{suffix}")
    (tmp_path / f"{stem}{suffix}").rename(tmp_path / f"person{suffix}")
    assert check_usd(tmp_path / f"person{suffix}") == []
