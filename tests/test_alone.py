"""A person layer by layer: laid over one another the layers are the person, and none comes out of another."""

import numpy as np
import pytest
import torch

from avatargen import load_generator
from avatargen.body.model import canonical_body
from avatargen.errors import InputError
from tests.bodies import capsule_body

PEOPLE = ({"top": "suit", "hat": "hat"}, {"top": "shirt", "outer": "jacket"})


@pytest.fixture(scope="module")
def people():
    generator = load_generator()
    return [generator.sample(2, traits={"gender": "man"} | traits) for traits in PEOPLE]


def around(avatar, count: int, spread: float) -> np.ndarray:
    rng = np.random.default_rng(3)
    vertices = avatar.body.vertices
    near = vertices[rng.integers(len(vertices), size=count)] + rng.normal(size=(count, 3)) * spread
    return near.astype(np.float32)


def test_layers_have_the_names_of_what_is_worn(people):
    assert list(people[0].layers) == ["body", "socks", "shoes", "bottom", "top", "hat", "hair"]
    assert list(people[1].layers) == ["body", "socks", "shoes", "bottom", "top", "outer", "hair"]


def test_layers_laid_over_one_another_are_the_person(people):
    """On the person's surface some layer's surface is, and no layer's is outside it."""
    for avatar in people:
        points = torch.from_numpy(around(avatar, 6000, 0.012))
        whole = avatar.sdf(points)
        near = whole.abs() < 0.004
        parts = torch.stack([layer.sdf(points[near]) for layer in avatar.layers.values()]).min(dim=0).values
        apart = (parts - whole[near]).abs()
        assert int(near.sum()) > 500
        assert float((apart < 0.003).float().mean()) > 0.9


def test_nothing_beneath_comes_out_of_what_covers_it(people):
    """Where a garment hides what is beneath, that is 3 mm within it, but where it would be torn."""
    for avatar in people:
        points, layers = around(avatar, 6000, 0.012), avatar.layers
        names = [name for name in layers if name != "hair"]
        for number, name in enumerate(names[:-1]):
            inner = layers[name].sdf(torch.from_numpy(points)).numpy()
            for over in names[number + 1 :]:
                outer = layers[over].sdf(torch.from_numpy(points)).numpy()
                sure = layers[over].cover(points) == 1
                out = sure & (inner < 0) & (outer > -0.003)
                assert out.sum() <= 0.05 * max(sure.sum(), 100), (name, over, out.sum(), sure.sum())


def test_a_layer_covers_within_itself_alone(people):
    points = around(people[1], 4000, 0.02)
    for name, layer in people[1].layers.items():
        cover = layer.cover(points)
        assert cover.min() >= 0 and cover.max() <= 1
        if name in ("body", "hair"):
            assert not cover.any()
        assert (layer.sdf(torch.from_numpy(points)).numpy()[cover > 0] < 0).all()
    assert not people[1].cover(points).any()


def test_what_clothes_hide_of_the_body_is_under_them(people):
    for avatar in people:
        hidden = avatar.hidden
        assert hidden.shape == (len(avatar.body.vertices),) and 0.3 < hidden.mean() < 0.7
        whole = avatar.sdf(torch.from_numpy(avatar.body.vertices.astype(np.float32))).numpy()
        assert (whole[hidden] < 0.001).mean() > 0.92


def test_another_body_has_the_same_layers():
    avatar = load_generator(body=capsule_body()).sample(6)
    body = canonical_body(capsule_body())
    assert avatar.hidden.shape == (len(body.vertices),)
    points = around(avatar, 200, 0.01)
    for layer in avatar.layers.values():
        assert np.isfinite(layer.sdf(torch.from_numpy(points)).numpy()).all()
        assert np.isfinite(layer.color(torch.from_numpy(points)).numpy()).all()


def test_a_person_of_one_field_has_no_layers(people):
    layer = people[0].layers["top"]
    with pytest.raises(InputError, match="one field"):
        _ = layer.layers
    assert not layer.hidden.any()


def test_hair_is_a_wig(people):
    """Deep within the head there is none, and none of its surface: its field says nothing there."""
    for avatar in people:
        points = around(avatar, 6000, 0.03)
        points = points[points[:, 1] > 0.65]
        above = avatar.body.distance.query(points).distance
        found = avatar.layers["hair"].sdf(torch.from_numpy(points)).numpy()
        assert (found[above < -0.02] > 0.01).all() and (above < -0.02).sum() > 20
        assert (found < 0).any()
