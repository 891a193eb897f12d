import functools

import numpy as np
import pytest
import torch
from bodies import capsule_body
from shapes import capsule, icosphere, join

from assets.errors import GeometryError
from assets.isosurface.extract import ExtractConfig, extract
from assets.mesh.clean import clean
from assets.mesh.surface import Surface, directed_edges, vertex_normals
from assets.skin.attach import attach, fill
from assets.skin.skin import Skin, SkinConfig, limit_influences, near_filled, parts_of_faces, skin_attached
from avatargen.body.distance import BodyDistance
from avatargen.body.model import canonical_body


@functools.cache
def person():
    return canonical_body(capsule_body())


def on_body(offset=0.0):
    """The body's own mesh, grown along its normals."""
    body = person()
    plain = Surface(vertices=body.vertices.astype(np.float64), faces=body.faces)
    return Surface(vertices=plain.vertices + offset * vertex_normals(plain), faces=body.faces)


@functools.cache
def skirted():
    """The body in a wide skirt: one surface that spans both legs."""
    body = person()
    distance = BodyDistance(body.vertices, body.faces)
    waist, hem = body.joints[0], body.joints[[4, 5]].mean(axis=0)
    skirt = capsule(tuple(waist.tolist()), tuple(hem.tolist()), 0.3)

    def sdf(points):
        near = torch.from_numpy(distance.query(points.numpy().astype(np.float64)).distance)
        below = points[:, 1] - float(waist[1])
        above_hem = float(hem[1]) - points[:, 1]
        flat = (points[:, 2].abs() - 0.15).maximum(skirt(points))
        return torch.minimum(near - 0.005, torch.maximum(torch.maximum(flat, below), above_hem))

    bounds = np.stack([body.vertices.min(axis=0), body.vertices.max(axis=0)]) + np.array([[-0.4], [0.4]])
    return clean(extract(sdf, bounds, ExtractConfig(resolution=100))).surface


def transfer_weights(surface, body):
    return skin_attached(attach(surface, body), body, SkinConfig())


def test_on_the_body_itself_weights_are_the_bodys():
    skin = transfer_weights(on_body(), person())
    away = ~near_filled(attach(on_body(), person()), SkinConfig().smoothing_rounds)
    ordered = np.sort(person().weights, axis=1)[:, ::-1]
    clear = ordered[:, 3] - ordered[:, 4] > 1e-4  # elsewhere the fourth and the fifth joint are equally good
    expected = limit_influences(person().weights).dense(24)
    assert (away & clear).mean() > 0.8
    assert np.quantile(np.abs(skin.dense(24) - expected).sum(axis=1)[away & clear], 0.98) < 1e-3


def test_rows_sum_to_one_heaviest_first_and_empty_slots_name_joint_zero():
    skin = transfer_weights(skirted(), person())
    assert np.abs(skin.weights.sum(axis=1, dtype=np.float64) - 1).max() < 2e-7 * 4
    assert (np.diff(skin.weights, axis=1) <= 0).all()
    assert (skin.joints[skin.weights == 0] == 0).all()


def test_a_skirt_changes_hands_smoothly_between_the_legs():
    surface, body = skirted(), person()
    attachment = attach(surface, body)
    assert 0.02 < (~attachment.trusted).mean() < 0.7

    left = np.isin(np.arange(24), [1, 4, 7, 10])  # the leg's joints
    raw, filled = (
        weights @ left for weights in (attachment.closest(body.weights), attachment.carry(body.weights))
    )
    edges = directed_edges(surface.faces)
    edges = edges[~attachment.trusted[edges].any(axis=1)]
    jump = [np.abs(side[edges[:, 0]] - side[edges[:, 1]]).max() for side in (raw, filled)]
    assert jump[0] > 0.3
    assert jump[1] < 0.5 * jump[0]
    weights = transfer_weights(surface, body).dense(24)
    middle = (np.abs(surface.vertices[:, 0]) < 0.02) & ~attachment.trusted
    assert middle.any()
    right = np.isin(np.arange(24), [2, 5, 8, 11])
    assert np.abs(weights @ left - weights @ right)[middle].max() < 0.35


def test_fill_stays_within_the_trusted_values():
    surface = icosphere(rounds=3)
    attachment = attach(surface, person())
    known = surface.vertices[:, 1] > 0.3
    values = np.where(known[:, None], surface.vertices, 99.0)
    filled = fill(attachment.graph, values, known)
    assert filled[:, 1].min() >= 0.3
    assert np.abs(filled).max() <= 1
    assert np.array_equal(filled[known], values[known])


def test_a_far_component_takes_its_closest_bone():
    body = person()
    hat = icosphere(0.05, rounds=1)
    head = body.joint_names.index("head")
    top = body.vertices[np.argmax(body.vertices[:, 1])].astype(np.float64)
    far = Surface(vertices=hat.vertices + top + [0, 0.3, 0], faces=hat.faces)
    skin = transfer_weights(join(on_body(), far), body)
    assert (skin.joints[-len(hat.vertices) :, 0] == head).all()


def test_parts_are_few_connected_and_follow_the_limbs():
    surface = on_body(0.01)
    skin = transfer_weights(surface, person())
    part = parts_of_faces(surface, skin, smallest=20)
    sizes = np.bincount(part)
    assert sizes[sizes > 0].min() >= 20
    left_arm = person().joint_names.index("left_elbow")
    assert (surface.vertices[surface.faces[part == left_arm]][..., 0] > 0.2).all()


def test_same_input_same_arrays():
    first, second = (transfer_weights(skirted(), person()) for _ in range(2))
    assert np.array_equal(first.joints, second.joints)
    assert np.array_equal(first.weights, second.weights)


def test_fewer_than_four_joints():
    skin = limit_influences(np.array([[0.25, 0.75]]))
    assert np.array_equal(skin.joints, [[1, 0, 0, 0]])
    assert np.array_equal(skin.weights, np.array([[0.75, 0.25, 0, 0]], dtype=np.float32))


@pytest.mark.parametrize(
    "weights", [[[0.5, 0.2, 0.1, 0.1]], [[np.nan, 0, 0, 0]], [[1.5, -0.5, 0, 0]], [[0.5, 0.0, 0.5, 0]]]
)
def test_unfinished_weights_are_refused(weights):
    with pytest.raises(GeometryError, match="skin"):
        Skin(joints=np.array([[1, 2, 3, 4]]), weights=np.array(weights, dtype=np.float32))


def test_a_vertex_without_weight_is_named():
    with pytest.raises(GeometryError, match="no weight"):
        limit_influences(np.zeros((2, 5)))
