"""Charts packed into one square: each is drawn on a grid with the room it needs around it, and put, largest
first, where its upper edge comes to lie lowest, in the best of four quarter turns.

Where one finds no room it goes first, and all others again; after a few such tries all charts shrink. Rows of
the grid are bits of whole numbers, so that a chart is tried at 64 places' worth of cells at a time.

Letters: C charts, T triangles, S segments of a chart's border, H rows and W columns of its cells, K words of
64 cells, P some of its cells. Cells: x right, y down.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64, UInt64

from assets.errors import GeometryError
from avatargen.compiled import compiled, inner

CELLS = 256  # along the square's side
WORD = 64  # bits
ALL = np.uint64(2**64 - 1)
PROBES = 24  # cells of a chart that are looked at before all of it
FULLEST, EMPTIEST = 0.72, 0.2  # share of the square that charts may cover
TIGHTEST = 0.935  # share of the grid's cells that charts and the room around them may take
SHRINK = 0.955  # of that share, when no order has worked
ORDERS = 6  # tried at each size,
FEW = 80  # of so many charts; of more, the last one to find no room is small, and two orders do
HALF_DIAGONAL = 0.7072  # of a cell


@dataclass(frozen=True, kw_only=True)
class Outline:
    """One chart to pack, in any unit that all share."""

    triangles: Float64[np.ndarray, "T 3 2"]
    border: Float64[np.ndarray, "S 2 2"]
    upright: bool = False  # whether it must not be turned

    @property
    def area(self) -> float:
        a, b = self.triangles[:, 1] - self.triangles[:, 0], self.triangles[:, 2] - self.triangles[:, 0]
        return float(0.5 * np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum())


@dataclass(frozen=True, kw_only=True)
class Place:
    """Where a chart goes in the unit square: scaled, turned by quarters (x, y) -> (y, -x), then moved."""

    scale: float
    quarters: int
    shift: Float64[np.ndarray, "2"]

    def apply(self, points: Float64[np.ndarray, "N 2"]) -> Float64[np.ndarray, "N 2"]:
        turned = points * self.scale
        for _ in range(self.quarters):
            turned = np.stack([turned[:, 1], -turned[:, 0]], axis=1)
        return turned + self.shift


def pack(outlines: list[Outline], gap: float) -> list[Place]:
    """Places in a unit square, `gap` of its side apart and half as far from its border.

    Raises:
        GeometryError: they are so many that nearly no room is left for them.
    """
    share, area = FULLEST, sum(outline.area for outline in outlines)
    while share > EMPTIEST:
        found = packed(outlines, np.sqrt(share / area), gap)
        if found is not None:
            better = (
                packed(outlines, np.sqrt(share / np.sqrt(SHRINK) / area), gap) if share < FULLEST else None
            )
            return found if better is None else better
        share *= SHRINK
    raise GeometryError(f"atlas: no room for {len(outlines)} charts that lie {gap:g} apart")


def packed(outlines: list[Outline], scale: float, gap: float) -> list[Place] | None:
    """Places of charts so many times as large, or None where no order that is tried has room for all."""
    drawn = [draw(outline, scale * CELLS, 0.5 * gap * CELLS) for outline in outlines]
    if sum(each.cells for each in drawn) > TIGHTEST * CELLS * CELLS:
        return None
    found = arrange(drawn)
    if found is None:
        return None
    return [place_of(each, scale, *where) for each, where in zip(drawn, found, strict=True)]


@dataclass(frozen=True, kw_only=True)
class Drawing:
    """A chart on the grid in the turns that it may take, and where the grid begins (cells) in the chart's own
    place."""

    bits: list[UInt64[np.ndarray, "_ _"]]  # of each turn
    probes: list[Int64[np.ndarray, "P 2"]]  # of each turn, rows and columns of some cells
    size: tuple[int, int]  # rows and columns before it is turned
    cells: int
    corner: Float64[np.ndarray, "2"]

    def size_in(self, turn: int) -> tuple[int, int]:
        """Rows and columns in a turn."""
        height, width = self.size
        return (height, width) if turn % 2 == 0 else (width, height)


def draw(outline: Outline, scale: float, reach: float) -> Drawing:
    """The cells that a chart takes, with what comes within reach (cells) of its border."""
    low, taken = cells_of(outline.triangles, outline.border, scale, reach)
    drawn = [to_bits(taken, turn) for turn in range(1 if outline.upright else 4)]
    return Drawing(
        bits=[bits for bits, _ in drawn],
        probes=[probes for _, probes in drawn],
        size=taken.shape,
        cells=int(np.count_nonzero(taken)),
        corner=low,
    )


def place_of(drawing: Drawing, scale: float, turn: int, row: int, column: int) -> Place:
    """The place of a chart whose drawing, turned, begins in a row and column of the grid."""
    corner, (height, width) = -drawing.corner, drawing.size
    for _ in range(turn):  # as `np.rot90` turns the grid
        corner, height, width = np.array([corner[1], width - corner[0]]), width, height
    return Place(scale=scale, quarters=turn, shift=(corner + np.array([column, row])) / CELLS)


def arrange(drawn: list[Drawing]) -> list[tuple[int, int, int]] | None:
    """Turn, row and column of each drawing so that none shares a cell, or None where no order that is tried
    has room for all."""
    cells, longest = [each.cells for each in drawn], [max(each.size) for each in drawn]
    for sizes in (cells, longest):
        order = np.argsort(-np.array(sizes), kind="stable").tolist()
        for _ in range(ORDERS if len(drawn) <= FEW else 2):
            found, failed = placed_in(order, drawn)
            if failed is None:
                return [found[chart] for chart in range(len(drawn))]
            order.remove(failed)
            order.insert(0, failed)
    return None


def placed_in(order: list[int], drawn: list[Drawing]) -> tuple[dict[int, tuple[int, int, int]], int | None]:
    """Turn, row and column of drawings, one after the other, up to the first one without room; and that."""
    found, taken = {}, np.zeros((CELLS, CELLS // WORD + 1), dtype=np.uint64)
    for chart in order:
        where = lowest(taken, drawn[chart])
        if where is None:
            return found, chart
        put(taken, drawn[chart].bits[where[0]], where[1], where[2])
        found[chart] = where
    return found, None


def lowest(taken: UInt64[np.ndarray, "H K"], drawing: Drawing) -> tuple[int, int, int] | None:
    """Turn, row and column in which a chart ends first, in rows and then in columns."""
    best, where = (CELLS + 1, CELLS + 1), None
    for turn, (bits, probes) in enumerate(zip(drawing.bits, drawing.probes, strict=True)):
        height, width = drawing.size_in(turn)
        row, column = first_room(taken, bits, probes, min(CELLS, best[0]) - height, CELLS - width)
        if row >= 0 and (row + height, column + width) < best:
            best, where = (row + height, column + width), (turn, int(row), int(column))
    return where


@compiled
def cells_of(triangles, border, scale, reach):
    """The corner [2] at which a chart's cells begin, and these [H W]: whether their centres lie in its
    triangles [T 3 2] or within reach of its border's segments [S 2 2], so many times as large."""
    low, high = np.full(2, np.inf), np.full(2, -np.inf)
    for t in range(len(triangles)):
        for i in range(3):
            for k in range(2):
                low[k] = min(low[k], triangles[t, i, k] * scale - reach)
                high[k] = max(high[k], triangles[t, i, k] * scale + reach)
    taken = np.zeros((int(np.ceil(high[1] - low[1])), int(np.ceil(high[0] - low[0]))), np.bool_)
    fill(taken, triangles, scale, low)
    widen(taken, border, scale, low, reach + HALF_DIAGONAL)
    return low, taken


@inner
def fill(taken, triangles, scale, low):
    """Mark the cells [H W] whose centres lie in triangles [T 3 2]."""
    for t in range(len(triangles)):
        ax, ay = triangles[t, 0, 0] * scale - low[0], triangles[t, 0, 1] * scale - low[1]
        ux, uy = triangles[t, 1, 0] * scale - low[0] - ax, triangles[t, 1, 1] * scale - low[1] - ay
        vx, vy = triangles[t, 2, 0] * scale - low[0] - ax, triangles[t, 2, 1] * scale - low[1] - ay
        area = ux * vy - uy * vx
        if area == 0:
            continue
        left, right = int(ax + min(0.0, ux, vx)), int(ax + max(0.0, ux, vx)) + 1
        for y in range(int(ay + min(0.0, uy, vy)), min(int(ay + max(0.0, uy, vy)) + 1, taken.shape[0])):
            for x in range(left, min(right, taken.shape[1])):
                px, py = x + 0.5 - ax, y + 0.5 - ay
                b, c = (px * vy - py * vx) / area, (ux * py - uy * px) / area
                if b >= 0 and c >= 0 and b + c <= 1:
                    taken[y, x] = True


@inner
def widen(taken, border, scale, low, reach):
    """Mark the cells [H W] whose centres come within reach of segments [S 2 2]."""
    for s in range(len(border)):
        ax, ay = border[s, 0, 0] * scale - low[0], border[s, 0, 1] * scale - low[1]
        ux, uy = border[s, 1, 0] * scale - low[0] - ax, border[s, 1, 1] * scale - low[1] - ay
        square = max(ux * ux + uy * uy, 1e-12)
        top, bottom = int(max(0.0, ay + min(0.0, uy) - reach)), int(ay + max(0.0, uy) + reach) + 1
        left, right = int(max(0.0, ax + min(0.0, ux) - reach)), int(ax + max(0.0, ux) + reach) + 1
        for y in range(top, min(bottom, taken.shape[0])):
            for x in range(left, min(right, taken.shape[1])):
                px, py = x + 0.5 - ax, y + 0.5 - ay
                along = min(max((px * ux + py * uy) / square, 0.0), 1.0)
                if (px - along * ux) ** 2 + (py - along * uy) ** 2 <= reach * reach:
                    taken[y, x] = True


@compiled
def to_bits(taken, turn):
    """[H K] the cells [H W], turned by quarters as `np.rot90` does, as bits, the first the lowest; and rows
    and columns of some cells [P 2] that are far from each other in order."""
    height, width = taken.shape
    rows, columns = (height, width) if turn % 2 == 0 else (width, height)
    bits = np.zeros((rows, (columns + 63) // 64), np.uint64)
    probes = np.zeros((PROBES, 2), np.int64)
    count = 0
    for y in range(height):
        for x in range(width):
            count += taken[y, x]
    seen, found = 0, 0
    for y in range(rows):
        for x in range(columns):
            if turn == 0:
                cell = taken[y, x]
            elif turn == 1:
                cell = taken[x, width - 1 - y]
            elif turn == 2:
                cell = taken[height - 1 - y, width - 1 - x]
            else:
                cell = taken[height - 1 - x, y]
            if not cell:
                continue
            bits[y, x >> 6] |= np.uint64(1) << np.uint64(x & 63)
            if found < PROBES and seen * PROBES >= found * count:
                probes[found, 0], probes[found, 1] = y, x
                found += 1
            seen += 1
    return bits, probes[:found]


@inner
def meets(taken, bits, row, column):
    """Whether a chart's bits [H K] and the taken ones share a cell when it begins in a row and column."""
    word, shift = column >> 6, np.uint64(column & 63)
    rest = np.uint64(64) - shift
    for y in range(bits.shape[0]):
        for k in range(bits.shape[1]):
            if taken[row + y, word + k] & (bits[y, k] << shift):
                return True
            if shift > 0 and taken[row + y, word + k + 1] & (bits[y, k] >> rest):
                return True
    return False


@compiled
def first_room(taken, bits, probes, last_row, last_column):
    """The first row and column, up to the last ones, in which a chart's bits [H K] share no cell with the
    taken ones; -1 for both where there is none. Its cells `probes` [P 2] are looked at first, at 64 places at
    a time."""
    for row in range(last_row + 1):
        for word in range((last_column >> 6) + 1):
            shared = np.uint64(0)
            for k in range(len(probes)):
                y, x = row + probes[k, 0], (word << 6) + probes[k, 1]
                place, shift = x >> 6, np.uint64(x & 63)
                if place < taken.shape[1]:
                    shared |= taken[y, place] >> shift
                if shift > 0 and place + 1 < taken.shape[1]:
                    shared |= taken[y, place + 1] << (np.uint64(64) - shift)
                if shared == ALL:
                    break
            if shared == ALL:
                continue
            for bit in range(min(64, last_column + 1 - (word << 6))):
                column = (word << 6) + bit
                if not (shared >> np.uint64(bit)) & np.uint64(1) and not meets(taken, bits, row, column):
                    return row, column
    return -1, -1


@compiled
def put(taken, bits, row, column):
    """Mark a chart's bits [H K] as taken, beginning in a row and column."""
    word, shift = column >> 6, np.uint64(column & 63)
    rest = np.uint64(64) - shift
    for y in range(bits.shape[0]):
        for k in range(bits.shape[1]):
            taken[row + y, word + k] |= bits[y, k] << shift
            if shift > 0:
                taken[row + y, word + k + 1] |= bits[y, k] >> rest
