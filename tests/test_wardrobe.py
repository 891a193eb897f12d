"""The wardrobe: the coding of z, places around the body, and what clothes may do to it."""

import numpy as np
import pytest
import torch

from avatargen.avatar import shipped
from avatargen.body.load import load_body
from avatargen.body.model import canonical_body
from avatargen.body.model import shape as shape_body
from avatargen.errors import InputError
from avatargen.wardrobe import MARKS
from avatargen.wardrobe.attributes import LATENT_SIZE, People, phenotype
from avatargen.wardrobe.chart import CLOSING, Chart
from avatargen.wardrobe.layers import Layer, bump, over_those, smooth_min
from avatargen.wardrobe.person import dress_up


@pytest.fixture(scope="module")
def chart() -> Chart:
    return Chart(canonical_body(load_body(shipped("body.npz"))), MARKS, spacing=0.02)


@pytest.fixture(scope="module")
def people() -> People:
    return People(torch.randn(12, LATENT_SIZE, generator=torch.Generator().manual_seed(5)))


def random_points(chart: Chart, count: int, reach: float, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    vertices = chart.body.vertices[rng.integers(len(chart.body.vertices), size=count)]
    return (vertices + rng.normal(0, reach, (count, 3))).astype(np.float32)


def test_the_coding_is_gaussian_noise_read_one_coordinate_an_attribute():
    z = torch.randn(4000, LATENT_SIZE, generator=torch.Generator().manual_seed(1))
    people = People(z)

    sleeve = people.measure("sleeve").flatten()
    assert torch.allclose(
        sleeve.quantile(torch.tensor([0.1, 0.5, 0.9])), torch.tensor([0.1, 0.5, 0.9]), atol=0.03
    )
    assert set(people.choice("woman").flatten().tolist()) == {0.0, 1.0}
    assert set(people.kind("hair_a", "hair_b", "hair_c").flatten().tolist()) == set(range(8))
    colour = people.colour("top")
    assert colour.shape == (4000, 1, 3) and colour.min() >= 0 and colour.max() <= 1
    assert phenotype(people).min() >= 0 and phenotype(people).max() <= 1


def test_a_latent_of_another_size_is_refused():
    with pytest.raises(InputError, match="80"):
        People(torch.zeros(2, 64))


def test_the_leg_frame_undoes_the_x_pose(chart: Chart):
    body = chart.body
    rest = shape_body(body.source, np.zeros(0)).joints
    for side in ("left", "right"):
        for name in ("knee", "ankle", "foot"):
            j, hip = body.joint_names.index(f"{side}_{name}"), body.joint_names.index(f"{side}_hip")
            found = chart.leg_frame(body.joints[j : j + 1])[0]
            wanted = (rest[j] - rest[hip]) * (1 if side == "left" else (-1, 1, 1))
            assert np.abs(found - wanted).max() < 2e-3  # the two hips mirror each other to a millimetre


def test_the_closing_holds_the_body_and_bridges_only_hollows(chart: Chart):
    points = random_points(chart, 4000, 0.02, seed=2)
    places = chart.places(points)

    assert (places.closed <= places.body + 0.006).all()  # a closing contains its set; 2 cm grid
    assert (places.closed >= places.body - 2 * CLOSING).all()
    assert (places.shod <= places.closed + 1e-6).all()
    on_ball = chart.body.vertices[chart.eye_vertices > 0]
    assert (chart.places(on_ball).eye > 0.99).all()


def test_clothes_only_add_to_the_body(chart: Chart, people: People):
    places = chart.places(random_points(chart, 3000, 0.03, seed=3))
    person = dress_up(places[None], people)

    assert person.sdf.shape == (12, 3000) and person.color.shape == (12, 3000, 3)
    assert torch.isfinite(person.sdf).all() and torch.isfinite(person.color).all()
    face = (places.p[:, 1] > 0.57) & (places.p[:, 2] > 0.02)  # chins and noses may lie behind the body's own
    assert (person.sdf <= places.body + torch.where(face, 0.0065, 1e-6)).all()
    assert person.color.min() >= 0 and person.color.max() <= 1


def test_the_target_is_close_to_a_distance(chart: Chart, people: People):
    near = random_points(chart, 1500, 0.02, seed=4)
    step = np.random.default_rng(4).normal(size=near.shape)
    step = (0.0005 * step / np.linalg.norm(step, axis=1, keepdims=True)).astype(np.float32)
    a, b = (dress_up(chart.places(p)[None], people).sdf for p in (near, near + step))
    slope = (a - b).abs() / 0.0005

    assert (slope > 1.5).float().mean() < 0.01
    assert (slope > 4).float().mean() < 1e-3  # the body's own toes and lips touch: its distance jumps there


def test_a_layer_is_made_and_laid_only_over_those_who_wear_it():
    random = torch.Generator().manual_seed(0)
    below = Layer(sdf=torch.linspace(-0.1, 0.1, 9).expand(2, -1), color=torch.rand(2, 9, 3, generator=random))
    layer = Layer(sdf=torch.full((2, 9), -5.0), color=torch.zeros(2, 9, 3))
    result = over_those(below, torch.tensor([[0.0], [1.0]]), lambda: layer)
    assert torch.equal(result.sdf[0], below.sdf[0]) and torch.equal(result.color[0], below.color[0])
    assert torch.equal(result.sdf[1], layer.sdf[1]) and torch.equal(result.color[1], layer.color[1])

    def unasked() -> Layer:
        raise AssertionError

    assert over_those(below, torch.zeros(2, 1), unasked) is below


def test_a_bump_is_the_gaussian_however_far():
    x = torch.linspace(-3, 3, 601)
    wanted = torch.exp(-((x.double() / 0.1) ** 2))
    found = bump(x, 0.0, 0.1)
    assert torch.allclose(found.double(), wanted, rtol=1e-4, atol=2e-38)
    assert found.min() >= torch.finfo(torch.float32).tiny  # smaller ones take ten times as long


def test_smooth_min_is_within_a_quarter_radius_of_the_minimum():
    a, b = torch.randn(2, 1000, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    low = smooth_min(a, b, 0.5)

    assert (low <= torch.minimum(a, b)).all()
    assert (low >= torch.minimum(a, b) - 0.125 - 1e-12).all()
    assert torch.equal(low[(a - b).abs() > 0.5], torch.minimum(a, b)[(a - b).abs() > 0.5])


def test_choices_show(chart: Chart):
    """Flipping one attribute changes the field where it should, and not elsewhere."""
    z = torch.full((2, LATENT_SIZE), -0.5)
    z[1, 0] = 0.5  # a woman
    z[:, 4] = 0.5  # skirt for women
    places = chart.places(
        np.array([[0.0, -0.30, 0.0], [0.0, 0.75, 0.12]], np.float32)
    )  # between the legs; forehead
    man, woman = dress_up(places[None], People(z)).sdf[:, 0]

    assert man > 0.05 and woman < 0
