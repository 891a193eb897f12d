"""The losses of section 3.5.

    adversarial: non-saturating, with R1 on both halves of real pictures
    eikonal: the distance's slope is one
    minimal surface: nothing floats
    smpl: the body lies near the surface

The paper prints the minimal-surface loss as exp(-100 d), which explodes inside the body; exp(-100 |d|) is
what its relatives use, and here.

Letters: B pictures, P people, N points.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float, Int64
from torch import Tensor
from torch.nn import functional as F

from avatargen.generator.draws import normal, uniform
from avatargen.generator.generator import AvatarGenerator
from avatargen.generator.picture import People, field_of_people
from avatargen.training.discriminator import Discriminator

STEEPNESS = 100.0  # per metre, of the minimal-surface loss
SCATTER = 0.04  # metres around the body within which the slope is asked
NEAR, AROUND, ON_BODY = 1, 2, 4  # streams of a person's seed; samples along rays take the first, 0
BODY_POINTS = 256  # vertices of the body at which the smpl loss asks


@dataclass(frozen=True, kw_only=True)
class GeometryLosses:
    """Means over people and points, before weighting."""

    eikonal: Float[Tensor, ""]
    minimal_surface: Float[Tensor, ""]
    smpl: Float[Tensor, ""]


def generator_loss(logits: Float[Tensor, " B"]) -> Float[Tensor, ""]:
    """-log of the probability that generated pictures are real."""
    return F.softplus(-logits).mean()


def discriminator_loss(fake: Float[Tensor, " B"], real: Float[Tensor, " B"]) -> Float[Tensor, ""]:
    """-log of the probability of telling both right."""
    return F.softplus(fake).mean() + F.softplus(-real).mean()


def r1_penalty(
    discriminator: Discriminator,
    image: Float[Tensor, "B 3 S S"],
    raw: Float[Tensor, "B 3 r r"],
    label: Float[Tensor, "B L"],
) -> Float[Tensor, ""]:
    """Half the mean squared slope of the logit at real pictures, by both the final and the raw one."""
    image, raw = image.detach().requires_grad_(), raw.detach().requires_grad_()
    logits = discriminator(image, raw, label)
    slopes = torch.autograd.grad(logits.sum(), [image, raw], create_graph=True)
    return torch.stack([slope.square().sum(dim=(1, 2, 3)).mean() for slope in slopes]).sum() / 2


def eikonal(slope: Float[Tensor, "*batch N"]) -> Float[Tensor, ""]:
    """How far slopes are from one."""
    return (slope - 1).square().mean()


def minimal_surface(sdf: Float[Tensor, "*batch N"]) -> Float[Tensor, ""]:
    """How near to zero distances in metres are; at most 1, on the surface."""
    return torch.exp(-STEEPNESS * sdf.abs()).mean()


def slope_of(gradient: Float[Tensor, "*batch N 3"]) -> Float[Tensor, "*batch N"]:
    """Lengths of gradients, with a derivative that is finite where a gradient is zero."""
    return (gradient.square().sum(dim=-1) + 1e-12).sqrt()


def geometry_losses(
    generator: AvatarGenerator, people: People, points: int, seeds: Int64[Tensor, " B"]
) -> GeometryLosses:
    """The three losses on the people's fields at random points near their posed bodies.

    All zero for a generator that learns density: it has no distance. The slope counts every way on which a
    point reaches the distance but one: where the closest body point moves along the body, the features that
    are learned at its vertices count as constant.
    """
    if generator.config.geometry.representation == "density":
        zero = torch.zeros((), device=people.w.device)
        return GeometryLosses(eikonal=zero, minimal_surface=zero, smpl=zero)
    own = seeds.split([len(part) for part in people.parts])
    means = [losses_of(generator, *pair, points) for pair in zip(people.parts, own, strict=True)]
    eikonal, minimal_surface, smpl = (torch.stack(column).mean() for column in zip(*means, strict=True))
    return GeometryLosses(eikonal=eikonal, minimal_surface=minimal_surface, smpl=smpl)


def losses_of(
    generator: AvatarGenerator, people: People, seeds: Int64[Tensor, " B"], count: int
) -> tuple[Float[Tensor, ""], Float[Tensor, ""], Float[Tensor, ""]]:
    """Eikonal, minimal-surface and smpl loss of some people of one batch."""
    near = some_vertices(people, count, seeds, NEAR)
    near = near + normal(seeds, 3 * count, AROUND).view_as(near) * SCATTER
    sdf, slope = distance_and_slope(generator, people, near)
    body = some_vertices(people, BODY_POINTS, seeds, ON_BODY)
    canonical, _, vertex = people.posed.to_canonical(body, generator.config.render.nearest)
    on_body, _ = field_of_people(generator, people, body, canonical, vertex)
    return eikonal(slope), minimal_surface(sdf), on_body.abs().mean()


def some_vertices(
    people: People, count: int, seeds: Int64[Tensor, " B"], stream: int
) -> Float[Tensor, "B N 3"]:
    """Random vertices of the posed bodies."""
    vertices = people.posed.vertices
    index = (uniform(seeds, count, stream) * vertices.shape[1]).long()
    return vertices.gather(1, index[..., None].expand(-1, -1, 3))


def distance_and_slope(
    generator: AvatarGenerator, people: People, points: Float[Tensor, "B N 3"]
) -> tuple[Float[Tensor, "B N"], Float[Tensor, "B N"]]:
    """Distance and the length of its gradient at posed points; both can be differentiated by the weights."""
    points = points.detach().requires_grad_()
    canonical, _, near = people.posed.to_canonical(points, generator.config.render.nearest)
    sdf, _ = field_of_people(generator, people, points, canonical, near, "differentiable")
    (gradient,) = torch.autograd.grad(sdf.sum(), points, create_graph=True)
    return sdf, slope_of(gradient)
