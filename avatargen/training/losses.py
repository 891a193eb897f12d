"""The losses of section 3.5.

    adversarial: non-saturating, with R1 on both halves of real pictures
    eikonal: the distance's slope is one
    minimal surface: nothing floats
    smpl: the body lies near the surface

The paper prints the minimal-surface loss as exp(-100 d), which explodes inside the body; exp(-100 |d|) is
what its relatives use, and here.

Letters: B pictures, P people, N points.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn import functional as F

from avatargen.generator.generator import AvatarGenerator
from avatargen.generator.picture import CanonicalSurface, Person, field_of_person
from avatargen.training.discriminator import Discriminator

STEEPNESS = 100.0  # per metre, of the minimal-surface loss
SCATTER = 0.04  # metres around the body within which the slope is asked
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
    return sum((slope.square().sum(dim=(1, 2, 3)).mean() for slope in slopes), torch.zeros(())) / 2


def eikonal(slope: Float[Tensor, " N"]) -> Float[Tensor, ""]:
    """How far slopes are from one."""
    return (slope - 1).square().mean()


def minimal_surface(sdf: Float[Tensor, " N"]) -> Float[Tensor, ""]:
    """How near to zero distances in metres are; at most 1, on the surface."""
    return torch.exp(-STEEPNESS * sdf.abs()).mean()


def slope_of(gradient: Float[Tensor, "N 3"]) -> Float[Tensor, " N"]:
    """Lengths of gradients, with a derivative that is finite where a gradient is zero."""
    return (gradient.square().sum(dim=-1) + 1e-12).sqrt()


def geometry_losses(
    generator: AvatarGenerator,
    surface: CanonicalSurface,
    people: Sequence[Person],
    points: int,
    draws: Sequence[torch.Generator | None],
) -> GeometryLosses:
    """The three losses on the people's fields at random points near their posed bodies.

    All zero for a generator that learns density: it has no distance. The slope counts every way on which a
    point reaches the distance but one: where the closest body point moves along the body, the features that
    are learned at its vertices count as constant.
    """
    if generator.config.geometry.representation == "density":
        zero = torch.zeros((), device=people[0].w.device)
        return GeometryLosses(eikonal=zero, minimal_surface=zero, smpl=zero)
    rows = [
        losses_of_person(generator, surface, person, points, draw)
        for person, draw in zip(people, draws, strict=True)
    ]
    means = [torch.stack(column).mean() for column in zip(*rows, strict=True)]
    return GeometryLosses(eikonal=means[0], minimal_surface=means[1], smpl=means[2])


def losses_of_person(
    generator: AvatarGenerator,
    surface: CanonicalSurface,
    person: Person,
    count: int,
    draw: torch.Generator | None,
) -> tuple[Float[Tensor, ""], Float[Tensor, ""], Float[Tensor, ""]]:
    """Eikonal, minimal-surface and smpl loss of one person."""
    vertices = torch.from_numpy(person.posed.vertices).float()
    near = vertices[torch.randint(len(vertices), (count,), generator=draw)]
    near = near + torch.randn(near.shape, generator=draw) * SCATTER
    sdf, slope = distance_and_slope(generator, surface, person, near.to(person.w.device))
    body = vertices[torch.randint(len(vertices), (BODY_POINTS,), generator=draw)].to(person.w.device)
    canonical, _ = person.map(body, generator.config.render.nearest)
    on_body, _ = field_of_person(generator, surface, person, body, canonical)
    return eikonal(slope), minimal_surface(sdf), on_body.abs().mean()


def distance_and_slope(
    generator: AvatarGenerator, surface: CanonicalSurface, person: Person, points: Float[Tensor, "N 3"]
) -> tuple[Float[Tensor, " N"], Float[Tensor, " N"]]:
    """Distance and the length of its gradient at posed points; both can be differentiated by the weights."""
    points = points.detach().requires_grad_()
    canonical, _ = person.map(points, generator.config.render.nearest)
    sdf, _ = field_of_person(generator, surface, person, points, canonical, "differentiable")
    (gradient,) = torch.autograd.grad(sdf.sum(), points, create_graph=True)
    return sdf, slope_of(gradient)
