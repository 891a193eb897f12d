"""A face that moves, on the default body's own surface."""

from dataclasses import replace

import numpy as np
import pytest

from assets.asset.asset import Asset, AssetInfo
from assets.asset.names import rename_joints
from assets.asset.posed import posed
from assets.asset.rig import Skeleton
from assets.errors import GeometryError
from assets.face.cut import CutMesh, split_edges
from assets.face.eyes import AROUND, LATITUDES, make_eyes
from assets.face.face import assembled, carried, with_face
from assets.face.frame import Frame, at_rest, head_frame
from assets.face.measure import edges_of, stretch
from assets.face.motions import Motions
from assets.face.names import ARKIT, EXPRESSIONS, VISEMES
from assets.face.opened import OpenFace, open_face
from assets.mesh.surface import Surface, directed_edges, find_defects, vertex_normals
from assets.skin.skin import limit_influences
from avatargen.body.face import load_face
from avatargen.body.load import load_body
from avatargen.body.model import CanonicalBody, canonical_body
from avatargen.errors import InputError
from avatargen.shipped import shipped
from exporters import vrm
from tests.bodies import capsule_body
from tests.figure import figure


@pytest.fixture(scope="module")
def body() -> CanonicalBody:
    return canonical_body(load_body(shipped("body.npz")))


@pytest.fixture(scope="module")
def plain(body: CanonicalBody) -> Asset:
    """The body itself as an asset, taller than it is canonically and with wider eyes."""
    canonical = body.vertices.astype(np.float64)
    taller = canonical * [1.02, 1.06, 1.0]
    skin = limit_influences(body.weights)
    low, high = canonical.min(axis=0)[:2], canonical.max(axis=0)[:2]
    T_world_joint = np.tile(np.eye(4), (len(body.parents), 1, 1))
    T_world_joint[:, :3, 3] = body.joints * np.array([1.02, 1.06, 1.0])
    return Asset(
        vertices=taller.astype(np.float32),
        normals=vertex_normals(Surface(vertices=taller, faces=body.faces)).astype(np.float32),
        faces=body.faces,
        info=AssetInfo(seed=0, weights_hash="0" * 64, version="0.1.0", licence="CC0-1.0"),
        welded=np.arange(len(canonical)),
        canonical=body.vertices,
        uv=(0.1 + 0.8 * (canonical[:, :2] - low) / (high - low)).astype(np.float32),
        texture=np.full((256, 256, 3), 128, np.uint8),
        joints=skin.joints,
        weights=skin.weights,
        skeleton=Skeleton(joint_names=body.joint_names, parents=body.parents, T_world_joint=T_world_joint),
    )


@pytest.fixture(scope="module")
def opened(plain: Asset, body: CanonicalBody) -> OpenFace:
    assert plain.welded is not None and plain.canonical is not None
    mesh = CutMesh(
        faces=plain.faces,
        welded=plain.welded,
        places=plain.canonical.astype(np.float64),
        values=carried(plain),
    )
    return open_face(mesh, body, load_face())


@pytest.fixture(scope="module")
def moving(plain: Asset, opened: OpenFace) -> Asset:
    return assembled(plain, opened)


@pytest.fixture(scope="module")
def frame(opened: OpenFace, plain: Asset) -> Frame:
    return head_frame(plain, opened, at_rest(opened, opened.mesh.values[:, :3]))


@pytest.fixture(scope="module")
def motions(opened: OpenFace, frame: Frame) -> Motions:
    own = frame.own(at_rest(opened, opened.mesh.values[:, :3]))
    return Motions(opened, make_eyes(opened, own[: opened.inside.first]), own)


def places(asset: Asset, **weights: float) -> np.ndarray:
    """Welded vertices at rest, under shapes."""
    assert asset.welded is not None
    moved = asset.vertices.astype(np.float64)
    for morph in asset.morphs:
        moved = moved + weights.get(morph.name, 0.0) * morph.vertices
    found = np.zeros((int(asset.welded.max()) + 1, 3))
    found[asset.welded] = moved
    return found


def welded_faces(asset: Asset) -> np.ndarray:
    assert asset.welded is not None
    return asset.welded[asset.faces]


def test_it_has_every_shape_by_its_name(moving: Asset) -> None:
    names = [morph.name for morph in moving.morphs]

    assert names == [*ARKIT, *VISEMES]
    assert len(ARKIT) == 52 and len(VISEMES) == 15 and len(EXPRESSIONS) == 18
    still = [m.name for m in moving.morphs if np.abs(m.vertices).max() < 1e-3]
    assert still == ["viseme_sil"]
    assert {shape for sums in EXPRESSIONS.values() for shape in sums} <= set(names)


def test_at_rest_the_skin_is_the_same_but_for_the_eyes(plain: Asset, moving: Asset, opened: OpenFace) -> None:
    kept = opened.kept
    taken = np.setdiff1d(np.arange(len(plain.vertices)), kept)
    eyes = load_face().eyes

    assert np.array_equal(moving.vertices[: len(kept)], plain.vertices[kept])
    assert np.array_equal(moving.uv[: len(kept)], plain.uv[kept])
    assert set(taken) <= set(eyes) and len(taken) > 0.5 * len(eyes)
    corners = opened.mesh.values[:, :3][opened.mesh.faces]
    whole = plain.vertices[plain.faces].astype(np.float64)
    areas = [
        np.linalg.norm(np.cross(c[:, 1] - c[:, 0], c[:, 2] - c[:, 0]), axis=1).sum() / 2
        for c in (whole, corners)
    ]
    assert 2e-4 < areas[0] - areas[1] < 1e-3  # m2, of two eyes


def test_skin_with_its_mouth_and_sockets_is_closed_and_so_are_teeth_tongue_and_eyeballs(
    moving: Asset,
) -> None:
    surface = Surface(vertices=places(moving), faces=welded_faces(moving))
    edges = {(int(a), int(b)) for a, b in directed_edges(surface.faces)}

    assert len(edges) == 3 * len(surface.faces), "an edge is there twice"
    assert all((b, a) in edges for a, b in edges), "the surface is open"
    assert str(find_defects(surface, pieces=6)) == ""


def test_lips_are_closed_at_rest_and_at_m_b_and_p(moving: Asset, opened: OpenFace) -> None:
    for weights in ({}, {"viseme_PP": 1.0}, {"jawOpen": 1.0, "mouthClose": 1.0}):
        at = places(moving, **weights)
        gap = np.linalg.norm(at[opened.upper] - at[opened.lower], axis=1)
        assert gap.max() < 1e-4, weights

    at = places(moving, jawOpen=1.0)
    gap = np.linalg.norm(at[opened.upper] - at[opened.lower], axis=1)
    assert 0.02 < gap.max() < 0.045


def test_a_blink_closes_the_lids_before_the_eyeballs(moving: Asset, motions: Motions, frame: Frame) -> None:
    at = places(moving, eyeBlinkLeft=1.0, eyeBlinkRight=1.0)
    for eye, ball in enumerate(motions.eyes.balls):
        upper, lower = motions.margins(eye)
        for k in (1, 2):
            gap = at[upper[2:-2], k] - np.interp(at[upper[2:-2], 0], at[lower, 0], at[lower, k])
            assert np.abs(gap).max() < 2e-4
        sphere = motions.of_eyes(motions.eyes.spheres[eye])
        assert np.array_equal(at[sphere], places(moving)[sphere])
        lids = np.linalg.norm(frame.own(at[upper[2:-2]]) - ball.centre, axis=1)
        assert lids.min() > ball.radius, "the eye stands out of its lids"


def test_eyes_turn_behind_lids(moving: Asset, motions: Motions, frame: Frame) -> None:
    at, rest = places(moving, eyeLookOutLeft=1.0), places(moving)
    left, right = (motions.of_eyes(sphere) for sphere in motions.eyes.spheres)
    pupil = left.start + AROUND * len(LATITUDES)

    assert np.array_equal(at[right], rest[right])
    assert at[pupil, 0] - rest[pupil, 0] > 0.005, "the person's left eye looks to its left"
    reach = [np.linalg.norm(frame.own(p[left]) - motions.eyes.balls[0].centre, axis=1) for p in (at, rest)]
    assert np.abs(reach[0] - reach[1]).max() < 1e-4


def test_no_edge_around_the_eyes_is_torn(moving: Asset, motions: Motions) -> None:
    """Those of mouths are measured on people: the body's own lips are sewn together with slivers."""
    faces, rest = welded_faces(moving), places(moving)
    skin = edges_of(faces[(faces < motions.skin).all(axis=1)])
    shapes = [m.name for m in moving.morphs if m.name.startswith(("eye", "brow", "cheek", "nose"))]
    pulled = {name: stretch(rest, places(moving, **{name: 1.0}), skin).p99 for name in shapes}
    assert len(pulled) == 24
    assert max(pulled.values()) < 2.5, pulled


def test_bones_move_what_they_are_named_after(plain: Asset, moving: Asset, motions: Motions) -> None:
    assert moving.skeleton.joint_names == (*plain.skeleton.joint_names, "jaw", "left_eye", "right_eye")
    J = len(plain.skeleton.parents)
    angles = np.zeros((J + 3, 3))
    angles[J] = np.radians([17.5, 0, 0])
    opened = replace(moving, vertices=posed(moving, angles, on_ground=False).vertices)
    at, rest, wanted = places(replace(opened, morphs=())), places(moving), places(moving, jawOpen=1.0)
    kinds = motions.kind
    lower = np.flatnonzero(kinds == 2)
    assert np.linalg.norm(at[lower] - wanted[lower], axis=1).max() < 0.004
    assert np.array_equal(at[kinds == 1], rest[kinds == 1]), "upper teeth stay"
    chin = np.flatnonzero((kinds < 0) & (np.linalg.norm(wanted - rest, axis=1) > 0.015))
    assert np.median(np.linalg.norm(at[chin] - wanted[chin], axis=1)) < 0.004

    angles[:] = 0
    angles[J + 1] = np.radians([0, 26, 0])
    turned = places(replace(moving, vertices=posed(moving, angles, on_ground=False).vertices, morphs=()))
    left = motions.of_eyes(motions.eyes.spheres[0])
    wanted = places(moving, eyeLookOutLeft=1.0)
    assert np.linalg.norm(turned[left] - wanted[left], axis=1).max() < 1e-3
    others = np.setdiff1d(np.arange(len(rest)), np.arange(left.start, left.stop))
    assert np.abs(turned[others] - rest[others]).max() < 1e-6


def test_programs_know_the_bones_by_their_names(moving: Asset) -> None:
    names = rename_joints(moving, "mixamo").skeleton.joint_names[-3:]
    assert names == ("mixamorig:Jaw", "mixamorig:LeftEye", "mixamorig:RightEye")
    assert rename_joints(moving, "unity").skeleton.joint_names[-3:] == ("Jaw", "LeftEye", "RightEye")

    bones = vrm.human_bones(moving.skeleton.joint_names)
    assert [bones[name] - len(bones) for name in ("jaw", "leftEye", "rightEye")] == [-3, -2, -1]
    found = vrm.look_at(moving, bones)["lookAt"]
    assert isinstance(found, dict) and found["type"] == "bone"
    offset = found["offsetFromHeadBone"]
    assert abs(offset[0]) < 0.005 and 0.03 < offset[1] < 0.15 and 0.05 < offset[2] < 0.15
    assert vrm.look_at(figure(), vrm.human_bones(figure().skeleton.joint_names)) == {}


def test_left_and_right_are_mirrored(moving: Asset) -> None:
    size = {m.name: float(np.linalg.norm(m.vertices)) for m in moving.morphs}
    for name in (n for n in size if n.endswith("Left")):
        assert size[name] == pytest.approx(size[f"{name[:-4]}Right"], rel=0.15), name


def test_nothing_below_the_neck_moves(moving: Asset) -> None:
    low = moving.canonical[:, 1] < 0.45  # pyright: ignore[reportOptionalSubscript]
    assert low.any()
    assert all(not morph.vertices[low].any() for morph in moving.morphs)


def test_normals_move_with_the_shapes(moving: Asset) -> None:
    smile = next(m for m in moving.morphs if m.name == "mouthSmileLeft")
    assert smile.normals is not None
    surface = Surface(vertices=places(moving, mouthSmileLeft=1.0), faces=welded_faces(moving))
    assert moving.welded is not None
    wanted = vertex_normals(surface)[moving.welded]
    found = moving.normals + smile.normals
    moved = np.abs(smile.vertices).max(axis=1) > 2e-3
    cosine = (wanted * found).sum(axis=1) / np.linalg.norm(found, axis=1)
    assert np.median(cosine[moved]) > 0.99


def test_what_lies_before_the_eyes_keeps_a_face_closed(plain: Asset, body: CanonicalBody) -> None:
    assert plain.canonical is not None
    masked = plain.canonical.copy()
    masked[(masked[:, 1] > 0.7) & (masked[:, 2] > 0.1), 2] += 0.02
    with pytest.raises(GeometryError, match=r"something lies \d+ mm before"):
        with_face(replace(plain, canonical=masked), body)


def test_other_bodies_have_no_face() -> None:
    other = canonical_body(capsule_body())
    with pytest.raises(InputError, match="wanted the default one"):
        with_face(figure(), other)


def test_split_edges_keep_the_surface() -> None:
    square = CutMesh(
        faces=np.array([[0, 1, 2], [0, 2, 3]]),
        welded=np.arange(4),
        places=np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]),
        values=np.array([[0.0], [1.0], [2.0], [1.0]]),
    )
    split = split_edges(square, square.edges(), np.full(5, 0.25))
    corners = split.places[split.faces]
    areas = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2]

    assert len(split.faces) == 8
    assert areas.min() > 0 and areas.sum() == pytest.approx(1)
    assert np.allclose(split.values[:, 0], split.places[:, 0] + split.places[:, 1])
