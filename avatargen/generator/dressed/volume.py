"""What a garment is, as numbers in space: near its surface, distance, way to an edge and colour at the nodes
of a fine grid; about it, distance and way to an edge at every fourth of them.

Nodes stand in blocks of 4 x 4 x 4. Blocks that the surface or its neighbourhood touches are kept; wherever
others are asked, the coarse nodes answer. A point is read between the eight nodes around it.

Letters: B blocks kept, X Y Z blocks along the axes, C colours, N points. Metres; negative inside.
"""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float, Float32, Float64, Int8, Int32, UInt8
from torch import Tensor, nn

from avatargen.compiled import compiled, inner
from avatargen.errors import InputError
from avatargen.generator.dressed.config import VolumeConfig

SIDE = 4  # nodes along a block
STEPS, SHADES = (
    63,
    127,
)  # that distances on either side, and colours, are told apart in: files shrink by a quarter
REACH = 1.75  # cells up to which fine distances are told apart: a cell's diagonal
SURE = 0.75  # of that: beyond it the coarse distance takes over
FARTHEST = 0.127  # m that coarse distances are told apart
RIM = 0.03  # m, the longest way to an edge that matters
SLACK = 0.48  # of a block, by which a garment may be nearer than the coarse nodes say


class Volume(nn.Module):
    """A garment's numbers as a file holds them: whole ones of a byte each."""

    occupied: Tensor
    coarse: Tensor
    coarse_rim: Tensor
    distance: Tensor
    rim: Tensor
    color: Tensor

    def __init__(self, config: VolumeConfig) -> None:
        super().__init__()
        self.config = config
        corners = [blocks + 1 for blocks in config.blocks]
        nodes = (config.count, SIDE, SIDE, SIDE)
        self.register_buffer("occupied", torch.zeros(config.blocks, dtype=torch.uint8))
        self.register_buffer("coarse", torch.zeros(corners, dtype=torch.int8))
        self.register_buffer("coarse_rim", torch.zeros(corners, dtype=torch.uint8))
        self.register_buffer("distance", torch.zeros(nodes, dtype=torch.int8))
        self.register_buffer("rim", torch.zeros(nodes, dtype=torch.uint8))
        self.register_buffer("color", torch.zeros(config.colors, *nodes, dtype=torch.uint8))

    def set(
        self,
        occupied: Bool[np.ndarray, "X Y Z"],
        coarse: Float[np.ndarray, "X1 Y1 Z1"],
        coarse_rim: Float[np.ndarray, "X1 Y1 Z1"],
        distance: Float[np.ndarray, "B 4 4 4"],
        rim: Float[np.ndarray, "B 4 4 4"],
        color: Float[np.ndarray, "C B 4 4 4"],
    ) -> None:
        """Round the numbers: metres, and colours of 0..1 (shades of 0..2)."""
        most = REACH * self.config.cell
        self.occupied.copy_(torch.from_numpy(occupied))
        self.coarse.copy_(whole(coarse / FARTHEST * 127, -127, 127))
        self.coarse_rim.copy_(whole(coarse_rim / RIM * 255, 0, 255))
        self.distance.copy_(whole(distance / most * STEPS, -STEPS, STEPS))
        self.rim.copy_(whole(rim / RIM * 255, 0, 255))
        bytes_ = whole(color / self.config.brightest * SHADES, 0, SHADES).to(torch.uint8)
        bytes_[1:] -= bytes_[:1]  # modulo 256: channels are alike, and so a file is smaller
        self.color.copy_(bytes_)

    def read(self) -> "Bricks":
        """The volume ready to be asked.

        Raises:
            InputError: the blocks that are kept are not as many as the settings say.
        """
        occupied = self.occupied.numpy().astype(bool)
        if occupied.sum() != self.config.count:
            raise InputError(
                f"weights: a volume of {self.config.count} blocks keeps {occupied.sum()}; "
                "download the weights anew"
            )
        index = np.zeros(occupied.shape, np.int32)
        index[occupied] = 1 + np.arange(self.config.count)
        color = self.color.numpy().copy()
        color[1:] += color[:1]
        return Bricks(
            low=np.array(self.config.low),
            cell=self.config.cell,
            index=index,
            coarse=self.coarse.numpy(),
            coarse_rim=self.coarse_rim.numpy(),
            distance=bordered(index, self.distance.numpy(), True),
            rim=bordered(index, self.rim.numpy(), False),
            color=np.stack([bordered(index, each, False) for each in color]),
            brightest=self.config.brightest,
        )


def whole(values: np.ndarray, least: int, most: int) -> Tensor:
    """Values rounded to whole numbers within bounds."""
    return torch.from_numpy(np.rint(values.clip(least, most)))


def bordered(index: Int32[np.ndarray, "X Y Z"], values: np.ndarray, signed: bool) -> np.ndarray:
    """Blocks [B 4 4 4] with the nodes that begin the next ones: [B+1 5 5 5], the first one empty."""
    found = np.zeros((len(values) + 1, SIDE + 1, SIDE + 1, SIDE + 1), values.dtype)
    fill_borders(index, values, signed, found)
    return found


@dataclass(frozen=True, kw_only=True, eq=False)
class Bricks:
    """A volume in memory: blocks with borders, so that a point is read from one of them. `index` says which,
    0 where none is kept."""

    low: Float64[np.ndarray, "3"]
    cell: float
    index: Int32[np.ndarray, "X Y Z"]
    coarse: Int8[np.ndarray, "X1 Y1 Z1"]
    coarse_rim: UInt8[np.ndarray, "X1 Y1 Z1"]
    distance: Int8[np.ndarray, "B1 5 5 5"]
    rim: UInt8[np.ndarray, "B1 5 5 5"]
    color: UInt8[np.ndarray, "C B1 5 5 5"]
    brightest: float

    def places(self, points: Float32[np.ndarray, "N 3"]) -> Float64[np.ndarray, "N 3"]:
        """Points in cells from the lowest node."""
        return (points - self.low) / self.cell

    def least(self, points: Float32[np.ndarray, "N 3"]) -> Float32[np.ndarray, " N"]:
        """Metres that the surface is away from each point at least."""
        found = np.empty(len(points), np.float32)
        fill_least(self.places(points), self.coarse, self.cell, found)
        return found

    def read(
        self, points: Float32[np.ndarray, "N 3"]
    ) -> tuple[Float32[np.ndarray, " N"], Float32[np.ndarray, " N"]]:
        """Signed distance and way to an edge, m."""
        distance, rim = np.empty((2, len(points)), np.float32)
        grids = (self.index, self.coarse, self.coarse_rim, self.distance, self.rim)
        fill_distance(self.places(points), *grids, self.cell, distance, rim)
        return distance, rim

    def colors(self, points: Float32[np.ndarray, "N 3"]) -> Float32[np.ndarray, "N C"]:
        """Colours of the surface near points, 0..1 (shades 0..2); grey (1 of shades) where there is none."""
        found = np.empty((len(points), len(self.color)), np.float32)
        fill_color(self.places(points), self.index, self.color, self.brightest / SHADES, found)
        return found


@compiled
def fill_borders(index, values, signed, found):
    """Fill in `found` [B+1 5 5 5] from blocks [B 4 4 4] and those after them.

    Where none follows, the surface is a cell off at least: signed numbers keep their sign and grow to STEPS.
    """
    size_x, size_y, size_z = index.shape
    for x in range(size_x):
        for y in range(size_y):
            for z in range(size_z):
                own = index[x, y, z]
                if own == 0:
                    continue
                for i in range(5):
                    for j in range(5):
                        for k in range(5):
                            p, q, r = x + i // 4, y + j // 4, z + k // 4
                            next_ = index[p, q, r] if p < size_x and q < size_y and r < size_z else 0
                            if next_ > 0:
                                found[own, i, j, k] = values[next_ - 1, i % 4, j % 4, k % 4]
                            else:
                                near = values[own - 1, min(i, 3), min(j, 3), min(k, 3)]
                                if signed:
                                    near = STEPS if near >= 0 else -STEPS
                                found[own, i, j, k] = near


@inner
def locate(place, n, unit, size, low, share):
    """Fill in which box [3] of a grid of `size` [3], each `unit` cells long, holds the nth place, and the
    share [3] of the way along its sides. Returns how far the place is off the grid, in boxes."""
    off = 0.0
    for a in range(3):
        at = place[n, a] / unit
        within = min(max(at, 0.0), size[a] * 1.0)
        off += (at - within) ** 2
        low[a] = min(int(within), size[a] - 1)
        share[a] = within - low[a]
    return np.sqrt(off)


@inner
def between(values, low, share):
    """A grid's value [X Y Z] in a box, by those at its corners."""
    total = 0.0
    for i in range(2):
        x = share[0] if i else 1 - share[0]
        for j in range(2):
            y = share[1] if j else 1 - share[1]
            for k in range(2):
                z = share[2] if k else 1 - share[2]
                total += x * y * z * values[low[0] + i, low[1] + j, low[2] + k]
    return total


@inner
def least_around(values, low):
    """The least of a grid's values [X Y Z] at a box's corners."""
    least = values[low[0], low[1], low[2]]
    for i in range(2):
        for j in range(2):
            for k in range(2):
                least = min(least, values[low[0] + i, low[1] + j, low[2] + k])
    return least


@inner
def within_block(share, low):
    """From a place in a block to the cell [3] there and the place in that."""
    for a in range(3):
        at = SIDE * share[a]
        low[a] = min(int(at), SIDE - 1)
        share[a] = at - low[a]


@compiled
def fill_least(place, coarse, cell, found):
    """Fill in how far (metres) the surface is at least from places [N 3] in cells, by the coarse distances
    [X+1 Y+1 Z+1]."""
    low, share, side = np.empty(3, np.int64), np.empty(3), SIDE * cell
    size = (coarse.shape[0] - 1, coarse.shape[1] - 1, coarse.shape[2] - 1)
    for n in range(len(place)):
        off = locate(place, n, SIDE, size, low, share) * side
        away = between(coarse, low, share) * FARTHEST / 127 - SLACK * side
        found[n] = max(away - off, off, 0.0)


@compiled
def fill_distance(place, index, coarse, coarse_rim, fine, fine_rim, cell, distance, rim):
    """Fill in distance and way to an edge [N], metres, at places [N 3] in cells.

    `index` [X Y Z] of the blocks; `coarse` and `coarse_rim` [X+1 Y+1 Z+1]; `fine` and `fine_rim` [B+1 5 5 5].
    Off the grid the distance is no more than true.
    """
    low, share, most = np.empty(3, np.int64), np.empty(3), REACH * cell
    for n in range(len(place)):
        off = locate(place, n, SIDE, index.shape, low, share) * SIDE * cell
        d = between(coarse, low, share) * FARTHEST / 127
        r = least_around(coarse_rim, low)  # an edge nearby is not overlooked
        block = index[low[0], low[1], low[2]]
        if off > 0:
            d = max(d - off, off)
        elif block > 0:
            within_block(share, low)
            near = between(fine[block], low, share) * most / STEPS
            r = between(fine_rim[block], low, share)
            part = min(max((abs(near) / most - SURE) / (1 - SURE), 0.0), 1.0)
            beyond = max(abs(near), abs(d)) if near >= 0 else -max(abs(near), abs(d))
            d = near + part * (beyond - near)
        distance[n], rim[n] = d, r * RIM / 255


@inner
def nearest_block(place, n, index, low, share):
    """The nearest block to the nth place among those around its own that are kept, or 0. Fills in the nearest
    place in it."""
    found, nearest = 0, 1e9
    home = (low[0], low[1], low[2])
    for i in range(max(home[0] - 1, 0), min(home[0] + 2, index.shape[0])):
        for j in range(max(home[1] - 1, 0), min(home[1] + 2, index.shape[1])):
            for k in range(max(home[2] - 1, 0), min(home[2] + 2, index.shape[2])):
                x, y, z = place[n, 0] / SIDE - i, place[n, 1] / SIDE - j, place[n, 2] / SIDE - k
                p, q, r = min(max(x, 0.0), 1.0), min(max(y, 0.0), 1.0), min(max(z, 0.0), 1.0)
                way = (x - p) ** 2 + (y - q) ** 2 + (z - r) ** 2
                if index[i, j, k] > 0 and way < nearest:
                    nearest, found = way, index[i, j, k]
                    share[0], share[1], share[2] = p, q, r
    return found


@compiled
def fill_color(place, index, color, scale, found):
    """Fill in colours [N C] at places [N 3] in cells, of blocks [C B+1 5 5 5]; grey far from all blocks."""
    low, share = np.empty(3, np.int64), np.empty(3)
    for n in range(len(place)):
        locate(place, n, SIDE, index.shape, low, share)
        block = index[low[0], low[1], low[2]]
        if block == 0:
            block = nearest_block(place, n, index, low, share)
        within_block(share, low)
        for c in range(found.shape[1]):
            found[n, c] = between(color[c, block], low, share) * scale if block > 0 else 0.5 * SHADES * scale
