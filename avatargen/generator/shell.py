"""The shells around posed bodies: where along each ray clothes can be, so that no sample is spent elsewhere.

Space is cut into cubes; those within reach of a body vertex are marked. A ray is cut into `STEPS` short
pieces, each looked up once; samples are spread evenly over the marked pieces alone. Between them there is
nothing, so the volume rendering equation keeps its form, with the marked length in place of the whole.

Letters: B people, V vertices, P rays, T steps, S samples. Metres along unit directions.
"""

import math
from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float, Int64
from torch import Tensor

from avatargen.generator.draws import uniform
from avatargen.generator.layers import may_branch
from avatargen.generator.renderer import Samples, box_interval, segments

CELL = 0.03  # metres
STEPS = 96  # pieces of a ray within the shell's box
SPAN = 2.7  # metres that a body takes up at most, where its size is not asked
FAR = 10_000  # squared cells


@dataclass(frozen=True, kw_only=True)
class Shell:
    """Marked cubes: every point within reach of a body vertex lies in one, and few others do."""

    box: Float[Tensor, "2 B 3"]  # low corners and high, a whole number of cubes apart
    marked: Bool[Tensor, "B x y z"]

    def holds(self, points: Float[Tensor, "B *some 3"]) -> Bool[Tensor, "B *some"]:
        """Which points lie in marked cubes; points outside the box do not."""
        flat = points.flatten(1, -2)
        cell = ((flat - self.box[0, :, None]) / CELL).floor()
        place = torch.zeros((), dtype=torch.long, device=points.device)
        within = torch.ones((), dtype=torch.bool, device=points.device)
        for axis, count in enumerate(self.marked.shape[1:]):
            along = cell[..., axis]
            within = within & (along >= 0) & (along < count)
            place = place * count + along.clamp(0, count - 1).long()
        marked = self.marked.flatten(1).gather(1, place) & within
        return marked.view(points.shape[:-1])


def shell_around(vertices: Float[Tensor, "B V 3"], reach: float) -> Shell:
    """Cubes that hold a point within `reach` metres of a vertex, and some a cube's diagonal farther.

    On the CPU the grid is as large as the bodies ask; elsewhere nobody waits for their size.
    """
    margin = reach + 2 * CELL
    origin = vertices.amin(dim=1) - margin
    cells = ((vertices.amax(dim=1) + margin - origin) / CELL).ceil()
    if may_branch(vertices):
        counts = cells.amax(dim=0).long().tolist()
    else:
        counts = [math.ceil((SPAN + 2 * margin) / CELL)] * 3
    place = torch.zeros((), dtype=torch.long, device=vertices.device)
    for axis, count in enumerate(counts):
        cell = ((vertices[..., axis] - origin[:, None, axis]) / CELL).long()
        place = place * count + cell.clamp(0, count - 1)
    squared = torch.full((len(vertices), math.prod(counts)), FAR, dtype=torch.int16, device=vertices.device)
    squared = squared.scatter(1, place, 0).unflatten(1, counts)
    radius = reach / CELL + math.sqrt(3)
    for axis in (1, 2, 3):
        squared = spread(squared, axis, int(radius))
    return Shell(box=torch.stack([origin, origin + cells * CELL]), marked=squared <= radius**2)


def spread(squared: Tensor, axis: int, reach: int) -> Tensor:
    """Squared distances to what is marked (counted in cells) along one more axis, up to `reach` cells."""
    nearer, size = squared.clone(), squared.shape[axis]
    for step in range(1, min(reach, size - 1) + 1):
        for here, there in ((step, 0), (0, step)):
            part = nearer.narrow(axis, here, size - step)
            torch.minimum(part, squared.narrow(axis, there, size - step) + step**2, out=part)
    return nearer


def shell_samples(
    shell: Shell,
    origin: Float[Tensor, "B P 3"],
    direction: Float[Tensor, "B P 3"],
    count: int,
    seeds: Int64[Tensor, " B"] | None = None,
) -> tuple[Samples, Float[Tensor, "B P"]]:
    """`count` samples a ray in equal bins of the length within the shell, and where the ray leaves its box.

    One in each bin, at random with seeds, in the middle without. Lengths are 0 on a ray that misses.
    """
    near, far = box_interval(origin, direction, shell.box[:, :, None])
    step = (far - near) / STEPS
    middle = near[..., None] + (torch.arange(STEPS, device=origin.device) + 0.5) * step[..., None]
    points = origin[:, :, None] + middle[..., None] * direction[:, :, None]
    marked = shell.holds(points) & (step > 0)[..., None]
    passed = marked.cumsum(dim=2).to(origin)  # B P T: marked pieces up to and with each
    total = passed[..., -1]
    within = near.new_full((*near.shape, count), 0.5)
    if seeds is not None:
        within = uniform(seeds, near.shape[1] * count, stream=0).view_as(within).to(near)
    bins = torch.arange(count, device=near.device) + within
    place = bins * (total / count)[..., None]  # in marked pieces
    piece = torch.searchsorted(passed, place, right=True).clamp_max(STEPS - 1)
    before = torch.where(piece > 0, passed.gather(2, (piece - 1).clamp_min(0)), 0.0)
    depth = near[..., None] + (piece + (place - before)) * step[..., None]
    length = segments(bins, count) * (total * step / count)[..., None]
    return Samples(depth=depth, length=length), far
