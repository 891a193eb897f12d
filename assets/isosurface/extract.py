"""The zero level of a field as a closed triangle surface: a narrow band from coarse to fine, then marching
cubes.

    cells from coarse to 1/128 of the box, kept where the surface may pass through        (band)
    between corners of these on either side of the surface, halved to a fine crossed cell (follow)
    from there cell by cell through crossed sides, until the surface closes               (follow)
    marching cubes (Lorensen and Cline 1987) on the crossed cells;                        (here)
    where a side has a saddle, its values say what joins                                  (saddles)

Every point asked but the audit's is a corner of the final grid and is asked once. What the band can
miss is a component of its own that is smaller than 1/128 of the box.

Letters: C cells. Metres; grid coordinates as in `grid`.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float64, Int64

from assets.errors import BoundsError
from assets.field import Field
from assets.isosurface.band import ExtractConfig
from assets.isosurface.follow import find_start, follow_surface
from assets.isosurface.grid import CornerValues, make_grid, unique_below
from assets.isosurface.saddles import EDGES, find_loops, with_saddle
from assets.mesh.surface import Surface

ROOM, GROWTHS = 0.05, 3  # metres by which bounds grow where the surface leaves them, and how often


@dataclass(frozen=True, kw_only=True)
class Extraction:
    """A closed surface and what it cost."""

    surface: Surface
    cell_size: float  # metres
    queries: int  # points asked
    attempts: int


Tracer = Callable[[Field, Float[np.ndarray, "2 3"], ExtractConfig], Extraction]
March = Callable[[CornerValues, Int64[np.ndarray, "C 3"]], Surface]  # of crossed cells


def extract(sdf: Field, bounds: Float[np.ndarray, "2 3"], config: ExtractConfig | None = None) -> Surface:
    """The zero level of `sdf` inside `bounds` (metres): closed, welded, facing outward; one or more
    components.

    Where solid and air are two cells thick or more its topology is the field's. What is thinner may join,
    part or fall into pieces, but never be open: a cell's side on which inside and outside alternate goes by
    the values there and not by a table, so surfaces that cross at an angle share one seam without handles.

    Raises:
        GeometryError: no surface inside the bounds, or the band never settles.
        BoundsError: it leaves the bounds.
        FieldError: the field is NaN or infinite.
        InputError: bounds that hold no box, or a resolution out of range.
    """
    return trace(sdf, bounds, config or ExtractConfig()).surface


def trace(
    sdf: Field, bounds: Float[np.ndarray, "2 3"], config: ExtractConfig, march: March | None = None
) -> Extraction:
    """`extract` with its costs, by libigl's marching cubes or others. Raises the same errors."""
    grid = make_grid(np.asarray(bounds, dtype=np.float64), config.resolution)
    values = CornerValues(sdf, grid)
    start = find_start(values, config)
    return Extraction(
        surface=(march or march_cells)(values, follow_surface(values, start.cells)),
        cell_size=grid.cell_size,
        queries=start.queries + values.queries,
        attempts=start.attempts,
    )


def trace_whole(
    sdf: Field, bounds: Float[np.ndarray, "2 3"], config: ExtractConfig, trace: Tracer = trace
) -> Extraction:
    """`trace`, or another way, in larger bounds where the surface leaves those given, as a wide skirt may."""
    bounds = bounds.astype(np.float64)
    for _ in range(GROWTHS):
        try:
            return trace(sdf, bounds, config)
        except BoundsError as error:
            bounds = bounds + ROOM * (error.sides * np.array([[-1], [1]]))
    return trace(sdf, bounds, config)


def march_cells(values: CornerValues, cells: Int64[np.ndarray, "C 3"]) -> Surface:
    """Marching cubes on crossed cells; those with a saddle are filled apart."""
    import igl

    cells = cells[np.argsort(values.grid.keys(cells))]  # the order of the grid, whatever the search did
    index = values.slots_of_cells(cells)
    slots = unique_below(index.reshape(-1), len(values.values))
    place = np.zeros(len(values.values), dtype=np.int32)
    place[slots] = np.arange(len(slots))
    corners, level = values.grid.points(values.corners(slots)), values.values[slots]
    index = place[index].astype(np.int64)
    saddles = with_saddle(level[index])
    vertices, faces, of_edge = igl.marching_cubes(level, corners, index[~saddles], 0.0)
    surface = Surface(vertices=np.asarray(vertices), faces=np.asarray(faces).astype(np.int64))
    return fill_saddles(surface, of_edge, level, corners, index[saddles]) if saddles.any() else surface


def fill_saddles(
    surface: Surface,
    of_edge: dict[int, int],
    level: Float64[np.ndarray, " N"],
    corners: Float64[np.ndarray, "N 3"],
    cells: Int64[np.ndarray, "C 8"],
) -> Surface:
    """The surface with its parts in these cells, which it lacks: a triangle for a loop of three crossings, a
    fan around their mean for a longer one.

    `of_edge` has its vertices by the numbers of the corners on either side, the larger in the upper 32 bits.
    """
    found = find_loops(level[cells])
    ends = [np.sort(cells[cell[:, None, None], EDGES[loops]], axis=2) for cell, loops in found]
    keys, back = np.unique(
        np.concatenate([(e[..., 1] << 32 | e[..., 0]).reshape(-1) for e in ends]), return_inverse=True
    )
    number = np.array([of_edge.get(key, -1) for key in keys.tolist()])
    new = number < 0
    number[new] = len(surface.vertices) + np.arange(new.sum())
    a, b = keys[new] & 0xFFFFFFFF, keys[new] >> 32
    share = (level[a] / (level[a] - level[b]))[:, None]  # of the way from a to b; their signs differ
    vertices = np.concatenate([surface.vertices, corners[a] + share * (corners[b] - corners[a])])
    faces, begin = [surface.faces], 0
    for _, loops in found:
        ring = number[back[begin : begin + loops.size]].reshape(loops.shape)
        begin += loops.size
        if loops.shape[1] > 3:
            middle = np.broadcast_to(len(vertices) + np.arange(len(ring))[:, None], ring.shape)
            vertices = np.concatenate([vertices, vertices[ring].mean(axis=1)])
            ring = np.stack([ring, np.roll(ring, -1, axis=1), middle], axis=2)
        faces.append(ring.reshape(-1, 3))
    return Surface(vertices=vertices, faces=np.concatenate(faces))
