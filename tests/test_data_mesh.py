"""Meshes of wardrobe people: closed, on the field's zero, and posed as the body is."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from avatargen.avatar import training_body
from avatargen.body.distance import BodyDistance
from avatargen.body.model import canonical_body, pose, shape
from avatargen.body.pose import named_pose
from avatargen.data.mesh import Tailor, pose_mesh
from avatargen.data.poses import random_pose
from avatargen.wardrobe.attributes import LATENT_SIZE, People
from avatargen.wardrobe.person import dress_up

CELL = 0.024


@pytest.fixture(scope="module")
def tailor() -> Tailor:
    return Tailor(canonical_body(training_body()), CELL)


def someone(seed: int) -> People:
    return People(torch.randn(1, LATENT_SIZE, generator=torch.Generator().manual_seed(seed)))


@pytest.mark.parametrize("seed", [0, 1, 2, 3])
def test_a_person_is_one_closed_surface_on_the_zero_of_the_field(tailor: Tailor, seed: int):
    mesh = tailor.mesh(someone(seed))
    edges = np.concatenate([mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]], mesh.faces[:, [2, 0]]])
    forward = edges[:, 0] * len(mesh.vertices) + edges[:, 1]
    backward = edges[:, 1] * len(mesh.vertices) + edges[:, 0]
    corners = mesh.vertices[mesh.faces]
    volume = np.einsum("fd,fd->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6

    assert np.array_equal(np.sort(forward), np.sort(backward))  # every edge runs once each way
    assert 0.05 < volume < 0.25  # cubic metres, outward
    places = tailor.chart.places(mesh.vertices.astype(np.float32))
    layer = dress_up(places[None], someone(seed))
    assert layer.sdf.abs().mean() < 0.15 * CELL
    assert (layer.color[0] - torch.from_numpy(mesh.colors)).abs().mean() < 0.06
    assert np.abs(mesh.weights.sum(axis=1) - 1).max() < 1e-9
    assert mesh.weights.min() >= 0


def test_a_mesh_of_mean_shape_returns_to_its_canonical_place(tailor: Tailor):
    mesh = tailor.mesh(someone(0))
    offsets = tailor.body.source.shapedirs @ mesh.betas
    plain = replace(
        mesh, betas=np.zeros(10, np.float32), rest=mesh.rest - nearest_offsets(tailor, mesh, offsets)
    )
    back = pose_mesh(plain, tailor.body.source, named_pose("x", tailor.body.joint_names))

    assert np.abs(back - mesh.vertices).mean() < 1e-3  # off only where the closest body point is not a vertex


def nearest_offsets(tailor: Tailor, mesh, offsets: np.ndarray) -> np.ndarray:
    hit = tailor.chart.distance.query(mesh.vertices)
    return np.einsum("ncd,nc->nd", offsets[tailor.body.faces[hit.face]], hit.barycentric)


def test_clothes_follow_the_posed_body(tailor: Tailor):
    """Hands and faces are the body's own: every hand vertex of the posed mesh lies on the posed body."""
    mesh, body = tailor.mesh(someone(3)), tailor.body.source
    turns = random_pose(body.joint_names, np.random.default_rng(0))
    posed = pose(body, shape(body, mesh.betas), turns)
    moved = pose_mesh(mesh, body, turns)
    distance = BodyDistance(posed.vertices, body.faces).query(moved).distance
    hand = (
        mesh.weights[:, [body.joint_names.index(f"{side}_hand") for side in ("left", "right")]].sum(1) > 0.8
    )
    assert hand.sum() > 50
    assert np.abs(distance[hand]).mean() < 0.3 * CELL
    assert distance.max() < 0.5 and distance.min() > -0.1
