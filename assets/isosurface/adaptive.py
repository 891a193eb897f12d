"""The zero level of a field as a closed surface from cells of two sizes: large where it is flat, small where
it bends.

    band, then follow the surface through large cells                  (band, follow)
    halve those where it bends, and follow it through the small ones
    dual contouring of both, laid on the zero level                    (dual)

What is simplified afterwards needs no small faces where it is flat: with a twentieth of the faces left, half
the questions and two fifths of the faces serve nearly as well. A large cell of size s in which the surface
bends by an angle hides a bump angle * s / 8 high, and the error of the N faces left goes with 1 / N, so the
angle from which a cell is halved goes with 1 / (N s). Sheets that slip between a large cell's corners are
found where they leave small cells, and followed; what grows out of a flat part, thinner than a large cell,
may be overlooked.

Letters: C cells, K cells kept, S small cells. Grid coordinates as in `grid`, in small cells.
"""

import numpy as np
from jaxtyping import Bool, Float, Float64, Int64

from assets.field import Field, ask
from assets.isosurface.band import HALVES, ExtractConfig
from assets.isosurface.dual import Contour, Leaves, contour
from assets.isosurface.extract import Extraction
from assets.isosurface.follow import cells_across, find_start, follow_surface
from assets.isosurface.grid import CORNERS, CellSet, CornerValues, Grid, grown, make_grid, unique_corners
from assets.mesh.importance import Importance, evenly
from assets.mesh.surface import Surface

LARGE = 2  # small cells along a side of a large one
BEND = 11.5  # radians between the normals of neighbours, times faces left, over small cells along the box
LARGEST_BEND = 0.3  # radians: more hides sheets
LARGEST_STEP = 0.5  # of a small cell, onto the zero level
AROUND = (0, -LARGE)  # the low ends of the large cells around an edge, along each other axis


def trace_adaptively(
    sdf: Field,
    bounds: Float[np.ndarray, "2 3"],
    config: ExtractConfig,
    faces: int,
    importance: Importance = evenly,
) -> Extraction:
    """The zero level of `sdf` inside `bounds` (metres), to be simplified to a number of faces by
    `importance`; one or more closed components facing outward, whose edges are rarely not manifold, where
    sheets touch. The resolution counts small cells.

    Raises the errors of `assets.isosurface.extract.extract`.
    """
    grid = make_grid(np.asarray(bounds, dtype=np.float64), config.resolution, together=LARGE)
    values = CornerValues(sdf, grid)
    start = find_start(values, config, LARGE)
    large = follow_surface(values, start.cells, LARGE)
    middles = grid.points(large + LARGE // 2)
    angle = np.minimum(BEND * config.resolution / faces, LARGEST_BEND) / np.cbrt(importance(middles))
    leaves = refine(values, large, bends(values, large, angle))
    found = contour(values, leaves)
    return Extraction(
        surface=newton_step(found, grid, sdf),
        cell_size=grid.cell_size,
        queries=start.queries + values.queries + len(found.vertices),
        attempts=start.attempts,
    )


def bends(
    values: CornerValues, large: Int64[np.ndarray, "C 3"], angle: Float64[np.ndarray, " C"]
) -> Bool[np.ndarray, " C"]:
    """Whether the surface turns by more than an angle (radians) between each large cell and a neighbour."""
    slots = values.slots_of_cells(large, LARGE)
    normals = values.values[slots] @ (2.0 * CORNERS - 1)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    number = np.zeros(len(values.values), dtype=np.int32)  # by the slot of the low corner, from 1
    number[slots[:, 0]] = np.arange(1, len(large) + 1)
    bent = np.zeros(len(large), dtype=bool)
    for axis in range(3):
        beyond = large.copy()
        beyond[:, axis] += LARGE
        beyond = values.slots(np.minimum(beyond, values.grid.shape))
        number = grown(number, len(values.values))
        pair = np.stack([np.arange(len(large)), number[beyond] - 1])[:, number[beyond] > 0]
        turn = np.einsum("cd,cd->c", normals[pair[0]], normals[pair[1]]) < np.cos(angle[pair[0]])
        bent[pair[:, turn]] = True
    return bent


def refine(values: CornerValues, large: Int64[np.ndarray, "C 3"], bent: Bool[np.ndarray, " C"]) -> Leaves:
    """Halve the bent cells, and others where the surface enters them unseen or crosses an edge of theirs
    twice.

    Raises:
        BoundsError: the surface leaves the grid.
    """
    crossed, halved, listed = CellSet(values), CellSet(values), CellSet(values)
    crossed.add(large)
    given_way, found = [large[bent]], [large[:0]]
    halved.add(given_way[0])
    frontier = first_halves(values, given_way[0])
    while len(frontier):
        listed.add(frontier)
        found.append(frontier)
        inside = values.ask(values.slots_of_cells(frontier)) < 0
        reached = cells_across(values.grid, frontier, inside)
        parents = reached - reached % LARGE
        unseen = parents[~crossed.has(parents)]
        new = halved.lacking(np.concatenate([unseen, crossed_twice(values, frontier)]))
        halved.add(new)
        given_way.append(new)
        within = reached[halved.has(parents)]
        frontier = listed.lacking(np.concatenate([within, mixed_halves(values, new)]))
    return Leaves(
        small=np.concatenate(found), large=large[~halved.has(large)], halved=np.concatenate(given_way)
    )


def first_halves(values: CornerValues, cells: Int64[np.ndarray, "C 3"]) -> Int64[np.ndarray, "K 3"]:
    """Of the small cells in large ones, those at the crossed halves of crossed edges, each once: a place to
    follow every sheet from."""
    found = [cells[:0]]
    inside = values.ask(values.slots_of_cells(cells, LARGE)) < 0
    for axis in range(3):
        for low in np.flatnonzero(CORNERS[:, axis] == 0):
            end = CORNERS[low] + np.eye(3, dtype=np.int64)[axis]
            high = np.flatnonzero((end == CORNERS).all(axis=1))[0]
            there = inside[:, low] != inside[:, high]
            middle = values.at(cells[there] + CORNERS[low] + end) < 0
            upper = (middle == inside[there, low])[:, None]
            found.append(cells[there] + np.where(upper, end, CORNERS[low]))
    return unique_corners(values, np.concatenate(found))


def mixed_halves(values: CornerValues, cells: Int64[np.ndarray, "C 3"]) -> Int64[np.ndarray, "K 3"]:
    """The small cells in large ones that the surface crosses."""
    halves = (cells[:, None] + HALVES).reshape(-1, 3)
    inside = values.ask(values.slots_of_cells(halves)) < 0
    return halves[inside.any(axis=1) & ~inside.all(axis=1)]


def crossed_twice(values: CornerValues, small: Int64[np.ndarray, "S 3"]) -> Int64[np.ndarray, "K 3"]:
    """The large cells around edges that the surface crosses in both halves, by small cells at either half."""
    found = [small[:0]]
    for axis in range(3):
        step = np.eye(3, dtype=np.int64)[axis]
        low = small + small % LARGE * (1 - step) - small % LARGE * step
        ends = values.at(low) < 0, values.at(low + LARGE * step) < 0
        twice = np.flatnonzero((ends[0] == ends[1]) & ((values.at(low + step) < 0) != ends[0]))
        offsets = np.stack(np.meshgrid(AROUND, AROUND), axis=-1).reshape(-1, 2)
        found.extend(low[twice] + np.insert(offset, axis, 0) for offset in offsets)
    return np.concatenate(found)


def newton_step(found: Contour, grid: Grid, sdf: Field) -> Surface:
    """The contour's vertices one step of Newton's method nearer to the zero level of `sdf`."""
    vertices = grid.points(found.vertices)
    steepness = np.maximum(np.linalg.norm(found.gradients, axis=1), 1e-300)
    step = ask(sdf, vertices) / steepness  # in small cells
    step = np.clip(step, -LARGEST_STEP, LARGEST_STEP) * grid.cell_size
    return Surface(
        vertices=vertices - (step / steepness)[:, None] * found.gradients,
        faces=found.faces,
    )
