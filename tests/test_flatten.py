import numpy as np
import pytest

from assets.texture.flatten import Sheets, as_rigid_as_possible, flatten, singular_values
from assets.texture.relax import relax


def grid(rows=12, columns=20):
    """Places of a grid in the unit square, and its faces."""
    u, v = np.meshgrid(np.linspace(0, 1, columns), np.linspace(0, 1, rows))
    index = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, :-1], index[1:, 1:]
    faces = np.concatenate([np.stack([a, b, d], -1).reshape(-1, 3), np.stack([a, d, c], -1).reshape(-1, 3)])
    return u.reshape(-1), v.reshape(-1), faces


def sheet(shape):
    u, v, faces = grid()
    vertices = {
        "plane": lambda: np.stack([2 * u, v, 0 * u], axis=1),
        "cylinder": lambda: np.stack([np.cos(5 * u), v, np.sin(5 * u)], axis=1),
        "cone": lambda: (
            (1 + v)[:, None] * np.stack([0.6 * np.cos(4 * u), 0.8 + 0 * u, 0.6 * np.sin(4 * u)], 1)
        ),
        "dome": lambda: np.stack([2 * u - 1, 2 * v - 1, 0.5 * np.cos(2 * u - 1) * np.cos(2 * v - 1)], 1),
    }[shape]()
    return Sheets(vertices=vertices, faces=faces, chart=np.zeros(len(faces), dtype=np.int64))


@pytest.mark.parametrize("shape", ["plane", "cylinder", "cone"])
def test_what_can_be_unrolled_keeps_its_lengths(shape):
    sheets = sheet(shape)
    large, small = singular_values(sheets, flatten(sheets))
    assert large.max() < 1.01
    assert small.min() > 0.99


def test_charts_do_not_touch_each_other_and_are_turned_the_same_way():
    one, two = sheet("dome"), sheet("cone")
    both = Sheets(
        vertices=np.concatenate([one.vertices, two.vertices]),
        faces=np.concatenate([one.faces, two.faces + len(one.vertices)]),
        chart=np.repeat([0, 1], [len(one.faces), len(two.faces)]),
    )
    z = flatten(both)
    for alone, part in ((one, z[: len(one.vertices)]), (two, z[len(one.vertices) :])):
        for found, wanted in zip(
            singular_values(alone, part), singular_values(alone, flatten(alone)), strict=True
        ):
            assert found == pytest.approx(wanted, abs=1e-3)
    assert (singular_values(both, z)[1] > 0).all()


def test_singular_values_are_those_of_the_map():
    sheets, rng = sheet("plane"), np.random.default_rng(0)
    matrix = rng.normal(size=(2, 2))
    matrix *= np.sign(np.linalg.det(matrix))
    uv = sheets.vertices[:, :2] @ matrix.T
    large, small = singular_values(sheets, uv[:, 0] + 1j * uv[:, 1])
    wanted = np.linalg.svd(matrix, compute_uv=False)
    sign = np.sign(np.linalg.det(matrix))
    assert large == pytest.approx(wanted[0])
    assert small == pytest.approx(sign * wanted[1])


def test_turned_faces_are_turned_back_and_others_stay():
    sheets = sheet("plane")
    z = as_rigid_as_possible(sheets, sheets.vertices[:, 0] + 1j * sheets.vertices[:, 1])
    wrong = z.copy()
    wrong[125] += 0.3 + 0.25j  # far over its neighbours
    assert (singular_values(sheets, wrong)[1] <= 0).any()
    chosen = np.zeros(len(z), dtype=bool)
    chosen[125] = True
    found = relax(sheets, wrong, chosen)
    large, small = singular_values(sheets, found)
    assert small.min() > 0.9 and large.max() < 1.1
    assert np.array_equal(found[~chosen], wrong[~chosen])
