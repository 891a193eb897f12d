"""Where a surface is cut so that its panels lie flat: short borders between panels, and inside each panel
the cheapest seams that leave a disk.

Letters: V vertices, F faces, E directed edges (3 F: edge 3 f + i runs from corner i of face f to the next), W
vertices after the seams have split them.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int64
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import (
    breadth_first_order,
    connected_components,
    dijkstra,
    maximum_flow,
    minimum_spanning_tree,
)

from assets.mesh.surface import Surface, directed_edges, edge_lengths
from avatargen.compiled import compiled, inner

RINGS = 3  # of faces on each side of a border among which its shortest way is looked for
PER_METRE = 1e6  # whole numbers that lengths become for the maximum flow
ANCHOR = 1_000_000_000  # more than any border is long
TEETH = 12  # rounds of taking teeth off a border


@dataclass(frozen=True, kw_only=True)
class Cut:
    """A surface cut open: face f is face f of the surface, on split vertices."""

    faces: Int64[np.ndarray, "F 3"]
    vertex_map: Int64[np.ndarray, " W"]  # vertex of the surface that each split one is
    chart: Int64[np.ndarray, " F"]
    open: Bool[np.ndarray, " E"]  # edges with another chart, or nothing, or a seam beyond

    @property
    def count(self) -> int:
        """How many charts there are."""
        return int(self.chart.max()) + 1

    @property
    def owner(self) -> Int64[np.ndarray, " W"]:
        """The chart of each split vertex."""
        owner = np.zeros(len(self.vertex_map), dtype=np.int64)
        owner[self.faces.reshape(-1)] = np.repeat(self.chart, 3)
        return owner

    def euler_numbers(self) -> Int64[np.ndarray, " C"]:
        """Vertices less edges plus faces of each chart: 1 for a disk."""
        vertices, faces = (np.bincount(each, minlength=self.count) for each in (self.owner, self.chart))
        shared = np.bincount(np.repeat(self.chart, 3)[~self.open], minlength=self.count) // 2
        return vertices - (3 * faces - shared) + faces


def without_teeth(panel: Int64[np.ndarray, " F"], twin: Int64[np.ndarray, " E"]) -> Int64[np.ndarray, " F"]:
    """Panels, where a face with two edges on the border to one other panel joins it, a few rounds."""
    panel, number = panel.copy(), np.arange(len(panel))
    beside = np.where(twin >= 0, twin // 3, np.arange(len(twin)) // 3).reshape(-1, 3)
    for _ in range(TEETH):
        there = panel[beside]
        other = there != panel[:, None]
        target = np.full(len(panel), -1)
        for i, j in ((0, 1), (1, 2), (2, 0)):
            target = np.where(other[:, i] & other[:, j] & (there[:, i] == there[:, j]), there[:, i], target)
        tooth = target >= 0
        first = tooth & ~(tooth[beside] & (beside < number[:, None])).any(axis=1)  # one of neighbours a round
        if not first.any():
            break
        panel[first] = target[first]
    return panel


def shorten_borders(
    surface: Surface,
    panel: Int64[np.ndarray, " F"],
    twin: Int64[np.ndarray, " E"],
    kept: frozenset[tuple[int, int]] = frozenset(),
) -> Int64[np.ndarray, " F"]:
    """Panels whose borders take the shortest way among a few rings of faces: of each pair of panels a minimum
    cut, but of the pairs `kept`. A panel of which nothing is farther inside keeps its borders."""
    panel = panel.copy()
    lengths = edge_lengths(surface, directed_edges(surface.faces))
    weight = np.maximum(np.rint(PER_METRE * lengths), 1).astype(np.int32)
    edge = np.flatnonzero(twin >= 0)
    here, there = edge // 3, twin[edge] // 3
    for a, b in border_pairs(panel[here], panel[there]):
        if (a, b) in kept:
            continue
        mine = (panel == a) | (panel == b)
        inside = mine[here] & mine[there]
        near = np.zeros(len(panel), dtype=bool)
        near[here[inside & (panel[here] != panel[there])]] = True
        for _ in range(RINGS - 1):
            near[there[inside & near[here]]] = True
        far = [
            near & (panel == each) & reached(here, there, mine & ~near & (panel == each)) for each in (a, b)
        ]
        if far[0].any() and far[1].any():
            among = inside & near[here] & near[there]
            first = minimum_cut(near, far[0], far[1], here[among], there[among], weight[edge[among]])
            panel[near] = np.where(first, a, b)
    return panel


def border_pairs(here: Int64[np.ndarray, " N"], there: Int64[np.ndarray, " N"]) -> list[tuple[int, int]]:
    """Pairs of different panels that share an edge, the lower first, in order."""
    across = np.stack([here, there], axis=1)[here < there]
    return [(int(a), int(b)) for a, b in np.unique(across, axis=0)]


def reached(
    here: Int64[np.ndarray, " N"], there: Int64[np.ndarray, " N"], start: Bool[np.ndarray, " F"]
) -> Bool[np.ndarray, " F"]:
    """Faces with an edge to one of those to start from."""
    found = np.zeros_like(start)
    found[there[start[here]]] = True
    return found


def minimum_cut(
    among: Bool[np.ndarray, " F"],
    source: Bool[np.ndarray, " F"],
    sink: Bool[np.ndarray, " F"],
    here: Int64[np.ndarray, " N"],
    there: Int64[np.ndarray, " N"],
    weight: np.ndarray,
) -> Bool[np.ndarray, " M"]:
    """Which of the M faces `among` lie on the source's side of the lightest set of edges that parts it from
    the sink."""
    place = np.cumsum(among) - 1
    count = int(among.sum())
    ends = [
        (np.full(int(source.sum()), count), place[source]),
        (place[sink], np.full(int(sink.sum()), count + 1)),
    ]
    rows = np.concatenate([place[here], *(start for start, _ in ends)])
    columns = np.concatenate([place[there], *(end for _, end in ends)])
    capacity = np.concatenate([weight, *(np.full(len(start), ANCHOR, np.int32) for start, _ in ends)])
    graph = csr_array(coo_array((capacity.astype(np.int32), (rows, columns)), shape=(count + 2, count + 2)))
    graph.indices, graph.indptr = graph.indices.astype(np.int32), graph.indptr.astype(np.int32)
    left = graph - maximum_flow(graph, count, count + 1).flow
    left.eliminate_zeros()
    first = np.zeros(count + 2, dtype=bool)
    first[breadth_first_order(left, count, return_predecessors=False)] = True
    return first[:count]


def cut_to_disks(
    surface: Surface,
    panel: Int64[np.ndarray, " F"],
    twin: Int64[np.ndarray, " E"],
    price: Float64[np.ndarray, " V"],
    chosen: Bool[np.ndarray, " F"] | None = None,
) -> Bool[np.ndarray, " E"]:
    """Edges to open: panels' borders, and inside each, or inside those of chosen faces alone, the shortest
    system of seams that leaves a disk.

    A seam is as long as its edges times the price at their ends. The border is taken as one point: the
    shortest ways to it make a tree of vertices. A spanning tree of faces
    that crosses the longest detours leaves out one edge for each seam: that and the ways from its ends
    (Erickson and Whittlesey 2005, "Greedy optimal homotopy and homology generators").
    """
    edges = directed_edges(surface.faces)
    number = np.arange(len(twin))
    opened = (twin < 0) | (panel[number // 3] != panel[np.maximum(twin, 0) // 3])
    inner = ~opened & (number < twin)
    if chosen is not None:
        inner &= np.repeat(chosen, 3)
    inner = np.flatnonzero(inner)
    ends = edges[inner]
    length = np.maximum(edge_lengths(surface, ends), 1e-9) * 0.5 * price[ends].sum(axis=1)
    on_border = np.zeros(len(surface.vertices), dtype=bool)
    on_border[edges[opened].reshape(-1)] = True
    place = np.full(len(surface.vertices), -1)
    mine = np.unique(ends)
    count, place[mine] = len(mine), np.arange(len(mine))
    root = on_border[mine]
    start, end = place[ends].T
    graph = coo_array((length, (start, end)), shape=(count, count))
    root[one_of_each_left_out(graph, root)] = True
    way, before, _ = dijkstra(
        csr_array(graph),
        directed=False,
        indices=np.flatnonzero(root),
        min_only=True,
        return_predecessors=True,
    )
    walked = (before[start] == end) | (before[end] == start)
    seams = inner[~walked][~in_spanning_tree(twin, inner[~walked], (way[start] + way[end] + length)[~walked])]
    on_seam = np.zeros(count, dtype=bool)
    front = np.unique(place[edges[seams]])
    while len(front):
        on_seam[front] = True
        front = np.unique(before[front])
        front = front[front >= 0]
        front = front[~on_seam[front]]
    ways = inner[((before[start] == end) & on_seam[start]) | ((before[end] == start) & on_seam[end])]
    for each in (seams, ways):
        opened[each] = opened[twin[each]] = True
    return opened


def one_of_each_left_out(graph: coo_array, root: Bool[np.ndarray, " V"]) -> Int64[np.ndarray, " _"]:
    """A vertex of each connected component without a root."""
    count, component = connected_components(graph, directed=False)
    rooted = np.zeros(count, dtype=bool)
    rooted[component[root]] = True
    return np.unique(component, return_index=True)[1][~rooted]


def in_spanning_tree(
    twin: Int64[np.ndarray, " E"], edges: Int64[np.ndarray, " N"], detour: Float64[np.ndarray, " N"]
) -> Bool[np.ndarray, " N"]:
    """Whether the spanning tree of faces that crosses edges of the longest detours crosses each edge."""
    faces = len(twin) // 3
    pair = np.sort(np.stack([edges // 3, twin[edges] // 3]), axis=0)
    weight = detour.max(initial=0.0) - detour + 1.0  # none is zero
    tree = minimum_spanning_tree(csr_array(coo_array((weight, tuple(pair)), shape=(faces, faces)))).tocoo()
    crossed = np.sort(tree.row.astype(np.int64) * faces + tree.col, axis=0)
    return np.isin(pair[0] * faces + pair[1], crossed)


def cut_open(
    faces: Int64[np.ndarray, "F 3"], twin: Int64[np.ndarray, " E"], opened: Bool[np.ndarray, " E"]
) -> Cut:
    """The faces on vertices of their own along the open edges."""
    corner, chart, vertex_map = number_corners(faces, twin, opened)
    return Cut(
        faces=corner.reshape(-1, 3),
        vertex_map=vertex_map,
        chart=chart,
        open=opened,
    )


@inner
def root_of(parent, one):
    """The first of those that hang together with one, `parent` [N] pointing towards it."""
    while parent[one] != one:
        parent[one] = parent[parent[one]]
        one = parent[one]
    return one


@inner
def join(parent, one, other):
    """Let two hang together."""
    a, b = root_of(parent, one), root_of(parent, other)
    parent[max(a, b)] = min(a, b)


@inner
def numbered(parent):
    """A number for each, from 0, the same for those that hang together; and how many there are."""
    number, count = np.empty(len(parent), np.int64), 0
    for one in range(len(parent)):
        root = root_of(parent, one)
        if root == one:
            number[one] = count
            count += 1
        else:
            number[one] = number[root]
    return number, count


@compiled
def number_corners(faces, twin, opened):
    """Faces [F 3] on vertices of their own along the edges [E] that are open: the number of the vertex at
    each corner [E], of the chart of each face [F], and the vertex that each split one was."""
    corners, charts = np.arange(len(twin)), np.arange(len(faces))
    for edge in range(len(twin)):
        other = twin[edge]
        if not opened[edge] and edge < other:
            join(corners, edge, other - 2 if other % 3 == 2 else other + 1)
            join(corners, other, edge - 2 if edge % 3 == 2 else edge + 1)
            join(charts, edge // 3, other // 3)
    corner, count = numbered(corners)
    vertex_map = np.empty(count, np.int64)
    for k in range(len(corner)):
        vertex_map[corner[k]] = faces[k // 3, k % 3]
    return corner, numbered(charts)[0], vertex_map


def components(size: int, a: Int64[np.ndarray, " N"], b: Int64[np.ndarray, " N"]) -> tuple[int, np.ndarray]:
    """How many there are when a[i] and b[i] hang together, and the one of each."""
    graph = coo_array((np.ones(len(a), dtype=bool), (a, b)), shape=(size, size))
    return connected_components(graph, directed=False)
