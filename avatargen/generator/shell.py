"""The shell around a posed body: where along each ray clothes can be, so that no sample is spent elsewhere.

Space is cut into cubes; those within reach of a body vertex are marked. A ray is cut into `STEPS` short
pieces, each looked up once; samples are spread evenly over the marked pieces alone. Between them there is
nothing, so the volume rendering equation keeps its form, with the marked length in place of the whole.

Letters: V vertices, P rays, T steps, S samples. Metres along unit directions.
"""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float
from scipy.ndimage import distance_transform_edt
from torch import Tensor

from avatargen.generator.renderer import Samples, box_interval, places, segments

CELL = 0.03  # metres
STEPS = 96  # pieces of a ray within the shell's box


@dataclass(frozen=True, kw_only=True)
class Shell:
    """Marked cubes: every point within reach of a body vertex lies in one, and few others do."""

    origin: Float[Tensor, "3"]
    marked: Bool[Tensor, "x y z"]

    @property
    def box(self) -> Float[Tensor, "2 3"]:
        size = torch.tensor(self.marked.shape, device=self.origin.device) * CELL
        return torch.stack([self.origin, self.origin + size])

    def holds(self, points: Float[Tensor, "*batch 3"]) -> Bool[Tensor, "*batch"]:
        """Which points lie in marked cubes; points outside the box do not."""
        counts = torch.tensor(self.marked.shape, device=points.device)
        cell = ((points - self.origin) / CELL).floor()
        within = ((cell >= 0) & (cell < counts)).all(dim=-1)
        x, y, z = cell.clamp_min(0).minimum(counts - 1).long().unbind(-1)
        return self.marked[x, y, z] & within


def shell_around(
    vertices: Float[np.ndarray, "V 3"], reach: float, device: torch.device | str = "cpu"
) -> Shell:
    """Cubes that hold a point within `reach` metres of a vertex, and some a cube's diagonal farther."""
    margin = reach + 2 * CELL
    origin = vertices.min(axis=0) - margin
    counts = np.ceil((vertices.max(axis=0) + margin - origin) / CELL).astype(np.int64)
    empty = np.ones(counts, dtype=bool)
    empty[tuple(((vertices - origin) / CELL).astype(np.int64).T)] = False
    marked = distance_transform_edt(empty, sampling=CELL) <= reach + np.sqrt(3) * CELL
    return Shell(
        origin=torch.from_numpy(origin.astype(np.float32)).to(device),
        marked=torch.from_numpy(marked).to(device),
    )


def shell_samples(
    shell: Shell,
    origin: Float[Tensor, "P 3"],
    direction: Float[Tensor, "P 3"],
    count: int,
    draw: torch.Generator | None = None,
) -> tuple[Samples, Float[Tensor, " P"]]:
    """`count` samples a ray in equal bins of the length within the shell, and where the ray leaves its box.

    One in each bin, at random with a generator, in the middle without. Lengths are 0 on a ray that misses.
    """
    near, far = box_interval(origin, direction, shell.box.to(origin))
    step = (far - near) / STEPS
    middle = near[:, None] + (torch.arange(STEPS, device=origin.device) + 0.5) * step[:, None]
    marked = shell.holds(origin[:, None] + middle[..., None] * direction[:, None]) & (step > 0)[:, None]
    passed = marked.cumsum(dim=1).to(origin)  # P T: marked pieces up to and with each
    total = passed[:, -1]
    bins = places(near, count, draw)
    place = bins * (total / count)[:, None]  # in marked pieces
    piece = torch.searchsorted(passed, place, right=True).clamp_max(STEPS - 1)
    before = torch.where(piece > 0, passed.gather(1, (piece - 1).clamp_min(0)), 0.0)
    depth = near[:, None] + (piece + (place - before)) * step[:, None]
    length = segments(bins, count) * (total * step / count)[:, None]
    return Samples(depth=depth, length=length), far
