"""A face that moves in files: shapes by their names, with normals, as other programs read them."""

# pyright: reportAttributeAccessIssue=false

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pxr import Usd, UsdSkel, Vt
from pygltflib import GLTF2

from assets.asset.asset import Asset
from assets.asset.rig import Morph
from assets.face.names import ARKIT, EXPRESSIONS, VISEMES
from avatargen.errors import InputError
from exporters import export
from exporters.check_usd import check_usd
from exporters.read_glb import read_glb
from tests.figure import figure, in_motion
from tests.test_vrm import extension, type_errors
from tests.verdicts import khronos_issues


@pytest.fixture(scope="module")
def person() -> Asset:
    """The capsule figure with every shape of a face."""
    return with_shapes(figure())


def with_shapes(asset: Asset) -> Asset:
    """The asset with every shape of a face, each of some of its vertices."""
    rng = np.random.default_rng(0)
    shapes = []
    for name in (*ARKIT, *VISEMES):
        moved = (rng.random((len(asset.vertices), 1)) < 0.1) * (name != "viseme_sil")
        shapes.append(
            Morph(
                name=name,
                vertices=(moved * rng.normal(size=asset.vertices.shape) * 0.01).astype(np.float32),
                normals=(moved * rng.normal(size=asset.vertices.shape) * 0.1).astype(np.float32),
                joints=np.zeros((len(asset.skeleton.parents), 3)),
            )
        )
    return replace(asset, morphs=tuple(shapes))


def test_vrm_has_all_presets_and_every_shape_under_its_own_name(tmp_path: Path, person: Asset) -> None:
    export(person, tmp_path / "person.vrm")
    document, found = extension((tmp_path / "person.vrm").read_bytes())
    expressions = found["expressions"]
    names = document.meshes[0].extras["targetNames"]

    assert set(expressions["preset"]) == set(EXPRESSIONS)
    assert set(expressions["custom"]) == set(ARKIT | VISEMES)
    blink = expressions["preset"]["blink"]["morphTargetBinds"]
    assert [names[bind["index"]] for bind in blink] == ["eyeBlinkLeft", "eyeBlinkRight"]
    assert all(document.nodes[bind["node"]].mesh is not None for bind in blink)
    # of expressions the published types are a draft's, which had a preset's name within each
    rest = {name: value for name, value in found.items() if name != "expressions"}
    assert type_errors(tmp_path, rest) == ""
    codes = {message["code"] for message in khronos_issues(tmp_path / "person.vrm")["messages"]}
    assert codes <= {"UNSUPPORTED_EXTENSION"}


def test_shapes_are_read_back_from_a_glb(tmp_path: Path, person: Asset) -> None:
    """Those with rows of their own, and body sliders with what they say of joints."""
    export(person, tmp_path / "person.glb")
    found = read_glb(tmp_path / "person.glb", "t")
    assert isinstance(found, Asset) and [m.name for m in found.morphs] == [m.name for m in person.morphs]
    for theirs, ours in zip(found.morphs, person.morphs, strict=True):
        np.testing.assert_array_equal(theirs.vertices, ours.vertices)
        assert theirs.normals is not None and ours.normals is not None
        np.testing.assert_array_equal(theirs.normals, ours.normals)
    tall = in_motion(figure())
    export(tall, tmp_path / "tall.glb")
    back = read_glb(tmp_path / "tall.glb", "t")
    assert isinstance(back, Asset)
    (slider,) = back.morphs
    assert slider.normals is None
    np.testing.assert_array_equal(slider.vertices, tall.morphs[0].vertices)
    names = back.skeleton.joint_names
    order = [names.index(name) for name in tall.skeleton.joint_names]
    np.testing.assert_allclose(slider.joints[order], tall.morphs[0].joints, atol=1e-6)


def test_a_forged_number_of_shapes_is_refused(tmp_path: Path, person: Asset) -> None:
    """A few bytes for each may ask for memory without end."""
    export(replace(person, morphs=person.morphs[:1]), tmp_path / "person.glb")
    document = GLTF2.load_from_bytes((tmp_path / "person.glb").read_bytes())
    assert document is not None
    mesh, count = document.meshes[0], 100_000
    mesh.primitives[0].targets = [*(mesh.primitives[0].targets or ())] * count
    mesh.extras = {"targetNames": [str(number) for number in range(count)]}
    (tmp_path / "forged.glb").write_bytes(b"".join(document.save_to_bytes()))
    with pytest.raises(InputError, match="take too much memory"):
        read_glb(tmp_path / "forged.glb")


def test_who_has_no_face_has_no_expressions(tmp_path: Path) -> None:
    export(figure(), tmp_path / "plain.vrm")
    assert "expressions" not in extension((tmp_path / "plain.vrm").read_bytes())[1]


def test_usd_shapes_turn_normals(tmp_path: Path, person: Asset) -> None:
    export(person, tmp_path / "person.usdc")
    assert check_usd(tmp_path / "person.usdc") == []
    stage = Usd.Stage.Open(str(tmp_path / "person.usdc"))
    binding = UsdSkel.BindingAPI(stage.GetPrimAtPath("/avatar/mesh"))
    query = UsdSkel.BlendShapeQuery(binding)
    names = list(binding.GetBlendShapesAttr().Get())
    assert names == [*ARKIT, *VISEMES]
    chosen = Vt.FloatArray([1.0 if name == "jawOpen" else 0.0 for name in names])
    weights, indices, shapes = query.ComputeSubShapeWeights(chosen)
    points = Vt.Vec3fArray.FromNumpy(person.vertices)
    args = (query.ComputeBlendShapePointIndices(), query.ComputeSubShapePointOffsets(), points)
    assert query.ComputeDeformedPoints(weights, indices, shapes, *args)
    jaw = person.morphs[names.index("jawOpen")]
    np.testing.assert_allclose(points, person.vertices + jaw.vertices, atol=1e-6)
    turned = np.array(
        UsdSkel.BlendShape(stage.GetPrimAtPath("/avatar/mesh/jawOpen")).GetNormalOffsetsAttr().Get()
    )
    assert jaw.normals is not None
    moved = jaw.vertices.any(axis=1) | jaw.normals.any(axis=1)
    np.testing.assert_allclose(turned, jaw.normals[moved], atol=1e-6)
