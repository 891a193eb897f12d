import functools

import numpy as np
import pytest
from bodies import capsule_body

from assets.mesh.surface import Surface, find_defects, vertex_normals
from assets.skin.attach import attach
from assets.skin.rest import to_rest
from assets.skin.skin import SkinConfig, skin_attached
from avatargen.body.model import canonical_body, pose, shape
from avatargen.body.pose import named_pose
from avatargen.errors import InputError

BETAS = np.array([1.5, -1.0, 0.5])


@functools.cache
def dressed(pose_blend=False):
    """The canonical body's own mesh with its skin: what comes out can be compared with the body model."""
    body = canonical_body(capsule_body(pose_blend=pose_blend))
    surface = Surface(vertices=body.vertices.astype(np.float64), faces=body.faces)
    attachment = attach(surface, body)
    return surface, skin_attached(attachment, body, SkinConfig()), attachment, body


def rest(rotations, betas=BETAS, on_ground=False, pose_blend=False):
    surface, skin, attachment, body = dressed(pose_blend)
    return to_rest(surface, skin, attachment, body, betas, rotations, on_ground)


@pytest.mark.parametrize("pose_blend", [False, True])
def test_canonical_pose_and_shape_bring_the_surface_back(pose_blend):
    surface, _, _, body = dressed(pose_blend)
    mesh = rest(named_pose("x", body.joint_names), np.zeros(3), pose_blend=pose_blend)
    assert np.abs(mesh.vertices - surface.vertices).max() < 1e-6
    assert np.abs(mesh.joints - body.joints).max() < 1e-6


@pytest.mark.parametrize("pose_blend", [False, True])
@pytest.mark.parametrize("name", ["t", "a", "x"])
def test_the_body_in_its_own_weights_agrees_with_the_body_model(name, pose_blend):
    _, skin, attachment, body = dressed(pose_blend)
    rotations = named_pose(name, body.joint_names)
    posed = pose(body.source, shape(body.source, BETAS), rotations)
    mesh = rest(rotations, pose_blend=pose_blend)
    full = attachment.trusted & (np.abs(skin.dense(24) - body.weights).sum(axis=1) < 1e-3)
    off = np.linalg.norm(mesh.vertices - posed.vertices, axis=1)
    assert full.mean() > 0.2
    assert off[full].max() < 1e-3
    assert off.mean() < 3e-3  # four weights a vertex instead of all
    assert np.abs(mesh.joints - posed.joints).max() < 1e-6


def test_joints_are_not_rotated_and_the_mesh_stays_whole():
    _, _, _, body = dressed()
    mesh = rest(named_pose("a", body.joint_names))
    assert np.array_equal(mesh.T_world_joint[:, :3, :3], np.tile(np.eye(3), (24, 1, 1)))
    surface = Surface(vertices=mesh.vertices, faces=body.faces)
    defects = find_defects(surface)
    assert (defects.bad_edges, defects.bad_vertices, defects.inward) == (0, 0, 0)
    assert np.array_equal(mesh.normals, vertex_normals(surface))
    assert np.linalg.norm(mesh.normals, axis=1) == pytest.approx(1)


def test_standing_on_the_ground_moves_mesh_and_skeleton_together():
    rotations = np.zeros((24, 3))
    floating, standing = rest(rotations), rest(rotations, on_ground=True)
    lift = standing.vertices[0] - floating.vertices[0]
    assert standing.vertices[:, 1].min() == pytest.approx(0)
    assert np.abs(standing.vertices - floating.vertices - lift).max() < 1e-12
    assert np.abs(standing.joints - floating.joints - lift).max() < 1e-12


def test_a_joint_bent_all_the_way_stays_finite():
    rotations = np.zeros((24, 3))
    rotations[18] = [0, np.pi, 0]
    assert np.isfinite(rest(rotations).vertices).all()


@pytest.mark.parametrize(
    ("betas", "rotations"),
    [
        (np.zeros(99), np.zeros((24, 3))),
        (np.zeros(3), np.zeros((5, 3))),
        (np.full(3, np.nan), np.zeros((24, 3))),
    ],
)
def test_betas_and_poses_of_another_body(betas, rotations):
    with pytest.raises(InputError):
        rest(rotations, betas)
