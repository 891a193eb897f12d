"""The steps that derive the default body, on shapes built in code; anny itself is not needed."""

import numpy as np
import pytest
import trimesh

from avatargen.avatar import shipped, training_body
from avatargen.body.derive import (
    BETAS,
    boundary_loop,
    eye_patch,
    fit_regressor,
    joint_of_bone,
    principal_shapes,
    rotation_between,
    split_exactly,
    with_fingers,
    zip_lips,
)
from avatargen.body.fingers import without_fingers
from avatargen.body.load import load_body
from avatargen.body.model import canonical_body
from avatargen.wardrobe.faces import FACE_SHAPES


def test_the_shipped_body_is_one_closed_outward_surface():
    body = load_body(shipped("body.npz"))
    for vertices in (body.v_template, canonical_body(body).vertices):
        mesh = trimesh.Trimesh(vertices, body.faces, process=False)
        assert (
            mesh.is_watertight
            and mesh.is_winding_consistent
            and mesh.body_count == 1
            and mesh.euler_number == 2
        )
        assert 0.05 < mesh.volume < 0.09  # cubic metres of an adult
    assert body.shapedirs.shape[2] == BETAS + len(FACE_SHAPES) and len(body.joint_names) == 52
    joints = body.J_regressor @ body.v_template
    assert np.abs(joints[0]).max() < 2e-3  # pelvis at the origin
    assert np.abs(joints[:, 0].sum()) < 0.02  # left and right mirror each other


def test_rotation_between_takes_one_direction_to_the_other():
    rng = np.random.default_rng(0)
    for _ in range(20):
        a, b = rng.normal(size=(2, 3))
        r = rotation_between(a, b)
        assert np.allclose(r @ a / np.linalg.norm(a), b / np.linalg.norm(b), atol=1e-9)
        assert np.allclose(r @ r.T, np.eye(3), atol=1e-9) and np.linalg.det(r) == pytest.approx(1)


def test_bones_go_to_the_joint_that_moves_them():
    parents = {
        "root": None,
        "spine05": "root",
        "finger2-3.L": "finger2-2.L",
        "metacarpal1.R": "wrist.R",
        "wrist.R": "root",
    }

    assert joint_of_bone("spine05", parents) == "pelvis"
    assert joint_of_bone("finger2-3.L", parents) == "left_index3"
    assert joint_of_bone("finger1-2.R", parents) == "right_thumb2"
    assert joint_of_bone("metacarpal1.R", parents) == "right_wrist"
    assert joint_of_bone("toe5-3.R", parents) == "right_foot"


def test_a_slit_is_zipped_into_a_disc():
    t = np.linspace(0, 2 * np.pi, 20, endpoint=False)
    vertices = np.stack([np.cos(t), 0.1 * np.sin(t), np.zeros(20)], axis=1)
    faces = zip_lips(list(range(20)), vertices)
    mesh = trimesh.Trimesh(vertices, faces, process=False)

    assert len(faces) == 18
    assert mesh.area == pytest.approx(0.1 * 10 * np.sin(2 * np.pi / 20), rel=1e-6)
    assert (mesh.face_normals[:, 2] > 0).all() or (mesh.face_normals[:, 2] < 0).all()
    assert len(set(boundary_loop(np.array(faces)))) == 20


def test_two_loops_are_refused():
    ring = np.array([[0, 1, 3], [1, 4, 3], [1, 2, 4], [2, 5, 4], [2, 0, 5], [0, 3, 5]])

    with pytest.raises(ValueError, match="several"):
        boundary_loop(ring)


def test_an_eye_patch_fills_the_lids_with_the_ball():
    ball = trimesh.creation.icosphere(subdivisions=2, radius=1.0).vertices
    t = np.linspace(0, 2 * np.pi, 16, endpoint=False)
    lids = np.stack([0.7 * np.cos(t), 0.35 * np.sin(t), np.full(16, 0.85)], axis=1)
    vertices = np.concatenate([ball, lids])
    loop = list(range(len(ball), len(ball) + 16))
    patch = eye_patch(loop, np.arange(len(ball)), vertices, first=len(vertices))
    mesh = trimesh.Trimesh(np.concatenate([vertices, patch.position]), patch.faces, process=False)

    assert set(boundary_loop(np.array(patch.faces))) == set(loop)
    assert (mesh.face_normals[:, 2] > 0).all()
    assert np.abs(np.linalg.norm(patch.position[-40:], axis=1) - 1).max() < 1e-6


def test_regressed_joints_follow_the_shape():
    rng = np.random.default_rng(1)
    base = rng.normal(size=(200, 3))
    scales = rng.uniform(0.8, 1.2, size=(30, 3))
    vertices = base[None] * scales[:, None]
    joints = np.stack([vertices[:, :20].mean(1), vertices[:, 50:90].mean(1)], axis=1)
    regressor = fit_regressor(vertices, joints, nearest=60)

    assert np.allclose(regressor.sum(1), 1)
    assert np.abs(np.einsum("jv,svc->sjc", regressor, vertices) - joints).max() < 0.02


def test_principal_shapes_rebuild_the_samples():
    rng = np.random.default_rng(2)
    directions, betas = rng.normal(size=(50, 3, 10)), rng.normal(size=(200, 10))
    vertices = np.einsum("vcb,sb->svc", directions, betas)
    found, scores = principal_shapes(vertices, np.ones(50))
    rebuilt = vertices.mean(0) + np.einsum("vcb,sb->svc", found, scores)

    assert np.abs(rebuilt - vertices).max() < 1e-8
    assert np.allclose(scores.std(0, ddof=1), 1)


def test_parts_sum_to_the_whole_in_every_bit():
    rng = np.random.default_rng(3)
    total = rng.random(5000).astype(np.float32) ** 4
    shares = np.maximum(rng.normal(size=(5000, 4)), 0)
    parts = split_exactly(total, shares)

    assert np.array_equal(parts.sum(axis=1), total) and parts.min() >= 0
    wanted = total * (shares / np.maximum(shares.sum(axis=1), 1e-300)[:, None]).T
    some = shares.sum(axis=1) > 0
    assert np.abs(parts - wanted.T)[some].max() < 1e-6
    assert np.array_equal(parts[~some, 0], total[~some])


def test_fingers_leave_an_old_body_as_it_was():
    body = load_body(shipped("body.npz"))
    old = training_body()
    again = with_fingers(old, body)

    for name in ("v_template", "weights", "J_regressor", "shapedirs", "parents"):
        assert np.array_equal(getattr(without_fingers(again), name), getattr(old, name)), name
    assert np.abs(again.weights - body.weights).max() < 1e-6
