import numpy as np
import pytest
from shapes import BOX, icosphere, torus

from assets.isosurface.extract import ExtractConfig, extract
from assets.mesh.surface import directed_edges, edge_lengths, opposite_edges
from assets.simplify.simplify import SimplifyConfig, simplify
from assets.texture.seams import cut_open, cut_to_disks, shorten_borders, without_teeth


def ring(faces=900):
    return simplify(extract(torus(), BOX, ExtractConfig(resolution=64)), SimplifyConfig(target_faces=faces))


def halves(surface, axis, wave=0.0):
    """0 on one side of the middle of an axis and 1 on the other; the border waves by so many metres."""
    middle = surface.vertices[surface.faces].mean(axis=1)
    return (middle[:, axis] + wave * np.sin(25 * middle[:, axis - 1]) > 0).astype(np.int64)


def disks(surface, panel, price=None):
    twin = opposite_edges(surface.faces, len(surface.vertices))
    price = np.ones(len(surface.vertices)) if price is None else price
    return cut_open(surface.faces, twin, cut_to_disks(surface, panel, twin, price)), twin


def border_length(surface, panel, twin):
    edge = np.flatnonzero(panel[np.arange(len(twin)) // 3] != panel[twin // 3])
    return edge_lengths(surface, directed_edges(surface.faces)[edge]).sum() / 2


@pytest.mark.parametrize("panels", ["one", "two tubes", "two rings", "scattered"])
def test_panels_of_a_ring_become_disks(panels):
    surface = ring()
    panel = {
        "one": lambda: np.zeros(len(surface.faces), dtype=np.int64),  # cut along both of its loops
        "two tubes": lambda: halves(surface, 0),
        "two rings": lambda: halves(surface, int(np.ptp(surface.vertices, axis=0).argmin())),
        "scattered": lambda: np.random.default_rng(0).integers(0, 3, len(surface.faces)),
    }[panels]()
    cut, twin = disks(surface, panel)
    assert (cut.euler_numbers() == 1).all()
    assert np.array_equal(cut.vertex_map[cut.faces], surface.faces)
    inside = np.flatnonzero(~cut.open)
    assert (panel[inside // 3] == panel[twin[inside] // 3]).all()
    assert (cut.chart[inside // 3] == cut.chart[twin[inside] // 3]).all()


def test_a_ball_of_one_panel_stays_closed():
    cut, _ = disks(icosphere(rounds=2), np.zeros(320, dtype=np.int64))
    assert cut.euler_numbers().tolist() == [2]


def test_seams_run_where_they_are_cheap():
    """Of a ring cut into two tubes each is opened along the side with the low price."""
    surface = ring(3000)
    panel = halves(surface, 0)
    axis = int(np.ptp(surface.vertices, axis=0).argmin())  # out of the ring's plane
    price = np.where(surface.vertices[:, axis] > 0, 1.0, 50.0)
    cut, twin = disks(surface, panel, price)
    seam = np.flatnonzero(cut.open & (panel[np.arange(len(twin)) // 3] == panel[twin // 3]))
    assert len(seam) > 10
    assert (surface.vertices[directed_edges(surface.faces)[seam].reshape(-1), axis] > -0.05).all()


def test_borders_become_shorter_and_nothing_else():
    surface = icosphere(rounds=4)
    twin = opposite_edges(surface.faces, len(surface.vertices))
    panel = without_teeth(halves(surface, 0, wave=0.05), twin)
    short = shorten_borders(surface, panel, twin)
    assert set(short) == {0, 1}
    middle = surface.vertices[surface.faces].mean(axis=1)
    assert (short == panel)[np.abs(middle[:, 0]) > 0.5].all()
    assert border_length(surface, short, twin) < border_length(surface, panel, twin)
    assert border_length(surface, short, twin) < 1.25 * 2 * np.pi
    assert np.array_equal(shorten_borders(surface, panel, twin, frozenset({(0, 1)})), panel)


def test_teeth_are_taken_off():
    surface = icosphere(rounds=3)
    twin = opposite_edges(surface.faces, len(surface.vertices))
    panel = halves(surface, 1)
    clean = without_teeth(panel, twin)
    beside = clean[twin.reshape(-1, 3) // 3] != clean[:, None]
    assert beside.sum(axis=1).max() <= 1
    assert (clean != panel).mean() < 0.1
