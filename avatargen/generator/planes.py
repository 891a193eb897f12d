"""Sample the three planes at points (section 3.2).

Letters: B people, N points, C channels, R resolution. Plane 0 spans (x, y), plane 1 (y, z), plane 2 (x, z):
its first axis runs along columns, its second along rows. Texel i of an axis has its centre at (i + 0.5) / R
of the box (align_corners=False); beyond the outermost centres the border repeats. The three samples are
summed.
"""

from typing import Literal

import torch
from jaxtyping import Float, Shaped
from torch import Tensor, nn
from torch.nn import functional as F

from avatargen.generator.config import PlanesConfig

COLUMN_AXES = [0, 1, 0]
ROW_AXES = [1, 2, 2]


class PlaneFrame(nn.Module):
    """Canonical points in metres to texel coordinates in 0..1, through the box and the optional warp."""

    low: Tensor
    size: Tensor
    knots: Tensor
    slopes: Tensor

    def __init__(self, config: PlanesConfig) -> None:
        super().__init__()
        low, high = torch.tensor(config.low), torch.tensor(config.high)
        self.register_buffer("low", low, persistent=False)
        self.register_buffer("size", high - low, persistent=False)
        warp = config.warp or (((0.0, 0.0), (1.0, 1.0)),) * 3
        table = torch.tensor(warp)  # 3 K 2
        slope = table[:, 1:, 1] - table[:, :-1, 1]
        slope = slope / (table[:, 1:, 0] - table[:, :-1, 0])  # 3 K-1
        change = torch.diff(slope, dim=1, prepend=torch.zeros(3, 1))
        self.register_buffer("knots", table[:, :-1, 0].T.contiguous(), persistent=False)  # K-1 3
        self.register_buffer("slopes", change.T.contiguous(), persistent=False)

    def forward(self, points: Float[Tensor, "*batch 3"]) -> Float[Tensor, "*batch 3"]:
        """Texel coordinates in 0..1; points outside the box land on its border."""
        place = ((points - self.low) / self.size).clamp(0, 1)
        warped = place * self.slopes[0]
        for knot, change in zip(self.knots[1:], self.slopes[1:], strict=True):
            warped = torch.addcmul(warped, (place - knot).clamp_min(0), change)
        return warped

    def centered(self, points: Float[Tensor, "*batch 3"]) -> Float[Tensor, "*batch 3"]:
        """Points scaled so that the box is -1..1 on each axis; not warped, not clamped."""
        return (points - self.low) / self.size * 2 - 1


def sample_planes(
    planes: Float[Tensor, "B 3 C R R"],
    coordinates: Float[Tensor, "B N 3"],
    method: Literal["fast", "differentiable"] = "fast",
) -> Float[Tensor, "B N C"]:
    """Sum of the three planes' bilinear samples at texel coordinates in 0..1.

    `fast` is torch's grid_sample, once differentiable; `differentiable` gathers and weighs the four texels in
    operations that torch can differentiate any number of times, which a penalty on the gradient of the field
    needs. Both agree to rounding.
    """
    if method == "differentiable":
        return gather_bilinear(planes, coordinates)
    grid = torch.stack(columns_and_rows(coordinates), dim=-1) * 2 - 1  # B N 3 2
    B, _, C, R, _ = planes.shape
    sampled = F.grid_sample(
        planes.reshape(B * 3, C, R, R),
        grid.transpose(1, 2).reshape(B * 3, 1, -1, 2),
        padding_mode="border",
        align_corners=False,
    )
    return sampled.reshape(B, 3, C, -1).sum(dim=1).transpose(1, 2)


def columns_and_rows(
    coordinates: Shaped[Tensor, "*batch 3"],
) -> tuple[Shaped[Tensor, "*batch 3"], Shaped[Tensor, "*batch 3"]]:
    """The three planes' columns and rows."""
    axes = coordinates.unbind(dim=-1)
    column, row = (torch.stack([axes[i] for i in some], dim=-1) for some in (COLUMN_AXES, ROW_AXES))
    return column, row


def texels(
    coordinates: Float[Tensor, "*batch 3"], resolution: int
) -> tuple[Float[Tensor, "*batch 3"], Float[Tensor, "*batch 3"]]:
    """Lower texel of each axis (whole numbers, as floats) and the fraction toward the next one."""
    place = (coordinates * resolution - 0.5).clamp(0, resolution - 1)
    lower = place.detach().floor().clamp_max(resolution - 2)
    return lower, place - lower


def corner_weights(fraction: Float[Tensor, "*batch 3"]) -> Float[Tensor, "*batch 12"]:
    """Bilinear weights of the four texels of each plane: (0, 0), (0, +1 column), (+1 row, 0), (+1, +1).

    Each is a product of f or 1 - f of two axes; small matrix products pick the factors fastest.
    """
    column, row = fraction.new_tensor(COLUMN_FACTORS), fraction.new_tensor(ROW_FACTORS)
    return (fraction @ column[:3] + column[3]) * (fraction @ row[:3] + row[3])


def corner_factors(axes: list[int], upper: list[bool]) -> list[list[float]]:
    """[4 12]: coefficients of (fx, fy, fz, 1) in the factor f or 1 - f that an axis gives to each texel."""
    table = [[0.0] * 12 for _ in range(4)]
    for plane, axis in enumerate(axes):
        for corner, is_upper in enumerate(upper):
            table[axis][4 * plane + corner] = 1.0 if is_upper else -1.0
            table[3][4 * plane + corner] = 0.0 if is_upper else 1.0
    return table


COLUMN_FACTORS = corner_factors(COLUMN_AXES, [False, True, False, True])
ROW_FACTORS = corner_factors(ROW_AXES, [False, False, True, True])


def corner_indices(lower: Float[Tensor, "*batch 3"], resolution: int) -> Tensor:
    """[*batch 12] rows of each plane's four texels in a table [3 R R, C], ordered as `corner_weights`."""
    R = resolution
    stride = lower.new_tensor([[1, 0, 1], [R, 1, 0], [0, R, R]])
    base = lower @ stride + lower.new_tensor([0, R * R, 2 * R * R])  # exact in float32 below 2^24 texels
    offsets = torch.tensor([0, 1, R, R + 1], device=lower.device)
    return (base.long()[..., None] + offsets).flatten(-2)


def plane_table(planes: Float[Tensor, "B 3 C R R"]) -> Float[Tensor, "B T C"]:
    """The planes' texels as rows: T = 3 R R."""
    return planes.permute(0, 1, 3, 4, 2).flatten(1, 3)


def gather_bilinear(
    planes: Float[Tensor, "B 3 C R R"], coordinates: Float[Tensor, "B N 3"]
) -> Float[Tensor, "B N C"]:
    """Bilinear samples by indexing: differentiable twice and more in the planes and the coordinates."""
    B, _, _, R, _ = planes.shape
    lower, fraction = texels(coordinates, R)
    column, row = columns_and_rows(lower.long())
    plane = torch.arange(3, device=row.device) + 3 * torch.arange(B, device=row.device)[:, None, None]
    first = (plane * R + row) * R + column  # B N 3
    index = torch.stack([first, first + 1, first + R, first + R + 1], dim=-1)
    right, below = columns_and_rows(fraction)
    left, above = 1 - right, 1 - below
    weights = torch.stack([left * above, right * above, left * below, right * below], dim=-1)
    rows = plane_table(planes).flatten(0, 1).index_select(0, index.flatten()).unflatten(0, index.shape)
    return (weights[..., None] * rows).sum(dim=(2, 3))


def lookup_bilinear(table: Float[Tensor, "T C"], coordinates: Float[Tensor, "N 3"]) -> Float[Tensor, "N C"]:
    """The same for one person's cached table without gradients: the fastest on a CPU."""
    R = round((len(table) / 3) ** 0.5)
    lower, fraction = texels(coordinates, R)
    return F.embedding_bag(
        corner_indices(lower, R), table, per_sample_weights=corner_weights(fraction), mode="sum"
    )
