import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from shapes import icosphere

from assets.mesh.connectivity import label_fans
from assets.mesh.repair import next_edge
from assets.mesh.surface import (
    Surface,
    count_split_vertices,
    directed_edges,
    label_components,
    opposite_edges,
)


def soups():
    """Meshes that are whole, and triangles on random vertices: open, crowded, doubled, degenerate."""
    ball = icosphere(1.0, rounds=2)
    yield ball.faces, len(ball.vertices)
    yield ball.faces[::2], len(ball.vertices) + 5
    yield np.zeros((0, 3), dtype=np.int64), 4
    yield np.array([[0, 1, 2], [0, 2, 1]]), 3
    yield np.array([[0, 1, 2], [0, 1, 2], [1, 0, 2], [3, 3, 3]]), 4
    for seed in range(20):
        rng = np.random.default_rng(seed)
        yield rng.integers(0, 12, (rng.integers(1, 60), 3)), 12
    for seed in range(10):
        rng = np.random.default_rng(seed)
        shuffled = rng.permutation(len(ball.vertices))[rng.permutation(ball.faces)]
        yield np.concatenate([shuffled, shuffled[: seed * 3, ::-1]]), len(ball.vertices)


def same_edges(faces):
    """For each directed edge the indices of all on the same two vertices, by looking at every pair."""
    edges = np.sort(directed_edges(faces), axis=1)
    return [np.flatnonzero((edges == edge).all(axis=1)) for edge in edges]


@pytest.mark.parametrize("number", range(35))
def test_opposite_edges_are_those_found_by_looking_at_every_pair(number):
    faces, count = list(soups())[number]
    edges, twin = directed_edges(faces), opposite_edges(faces, count)
    for edge, same in enumerate(same_edges(faces)):
        others = same[same != edge]
        only = len(others) == 1 and (edges[others[0]] == edges[edge][::-1]).all()
        assert twin[edge] == (others[0] if only else -1)


def fans_at(faces, twin, vertex):
    """How many groups the faces' corners at a vertex fall into, joined where faces share an edge there."""
    corners = np.flatnonzero(faces.reshape(-1) == vertex)
    group = {corner: {corner} for corner in corners.tolist()}
    for corner in corners.tolist():
        after = twin[corner]  # the edge that leaves here, seen from the other face, ends here
        if after >= 0:
            other = int(after - after % 3 + (after + 1) % 3)
            if other in group:
                joined = group[corner] | group[other]
                for each in joined:
                    group[each] = joined
    return len({id(joined) for joined in group.values()})


@pytest.mark.parametrize("number", range(25, 35))
def test_split_vertices_of_shuffled_closed_meshes(number):
    faces, count = list(soups())[number]
    twin = opposite_edges(faces, count)
    whole = [vertex for vertex in range(count) if fans_at(faces, twin, vertex) == 1]
    crowded = np.unique(faces.reshape(-1)[twin < 0])  # where a walk may end early
    found = count_split_vertices(Surface(vertices=np.zeros((count, 3)), faces=faces), twin)
    assert count - len(whole) <= found <= count - len(np.setdiff1d(whole, crowded))


def test_two_balls_that_touch_in_a_vertex_split_it():
    ball = icosphere(1.0, rounds=1)
    count = len(ball.vertices)
    other = np.where(ball.faces == 0, 0, ball.faces + count - 1)
    faces = np.concatenate([ball.faces, other])
    surface = Surface(vertices=np.zeros((2 * count - 1, 3)), faces=faces)
    twin = opposite_edges(faces, len(surface.vertices))
    assert (twin >= 0).all()
    assert count_split_vertices(surface, twin) == 1


@pytest.mark.parametrize("number", range(35))
def test_components_are_scipys(number):
    faces, count = list(soups())[number]
    rows, columns = faces[:, [0, 1]].reshape(-1), faces[:, [1, 2]].reshape(-1)
    graph = coo_array((np.ones(len(rows)), (rows, columns)), shape=(count, count))
    wanted, labels = connected_components(graph, directed=False)
    found, of_vertex = label_components(Surface(vertices=np.zeros((count, 3)), faces=faces))
    assert found == wanted
    assert (of_vertex == labels).all()


def test_a_hub_of_many_faces_takes_no_longer_than_its_edges():
    """A cone whose tip is vertex 0 and has 200,000 faces: every edge finds its opposite."""
    count = 200_000
    rim = np.arange(count)
    tip, base = np.zeros(count, dtype=int), np.full(count, count + 1)
    after = (rim + 1) % count
    faces = np.concatenate(
        [np.stack([tip, rim + 1, after + 1], axis=1), np.stack([base, after + 1, rim + 1], axis=1)]
    )
    twin = opposite_edges(faces, count + 2)
    assert (twin >= 0).all()
    assert (twin[twin] == np.arange(len(twin))).all()


@pytest.mark.parametrize("number", range(35))
def test_fans_are_corners_joined_across_shared_edges(number):
    faces, count = list(soups())[number]
    faces = np.ascontiguousarray(faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)])
    twin = opposite_edges(faces, count)
    edge = np.flatnonzero(twin >= 0)
    rows = np.concatenate([edge, next_edge(edge)])  # the corners at an edge's start and end ...
    columns = np.concatenate([next_edge(twin[edge]), twin[edge]])  # ... are those at its twin's end and start
    graph = coo_array((np.ones(len(rows)), (rows, columns)), shape=(faces.size, faces.size))
    wanted, labels = connected_components(graph, directed=False)

    fan, first = label_fans(faces, twin)

    assert fan.tolist() == labels.tolist() and len(first) == wanted
    assert first.tolist() == np.unique(labels, return_index=True)[1].tolist()
