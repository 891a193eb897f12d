"""Volume rendering by its equation (section 3.4).

A ray is cut into S equal bins; a sample stands for its whole bin of width delta:

    w_i = exp(-sum_{j<i} sigma_j delta) (1 - exp(-sigma_i delta))
    feature = sum_i w_i f_i,  mask = sum_i w_i

Letters: B pictures, P pixels, S samples, K features. Metres along unit directions.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor


@dataclass(frozen=True, kw_only=True)
class Samples:
    """Where rays are sampled: depths, and the width of each ray's bins (0 on a ray that misses)."""

    depth: Float[Tensor, "*rays S"]
    width: Float[Tensor, "*rays"]


@dataclass(frozen=True, kw_only=True)
class Rendering:
    """What rays see. `depth` is the mean distance, where light that passes through counts as far."""

    features: Float[Tensor, "*rays K"]
    depth: Float[Tensor, "*rays"]
    mask: Float[Tensor, "*rays"]


def box_interval(
    origin: Float[Tensor, "*rays 3"], direction: Float[Tensor, "*rays 3"], box: Float[Tensor, "2 3"]
) -> tuple[Float[Tensor, "*rays"], Float[Tensor, "*rays"]]:
    """Distances at which rays enter and leave a box; equal where they miss it or have it behind."""
    safe = torch.where(direction.abs() < 1e-12, torch.full_like(direction, 1e-12), direction)
    first, second = (box[0] - origin) / safe, (box[1] - origin) / safe
    near = torch.minimum(first, second).amax(dim=-1).clamp_min(0)
    far = torch.maximum(first, second).amin(dim=-1)
    return near, torch.maximum(near, far)


def stratify(
    near: Float[Tensor, "*rays"],
    far: Float[Tensor, "*rays"],
    count: int,
    draw: torch.Generator | None = None,
) -> Samples:
    """One sample in each of `count` equal bins: at random with a generator, in the middle without."""
    width = (far - near) / count
    shape = (*near.shape, count)
    within = torch.rand(shape, generator=draw).to(near) if draw is not None else near.new_full(shape, 0.5)
    place = torch.arange(count, device=near.device) + within
    return Samples(depth=near[..., None] + place * width[..., None], width=width)


def composite(
    sigma: Float[Tensor, "*rays S"],
    features: Float[Tensor, "*rays S K"],
    samples: Samples,
    far: Float[Tensor, "*rays"],
) -> Rendering:
    """The volume rendering equation. Optical depths are summed, no transmittances multiplied."""
    optical = sigma * samples.width[..., None]
    before = torch.cumsum(optical, dim=-1) - optical
    weights = torch.exp(-before) * -torch.expm1(-optical)  # *rays S
    passed = torch.exp(-optical.sum(dim=-1))
    return Rendering(
        features=(weights[..., None] * features).sum(dim=-2),
        depth=(weights * samples.depth).sum(dim=-1) + passed * far,
        mask=1 - passed,
    )
