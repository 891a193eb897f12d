"""Collapses against slow, obvious versions."""

import numpy as np
from shapes import icosphere

from assets.mesh.surface import Surface, directed_edges, find_defects
from assets.simplify.half_edge_collapse import (
    changed_corners,
    independent_set,
    meets_link_condition,
    nondegenerate,
)


def neighbours(faces: np.ndarray) -> dict[int, set[int]]:
    around: dict[int, set[int]] = {}
    for a, b in directed_edges(faces).tolist():
        around.setdefault(a, set()).add(b)
    return around


def test_the_link_condition():
    ball = icosphere(rounds=2)
    around = neighbours(ball.faces)
    edges = directed_edges(ball.faces)
    obvious = [len(around[a] & around[b]) == 2 for a, b in edges.tolist()]
    assert np.array_equal(meets_link_condition(ball.faces, len(ball.vertices), edges), obvious)

    tetrahedron = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
    assert not meets_link_condition(tetrahedron, 4, directed_edges(tetrahedron)).any()
    pillow = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1], [4, 2, 1], [4, 3, 2], [4, 1, 3]])
    assert not meets_link_condition(pillow, 5, np.array([[1, 2]])).any()  # 1 and 2 share 0, 4 and 3
    assert meets_link_condition(pillow, 5, np.array([[0, 1]])).all()


def test_changed_corners_are_those_at_the_start_of_faces_that_stay():
    ball = icosphere(rounds=1)
    edges = directed_edges(ball.faces)[::7]
    candidate, corner = changed_corners(ball.faces, edges)
    found = sorted(zip(candidate.tolist(), corner.tolist(), strict=True))
    obvious = [
        (n, 3 * f + i)
        for n, (start, end) in enumerate(edges.tolist())
        for f, face in enumerate(ball.faces.tolist())
        for i in range(3)
        if face[i] == start and end not in face
    ]
    assert found == sorted(obvious)


def test_chosen_collapses_share_no_neighbour_and_the_cheapest_is_among_them():
    ball = icosphere(rounds=3)
    edges = directed_edges(ball.faces)
    cost = np.random.default_rng(0).random(len(edges))
    chosen = independent_set(ball.faces, len(ball.vertices), edges, cost)
    around = neighbours(ball.faces)
    taken: set[int] = set()
    for start in edges[chosen, 0].tolist():
        ring = around[start] | {start}
        assert not ring & taken
        taken |= ring
    assert cost.argmin() in chosen
    assert len(chosen) > 0.03 * len(ball.vertices)


def test_all_chosen_at_once_leave_a_sound_surface():
    ball = icosphere(rounds=3)
    edges = directed_edges(ball.faces)
    edges = edges[meets_link_condition(ball.faces, len(ball.vertices), edges)]
    chosen = edges[
        independent_set(ball.faces, len(ball.vertices), edges, np.arange(len(edges), dtype=np.float64))
    ]
    into = np.arange(len(ball.vertices))
    into[chosen[:, 0]] = chosen[:, 1]
    faces = into[ball.faces]
    kept = np.unique(faces[nondegenerate(faces)])
    place = np.zeros(len(ball.vertices), dtype=np.int64)
    place[kept] = np.arange(len(kept))
    left = Surface(vertices=ball.vertices[kept], faces=place[faces[nondegenerate(faces)]])

    assert len(left.faces) == len(ball.faces) - 2 * len(chosen)
    assert not find_defects(left)
