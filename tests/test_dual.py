import numpy as np
import pytest
import torch
from shapes import BOX, sphere

from assets.isosurface.cell import EDGES, TABLES, edge_between
from assets.isosurface.dual import Leaves, contour
from assets.isosurface.grid import CORNERS, CornerValues, make_grid
from assets.mesh.surface import Surface, directed_edges, find_defects, volume

SHEETS, SHEET_OF_EDGE = TABLES.sheet_count, TABLES.sheet_of_edge
PAIRS = [(a, b) for a in range(8) for b in range(a + 1, 8) if (a ^ b).bit_count() == 1]


def crossed(case: int) -> set[int]:
    return {edge_between(a, b) for a, b in PAIRS if (case >> a ^ case >> b) & 1}


def test_edges_have_numbers_of_their_own():
    assert {edge_between(a, b) for a, b in PAIRS} == set(range(EDGES))


@pytest.mark.parametrize("case", [0, 1, 7, 0b10000001, 0b01101001, 200, 255])
def test_each_crossed_edge_belongs_to_one_sheet(case):
    sheets = SHEET_OF_EDGE[case]
    assert {edge for edge in range(EDGES) if sheets[edge] >= 0} == crossed(case)
    assert set(sheets[sheets >= 0].tolist()) == set(range(SHEETS[case]))


def test_every_sheet_is_a_loop_over_the_sides():
    """At each side, a sheet's crossings come in twos."""
    sides = [[k for k in range(8) if (k >> axis & 1) == across] for axis in range(3) for across in (0, 1)]
    for case in range(256):
        for side in sides:
            edges = [edge_between(a, b) for a, b in PAIRS if a in side and b in side]
            for sheet in range(SHEETS[case]):
                assert sum(SHEET_OF_EDGE[case, edge] == sheet for edge in edges) in (0, 2, 4)


def test_corners_inside_are_cut_off_one_by_one():
    assert SHEETS[[0, 255, 1, 254]].tolist() == [0, 0, 1, 1]
    assert SHEETS[0b10000001] == 2  # opposite corners
    assert SHEETS[0b01101001] == 4  # no two next to each other
    assert SHEETS[0b10010110] == 4
    assert SHEETS[0b00001111] == 1


def leaves_of(values: CornerValues, halved: np.ndarray) -> Leaves:
    """Every crossed cell of a grid, small within the halved large ones."""

    def cells(size):
        axes = [np.arange(0, count, size) for count in values.grid.shape]
        found = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        inside = values.ask(values.slots_of_cells(found, size)) < 0
        return found[inside.any(axis=1) & ~inside.all(axis=1)]

    names = values.grid.keys
    small, large = cells(1), cells(2)
    return Leaves(
        small=small[np.isin(names(small - small % 2), names(halved))],
        large=large[~np.isin(names(large), names(halved))],
        halved=halved,
    )


def opened(surface: Surface) -> int:
    """How many directed edges have no opposite of their own."""
    ends, count = directed_edges(surface.faces), len(surface.vertices)
    forth, back = (np.bincount(a * count + b, minlength=count**2) for a, b in (ends.T, ends.T[::-1]))
    return int(np.abs(forth - back).sum())


@pytest.mark.parametrize("seed", range(5))
def test_noise_in_small_cells_closes(seed):
    """Whatever the signs are: every edge of a face runs as often the other way."""
    rng = np.random.default_rng(seed)
    grid = make_grid(BOX, 12, together=2)
    table = torch.from_numpy(rng.normal(size=(13, 13, 13)))
    table[[0, -1]] = table[:, [0, -1]] = table[:, :, [0, -1]] = 1.0

    def noise(points):
        index = ((points.double() + 1) * 6).round().long()
        return table[index[:, 0], index[:, 1], index[:, 2]]

    values = CornerValues(noise, grid)
    everything = np.stack(np.meshgrid(*[np.arange(0, 12, 2)] * 3), axis=-1).reshape(-1, 3)
    found = contour(values, leaves_of(values, everything))
    assert len(found.faces) > 1000
    assert opened(Surface(vertices=found.vertices, faces=found.faces)) == 0


@pytest.mark.parametrize("share", [0.0, 0.3, 0.7, 1.0])
def test_two_sizes_of_cells_close_without_cracks(share):
    """A ball, with large cells halved at random."""
    grid = make_grid(BOX, 32, together=2)
    values = CornerValues(sphere(0.63), grid)
    rng = np.random.default_rng(0)
    everything = np.stack(np.meshgrid(*[np.arange(0, 32, 2)] * 3), axis=-1).reshape(-1, 3)
    halved = everything[rng.random(len(everything)) < share]
    found = contour(values, leaves_of(values, halved))
    surface = Surface(vertices=grid.points(found.vertices), faces=found.faces)

    assert not find_defects(surface)
    assert volume(surface) == pytest.approx(4 / 3 * np.pi * 0.63**3, rel=0.05)
    assert np.abs(np.linalg.norm(surface.vertices, axis=1) - 0.63).max() < 0.2 * grid.cell_size * (
        4 if share < 1 else 1
    )
    outward = surface.vertices / np.linalg.norm(surface.vertices, axis=1, keepdims=True)
    assert found.gradients / grid.cell_size == pytest.approx(outward, abs=0.1)


def test_corners_of_the_grid_are_those_of_the_cells():
    assert {tuple(corner) for corner in CORNERS.tolist()} == {(k & 1, k >> 1 & 1, k >> 2) for k in range(8)}
