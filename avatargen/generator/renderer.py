"""Volume rendering by its equation (section 3.4).

The field is asked at S samples of a ray, one in each of S equal bins. Between samples the distance follows a
cubic and the features a line; before the first and after the last they stay the same. So each of the S + 1
segments is cut into M pieces of length delta, for which no network is asked:

    w_i = exp(-sum_{j<i} sigma_j delta_j) (1 - exp(-sigma_i delta_i))
    feature = sum_i w_i f_i,  mask = sum_i w_i

If a sample stood for its bin, a sharp surface would be seen up to a bin behind its place: centimetres with
few samples. The cubic sees that a ray which grazes a limb comes nearer to it than its samples do.

Letters: B pictures, P pixels, S samples, K features, M pieces. Metres along unit directions.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn import functional as F

from avatargen.generator.density import Density

PIECES = 8  # of a segment between two samples
FAINTEST = 1e-6  # mask that still has a depth
SHORTEST = 1e-9  # metres, of a segment that is divided by


@dataclass(frozen=True, kw_only=True)
class Samples:
    """Where rays are sampled: depths, and the lengths of what lies before, between and behind the samples
    (all 0 on a ray that misses).
    """

    depth: Float[Tensor, "*rays S"]
    length: Float[Tensor, "*rays S+1"]


@dataclass(frozen=True, kw_only=True)
class Rendering:
    """What rays see. `depth` is the mean distance of what stops the light; far where nothing does."""

    features: Float[Tensor, "*rays K"]
    depth: Float[Tensor, "*rays"]
    mask: Float[Tensor, "*rays"]


def box_interval(
    origin: Float[Tensor, "*rays 3"], direction: Float[Tensor, "*rays 3"], box: Float[Tensor, "2 *boxes 3"]
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
    width = ((far - near) / count)[..., None]
    place = places(near, count, draw)
    return Samples(depth=near[..., None] + place * width, length=segments(place, count) * width)


def places(
    near: Float[Tensor, "*rays"], count: int, draw: torch.Generator | None
) -> Float[Tensor, "*rays S"]:
    """One place in each bin, counted in bins: at random with a generator, in the middle without."""
    shape = (*near.shape, count)
    within = torch.rand(shape, generator=draw).to(near) if draw is not None else near.new_full(shape, 0.5)
    return torch.arange(count, device=near.device) + within


def segments(place: Float[Tensor, "*rays S"], count: int) -> Float[Tensor, "*rays S+1"]:
    """Lengths before, between and behind places, counted in bins."""
    ends = F.pad(place, (1, 0)), F.pad(place, (0, 1), value=float(count))
    return ends[1] - ends[0]


def composite(
    distance: Float[Tensor, "*rays S"],
    features: Float[Tensor, "*rays S K"],
    samples: Samples,
    far: Float[Tensor, "*rays"],
    density: Density,
) -> Rendering:
    """The volume rendering equation. Optical depths are summed, no transmittances multiplied.

    `distance` is what `density` takes. A piece has the mean density of a distance that is linear on it.
    """
    inside = torch.linspace(0, 1, PIECES + 1, dtype=distance.dtype, device=distance.device)
    first, last = samples.depth[..., :1], samples.depth[..., -1:]
    depth = torch.cat([first - samples.length[..., :1], samples.depth, last + samples.length[..., -1:]], -1)
    at_ends = torch.cat([distance[..., :1], distance, distance[..., -1:]], dim=-1)
    fine = curve(at_ends, samples.length, inside)  # *rays S+1 M+1
    sigma = density.between(fine[..., :-1], fine[..., 1:])
    optical = (sigma * samples.length[..., None] / PIECES).flatten(-2)
    before = F.pad(torch.cumsum(optical[..., :-1], dim=-1), (1, 0))
    weights = (torch.exp(-before) * -torch.expm1(-optical)).unflatten(-1, (-1, PIECES))
    mask = -torch.expm1(-optical.sum(dim=-1))
    middle = (inside[:-1] + inside[1:]) / 2
    shares = F.pad((weights * (1 - middle)).sum(-1), (0, 1)) + F.pad((weights * middle).sum(-1), (1, 0))
    rest = distance.shape[-1] - 1
    own = shares[..., 1:-1] + F.pad(shares[..., :1], (0, rest)) + F.pad(shares[..., -1:], (rest, 0))
    seen = (shares * depth).sum(dim=-1)
    return Rendering(
        features=(own[..., None] * features).sum(dim=-2),
        depth=torch.where(mask > FAINTEST, seen / mask.clamp_min(FAINTEST), far),
        mask=mask,
    )


def curve(
    at_ends: Float[Tensor, "*rays E"], length: Float[Tensor, "*rays T"], inside: Float[Tensor, " N"]
) -> Float[Tensor, "*rays T N"]:
    """The cubic (Hermite) on each of T segments, at N places 0..1 of it, by numbers at its E = T + 1 ends.

    Its slope at a sample is that of the parabola through the sample and its neighbours, and 0 at both ends.
    """
    secant = torch.diff(at_ends, dim=-1) / length.clamp_min(SHORTEST)
    before, after = length[..., :-1], length[..., 1:]
    slope = secant[..., :-1] * after + secant[..., 1:] * before
    slope = F.pad(slope / (before + after).clamp_min(SHORTEST), (1, 1))
    start, end = at_ends[..., :-1, None], at_ends[..., 1:, None]
    leave, arrive = (part * length for part in (slope[..., :-1], slope[..., 1:]))
    t, rest = inside, 1 - inside
    return (
        start * (1 + 2 * t) * rest**2
        + end * t**2 * (3 - 2 * t)
        + leave[..., None] * t * rest**2
        - arrive[..., None] * t**2 * rest
    )
