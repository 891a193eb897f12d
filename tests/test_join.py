"""Small flat charts sewn onto their neighbours."""

import numpy as np
import pytest

from assets.mesh.surface import Surface, opposite_edges
from assets.texture.flat_cut import FlatCut, overlaps
from assets.texture.join import join_small
from assets.texture.seams import cut_open


def strip(count: int) -> Surface:
    """Triangles in a row in the plane, each on an edge of the one before."""
    along = np.arange(count + 2)
    vertices = np.stack([0.05 * along, 0.1 * (along % 2), np.zeros(count + 2)], axis=1)
    faces = np.stack([along[:-2], along[1:-1], along[2:]], axis=1)
    faces[::2] = faces[::2, [0, 2, 1]]
    return Surface(vertices=vertices, faces=faces)


def laid_apart(surface: Surface, parts: np.ndarray) -> tuple[FlatCut, np.ndarray]:
    """Its parts as charts, each turned and a metre from the next."""
    twin = opposite_edges(surface.faces, len(surface.vertices))
    edge = np.arange(len(twin))
    opened = (twin < 0) | (parts[edge // 3] != parts[np.maximum(twin, 0) // 3])
    cut = cut_open(surface.faces, twin, opened)
    z = surface.vertices[cut.vertex_map] @ np.array([1, 1j, 0])
    return FlatCut(cut=cut, z=z * np.exp(1j * cut.owner) + cut.owner), twin


def lengths(flat: FlatCut) -> np.ndarray:
    corners = flat.z[flat.cut.faces]
    return np.abs(corners - np.roll(corners, -1, axis=1))


def test_what_lay_together_lies_together_again() -> None:
    surface = strip(30)
    flat, twin = laid_apart(surface, np.repeat([0, 1, 2, 3], [20, 1, 2, 7]))
    whole = join_small(surface, flat, twin, np.zeros(flat.cut.count, dtype=np.int64))
    assert whole.cut.count == 1
    assert whole.cut.euler_numbers().tolist() == [1]
    np.testing.assert_allclose(lengths(whole), lengths(flat), atol=1e-4)
    assert len(overlaps(whole)) == 0


def test_only_charts_of_one_kind_join_small() -> None:
    surface = strip(30)
    flat, twin = laid_apart(surface, np.repeat([0, 1], [20, 10]))
    apart = join_small(surface, flat, twin, np.arange(2))
    assert apart is flat


@pytest.mark.parametrize(("degrees", "charts"), [(30, 1), (55, 1), (65, 2), (90, 2)])
def test_a_chart_is_sewn_only_where_it_has_room(degrees: float, charts: int) -> None:
    """Beside a fan of five faces of 60 degrees, so that 60 are left at its tip."""
    angles = np.radians(np.append(60.0 * np.arange(6), -degrees))
    rim = np.stack([np.cos(angles), np.sin(angles), np.zeros(7)], axis=1)
    surface = Surface(
        vertices=np.concatenate([np.zeros((1, 3)), rim]),
        faces=np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5], [0, 5, 6], [0, 7, 1]]),
    )
    flat, twin = laid_apart(surface, np.array([0, 0, 0, 0, 0, 1]))
    sewn = join_small(surface, flat, twin, np.zeros(2, dtype=np.int64))
    assert sewn.cut.count == charts
    np.testing.assert_allclose(lengths(sewn), lengths(flat), atol=2e-2)
