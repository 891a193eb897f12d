"""Volume rendering in a fixed box of observed space.

    cameras -> rays through the box -> samples -> field -> features, depth, mask

A field is a function of points and of the directions that they are seen along, so that a sphere tests it.

Letters: B pictures, P rays, S samples, N points, K features. Metres along unit directions.
"""

from collections.abc import Callable
from dataclasses import dataclass

import torch
from jaxtyping import Float, Int64
from torch import Tensor
from torch.nn import functional as F

from avatargen.generator.camera import Camera, rays
from avatargen.generator.density import Density
from avatargen.generator.picture import Picture
from avatargen.generator.renderer import Rendering, Samples, box_interval, composite

# points and directions to what the density takes (a distance, or a number that stands for it) and features
Field = Callable[
    [Float[Tensor, "B N 3"], Float[Tensor, "B N 3"]], tuple[Float[Tensor, "B N"], Float[Tensor, "B N K"]]
]
FLOOR = 0.01  # share of the pieces' mean weight that even an empty one has, so that some samples go there


@dataclass(frozen=True, kw_only=True)
class Rays:
    """Rays and where they enter and leave the box; the same where they miss it."""

    origin: Float[Tensor, "B P 3"]
    direction: Float[Tensor, "B P 3"]
    near: Float[Tensor, "B P"]
    far: Float[Tensor, "B P"]

    def at(self, depth: Float[Tensor, "B P S"]) -> Float[Tensor, "B P S 3"]:
        return self.origin[:, :, None] + depth[..., None] * self.direction[:, :, None]

    def some(self, index: Int64[Tensor, "B n"]) -> "Rays":
        """Some of each picture's rays, by their numbers."""
        at = index[..., None].expand(-1, -1, 3)
        return Rays(
            origin=self.origin.gather(1, at),
            direction=self.direction.gather(1, at),
            near=self.near.gather(1, index),
            far=self.far.gather(1, index),
        )


def box_rays(camera: Camera, size: int, box: Float[Tensor, "2 3"]) -> Rays:
    """Rays through the centres of size x size pixels, row by row, cut to the box."""
    origin, direction = rays(camera, size)
    near, far = box_interval(origin, direction, box)
    return Rays(origin=origin, direction=direction, near=near, far=far)


def ask(
    field: Field, rays: Rays, depth: Float[Tensor, "B P S"]
) -> tuple[Float[Tensor, "B P S"], Float[Tensor, "B P S K"]]:
    """The field at samples of rays."""
    points = rays.at(depth)
    direction = rays.direction[:, :, None].expand_as(points)
    number, features = field(points.flatten(1, 2), direction.flatten(1, 2))
    return number.view(depth.shape), features.unflatten(1, depth.shape[1:])


def spread(rays: Rays, within: Float[Tensor, "B P S"]) -> Samples:
    """A sample in each of S equal bins of a ray; `within` says where in its bin, 0..1."""
    count = within.shape[-1]
    place = (torch.arange(count, device=within.device) + within) / count
    return samples_at(rays, rays.near[..., None] + place * (rays.far - rays.near)[..., None])


def samples_at(rays: Rays, depth: Float[Tensor, "B P S"]) -> Samples:
    """Samples at ascending depths, with the lengths of what lies before, between and behind."""
    ends = torch.cat([rays.near[..., None], depth, rays.far[..., None]], dim=-1)
    return Samples(depth=depth, length=torch.diff(ends, dim=-1))


def render_once(field: Field, rays: Rays, within: Float[Tensor, "B P S"], density: Density) -> Rendering:
    """Volume rendering of a field at one sample a bin."""
    samples = spread(rays, within)
    number, features = ask(field, rays, samples.depth)
    return composite(number, features, samples, rays.far, density)


def render_twice(
    field: Field,
    rays: Rays,
    within: Float[Tensor, "B P S"],
    again: Float[Tensor, "B P T"],
    density: Density,
) -> Rendering:
    """Volume rendering by S samples spread evenly and T where those found something (NeRF, section 5.2).

    The field is asked once at each; all S + T together make the picture.
    """
    coarse = spread(rays, within).depth
    number, features = ask(field, rays, coarse)
    with torch.no_grad():
        fine = where_it_is(density(number), rays, again)
    more_number, more_features = ask(field, rays, fine)
    depth, order = torch.cat([coarse, fine], dim=-1).sort(dim=-1)
    number = torch.cat([number, more_number], dim=-1).gather(-1, order)
    features = torch.cat([features, more_features], dim=-2)
    features = features.gather(-2, order[..., None].expand_as(features))
    return composite(number, features, samples_at(rays, depth), rays.far, density)


def where_it_is(
    sigma: Float[Tensor, "B P S"], rays: Rays, again: Float[Tensor, "B P T"]
) -> Float[Tensor, "B P T"]:
    """Ascending depths, drawn as the light is stopped by S equal pieces of the given densities.

    `again` are numbers 0..1, one for each of T equal shares of the light. Weights are smoothed by a maximum
    and a mean over neighbours (Mip-NeRF, equation 18), for the pieces know little of their borders.
    """
    step = (rays.far - rays.near)[..., None] / sigma.shape[-1]
    optical = sigma * step
    before = F.pad(torch.cumsum(optical[..., :-1], dim=-1), (1, 0))
    weights = torch.exp(-before) * -torch.expm1(-optical)
    wide = torch.maximum(F.pad(weights, (1, 0)), F.pad(weights, (0, 1)))
    weights = (wide[..., 1:] + wide[..., :-1]) / 2 + FLOOR / sigma.shape[-1]
    share = weights / weights.sum(dim=-1, keepdim=True)
    passed = torch.cumsum(share, dim=-1)
    count = again.shape[-1]
    light = (torch.arange(count, device=again.device) + again) / count * passed[..., -1:]
    piece = torch.searchsorted(passed, light.contiguous(), right=True).clamp_max(sigma.shape[-1] - 1)
    start = (passed - share).gather(-1, piece)
    along = ((light - start) / share.gather(-1, piece)).clamp(0, 1)
    return rays.near[..., None] + (piece + along) * step


def paint_over(seen: Rendering, background: float | Float[Tensor, "B P 3"]) -> Float[Tensor, "B P 3"]:
    """The colours that rays see, before a background."""
    return seen.features[..., :3] + (1 - seen.mask[..., None]) * background


def as_picture(values: Float[Tensor, "B P C"]) -> Float[Tensor, "B C r r"]:
    """Rays row by row as a square picture."""
    size = round(values.shape[1] ** 0.5)
    return values.transpose(1, 2).unflatten(2, (size, size))


def picture_of(image: Float[Tensor, "B 3 S S"], raw: Float[Tensor, "B 3 r r"], seen: Rendering) -> Picture:
    """The final picture and the raw ones; `depth` and `mask` as the rays saw them."""
    depth, mask = (as_picture(values[..., None])[:, 0] for values in (seen.depth, seen.mask))
    return Picture(image=image, raw=raw, depth=depth, mask=mask)
