"""Handles are cut, and nothing else changes."""

import numpy as np
import pytest
from shapes import BOX, capsule, icosphere, sphere, torus, union

from assets.isosurface.extract import ExtractConfig, extract
from assets.mesh.handles import around, find_loops, triangulate, without_handles
from assets.mesh.measure import surface_error
from assets.mesh.surface import Surface, count_pieces, euler_number, find_defects, volume
from assets.simplify.reduce import reduce

CELLS = ExtractConfig(resolution=64)


def genus(surface: Surface) -> int:
    return count_pieces(surface) - euler_number(surface) // 2


def bridged():
    """Two balls that touch in a bridge and again in three thin ones: three handles."""
    bars = [capsule((-0.3, y, z), (0.3, y, z), 0.05) for y, z in [(0.25, 0), (-0.2, 0.15), (-0.2, -0.15)]]
    field = union(sphere(0.35, (-0.4, 0, 0)), sphere(0.35, (0.4, 0, 0)))
    for bar in [capsule((-0.3, 0, 0), (0.3, 0, 0), 0.05), *bars]:
        field = union(field, bar)
    return field


def test_what_has_no_handle_stays_as_it_is() -> None:
    ball = icosphere(0.5)
    kept, cut = without_handles(ball, 10.0)
    assert kept is ball
    assert cut == 0


def test_a_ring_is_cut_around_its_tube_and_closed_without_a_change_of_volume() -> None:
    ring = extract(torus(0.6, 0.2), BOX, CELLS)
    assert genus(ring) == 1
    severed, cut = without_handles(ring, 2.0)
    assert cut == 1
    assert genus(severed) == 0
    assert not find_defects(severed)
    assert volume(severed) == pytest.approx(volume(ring), rel=1e-9)  # both caps are the same disc
    count = len(ring.vertices)
    assert np.array_equal(severed.vertices[:count], ring.vertices)
    rim = severed.vertices[count:]
    # the tube's circumference is 1.26 m along the surface and a little more along edges
    assert 1.2 < around(rim) < 1.45
    assert np.isin(rim, ring.vertices).all()


def test_a_shortest_loop_through_a_root_goes_around_the_tube() -> None:
    ring = extract(torus(0.6, 0.2), BOX, CELLS)
    inner = int(np.argmin(np.linalg.norm(ring.vertices - [0.4, 0, 0], axis=1)))
    loops = find_loops(ring, np.array([inner]))
    assert len(loops.vertices) == 2
    assert list(loops.lengths) == sorted(loops.lengths)
    assert inner in loops.vertices[0]


def test_longer_loops_are_left() -> None:
    ring = extract(torus(0.6, 0.2), BOX, CELLS)
    kept, cut = without_handles(ring, 1.0)
    assert (genus(kept), cut) == (1, 0)
    assert len(kept.faces) == len(ring.faces)


def test_several_handles_go() -> None:
    balls = extract(bridged(), BOX, CELLS)
    assert genus(balls) == 3
    severed, cut = without_handles(balls, 0.6)
    assert (genus(severed), cut, count_pieces(severed)) == (0, 3, 1)
    assert not find_defects(severed)
    assert volume(severed) == pytest.approx(volume(balls), rel=1e-9)


def test_pieces_are_told_apart() -> None:
    ring, other = extract(torus(0.5, 0.1), BOX, CELLS), icosphere(0.1)
    both = Surface(
        vertices=np.concatenate([other.vertices, ring.vertices, other.vertices + 3]),
        faces=np.concatenate(
            [
                other.faces,
                ring.faces + len(other.vertices),
                other.faces + len(other.vertices) + len(ring.vertices),
            ]
        ),
    )
    severed, cut = without_handles(both, 2.0)
    assert (count_pieces(severed), genus(severed), cut) == (3, 0, 1)
    assert not find_defects(severed, pieces=3)


def test_a_reduced_surface_is_near_the_field_without_its_handles() -> None:
    dense = extract(bridged(), BOX, CELLS)
    kept, cut = (reduce(dense, bridged(), 3000, longest=longest) for longest in (0.0, 0.6))
    assert (genus(kept), genus(cut)) == (3, 0)
    assert not find_defects(cut)
    assert len(cut.faces) <= 3000
    # walls across the bridges are off the field, and they are small
    assert surface_error(cut, bridged()).mean_mm < surface_error(kept, bridged()).mean_mm + 0.5


def test_triangles_cross_a_slit_the_short_way_and_use_no_edge_twice() -> None:
    along = np.linspace(0, 1, 9)
    slit = np.concatenate(
        [np.stack([along, 0 * along, along**2], 1), np.stack([along, 0.01 + 0 * along, along**2], 1)[::-1]]
    )
    triangles, middle = triangulate(slit, set())
    assert (triangles.shape, middle.shape) == ((16, 3), (0, 3))
    sides = slit[triangles] - slit[np.roll(triangles, 1, axis=1)]
    assert np.linalg.norm(sides, axis=2).max() < 0.3  # an edge and the slit's width
    taken = {(0, 2), (1, 3)}
    fan, middle = triangulate(np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]), taken)
    assert np.allclose(middle, [[0.5, 0.5, 0]])
    assert (fan == 4).any(axis=1).all()
