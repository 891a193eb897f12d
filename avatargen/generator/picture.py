"""From people, poses and cameras to pictures (sections 3.3 and 3.4), many at once.

    rays --shell--> posed points --canonical map, deformation--> canonical points --field--> density, features
         --volume rendering--> feature picture --upsampling decoder--> picture

On the CPU people are rendered one by one, each with as many rays and samples as meet their shell. Elsewhere
all are rendered together and nobody waits for numbers of the device: `Room` says how many rays and samples
there can be, and without it all are asked.

Letters: B pictures, r raw size, S final size, P rays, K features, N points, Q chosen ones.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import torch
from jaxtyping import Bool, Float, Int64
from torch import Tensor

from avatargen.generator.camera import Camera, rays
from avatargen.generator.config import RenderConfig
from avatargen.generator.decoder import BodyPoints, PartLayers
from avatargen.generator.generator import AvatarGenerator
from avatargen.generator.layers import may_branch, without_autocast
from avatargen.generator.posing import PosedBodies
from avatargen.generator.renderer import Rendering, Samples, composite
from avatargen.generator.room import Room
from avatargen.generator.shell import Shell, shell_around, shell_samples
from avatargen.generator.surface import BodySurface, CanonicalSurface

BACKGROUND = 1.0  # white


@dataclass(frozen=True, kw_only=True)
class Picture:
    """The final picture and the raw ones: colours nominally 0..1 sRGB, depth in metres, mask 0..1."""

    image: Float[Tensor, "B 3 S S"]
    raw: Float[Tensor, "B 3 r r"]
    depth: Float[Tensor, "B r r"]
    mask: Float[Tensor, "B r r"]


@dataclass(frozen=True, kw_only=True, eq=False)
class People:
    """People to render: styles, planes, decoder layers, poses and shapes, and the posed bodies."""

    w: Float[Tensor, "B D"]
    planes: Float[Tensor, "B 3 C R R"]
    layers: tuple[PartLayers, ...]
    pose: Float[Tensor, "B J 3"]
    betas: Float[Tensor, "B b"]
    posed: PosedBodies
    canonical: BodySurface

    def __len__(self) -> int:
        return len(self.w)

    @cached_property
    def observed(self) -> BodySurface:
        """The posed bodies' surfaces."""
        return BodySurface(self.posed.vertices, self.canonical.topology)

    @cached_property
    def parts(self) -> "list[People]":
        """Those that are best rendered together: on the CPU one by one, elsewhere all."""
        if not may_branch(self.w) or len(self) == 1:
            return [self]
        layers = zip(*(part.of_each(len(self)) for part in self.layers), strict=True)
        return [self.one(i, own) for i, own in enumerate(layers)]

    def one(self, i: int, layers: tuple[PartLayers, ...]) -> "People":
        """One of them, with their layers."""
        own = slice(i, i + 1)
        posed = PosedBodies(
            vertices=self.posed.vertices[own], T_canonical_posed=self.posed.T_canonical_posed[own]
        )
        return People(
            w=self.w[own],
            planes=self.planes[own],
            layers=layers,
            pose=self.pose[own],
            betas=self.betas[own],
            posed=posed,
            canonical=self.canonical,
        )


def take_picture(
    generator: AvatarGenerator,
    surface: CanonicalSurface,
    z: Float[Tensor, "B Z"],
    camera: Camera,
    poses: Float[Tensor, "B J 3"],
    betas: Float[Tensor, "B b"],
    seeds: Int64[Tensor, " B"] | None = None,
) -> Picture:
    """Render people: latent, camera, axis-angle pose (radians) and shape to pictures.

    Samples are drawn at random along the rays with seeds, and stand in the middle of their bins without.
    """
    w = generator.mapping(z, camera.vector)
    people = make_people(generator, surface, w, generator.planes(w), poses, betas)
    return picture_people(generator, people, camera, seeds)


def make_people(
    generator: AvatarGenerator,
    surface: CanonicalSurface,
    w: Float[Tensor, "B D"],
    planes: Float[Tensor, "B 3 C R R"],
    poses: Float[Tensor, "B J 3"],
    betas: Float[Tensor, "B b"],
) -> People:
    """Pose everybody's body. The pose and shape that pictures show carry no gradient. Networks made for fewer
    directions of shape than the body has are told the first of them."""
    told = (0, generator.config.shape_count - betas.shape[1])
    with without_autocast(w.device):
        layers = generator.layers(w)
    return People(
        w=w,
        planes=planes,
        layers=layers,
        pose=poses,
        betas=torch.nn.functional.pad(betas, told),
        posed=surface.posing(w.device)(betas, poses),
        canonical=surface.on(w.device),
    )


def picture_people(
    generator: AvatarGenerator,
    people: People,
    camera: Camera,
    seeds: Int64[Tensor, " B"] | None,
    room: Room | None = None,
) -> Picture:
    """A picture of each person by a camera each; `seeds` place the samples, see `take_picture`."""
    size = generator.config.render.raw_size
    with without_autocast(people.w.device):
        every = rays(camera, size)
        seen, first = [], 0
        for part in people.parts:
            own = slice(first, first + len(part))
            first += len(part)
            some = None if seeds is None else seeds[own]
            seen.append(render(generator, part, (every[0][own], every[1][own]), some, room))
    features = torch.cat([r.features for r in seen]).transpose(1, 2).unflatten(2, (size, size))
    mask = torch.cat([r.mask for r in seen]).unflatten(1, (size, size))
    depth = torch.cat([r.depth for r in seen]).unflatten(1, (size, size))
    raw = features[:, :3] + (1 - mask[:, None]) * BACKGROUND
    image = generator.upsampler(torch.cat([raw, features[:, 3:]], dim=1), people.w)
    return Picture(image=image, raw=raw, depth=depth, mask=mask)


def render(
    generator: AvatarGenerator,
    people: People,
    ray: tuple[Float[Tensor, "B P 3"], Float[Tensor, "B P 3"]],
    seeds: Int64[Tensor, " B"] | None,
    room: Room | None = None,
    settings: RenderConfig | None = None,
    shell: Shell | None = None,
) -> Rendering:
    """Volume rendering; only samples within the shell around the posed body are asked.

    Other settings and another shell than the generator's own can be given, to measure what they change.
    """
    settings = settings or generator.config.render
    origin, direction = ray
    shell = shell or shell_around(people.posed.vertices, settings.shell)
    samples, far = shell_samples(shell, origin, direction, settings.samples, seeds)
    hit = chosen(samples.length.any(dim=2), room and room.rays)  # rays that miss cost nothing from here on
    samples = Samples(depth=rows(samples.depth, hit), length=rows(samples.length, hit))
    points = rows(origin, hit)[:, :, None] + samples.depth[..., None] * rows(direction, hit)[:, :, None]
    points = points.flatten(1, 2)
    canonical, away, nearest = people.posed.to_canonical(points, settings.nearest)
    within = away < settings.shell
    near = chosen(within, room and room.samples)
    asked = (rows(points, near), rows(canonical, near), rows(nearest, near))
    sdf, features = field_of_people(generator, people, *asked)
    # beyond the shell there is nothing but distance
    in_reach = rows(within, near)
    distance = away.to(sdf).scatter(1, near, torch.where(in_reach, sdf, rows(away, near).to(sdf)))
    features = spread_out(torch.where(in_reach[..., None], features, 0.0), near, points.shape[1])
    shape = samples.depth.shape
    every = features.unflatten(1, shape[1:])
    seen = composite(distance.view(shape), every, samples, rows(far, hit), generator.density)
    return Rendering(
        features=spread_out(seen.features, hit, far.shape[1]),
        depth=far.scatter(1, hit, seen.depth),
        mask=spread_out(seen.mask[..., None], hit, far.shape[1])[..., 0],
    )


def chosen(wanted: Bool[Tensor, "B N"], room: int | None) -> Int64[Tensor, "B Q"]:
    """Columns of what is wanted in each row, in order, and of others where a row wants fewer than `room`.

    Without room it is the largest count of a row, on the CPU; elsewhere all columns.
    """
    count = wanted.shape[1]
    if may_branch(wanted):
        room = int(wanted.sum(dim=1).amax())
    elif room is None:
        return torch.arange(count, device=wanted.device).expand(len(wanted), -1)
    return (~wanted).to(torch.uint8).sort(dim=1, stable=True).indices[:, :room]


def rows(values: Tensor, index: Int64[Tensor, "B Q"]) -> Tensor:
    """[B N ...] at columns [B Q]: [B Q ...]."""
    if len(values) == 1:  # whole rows, which is faster than number by number
        return values.index_select(1, index[0])
    index = index.reshape(*index.shape, *[1] * (values.ndim - 2)).expand(-1, -1, *values.shape[2:])
    return values.gather(1, index)


def spread_out(
    values: Float[Tensor, "B Q K"], index: Int64[Tensor, "B Q"], count: int
) -> Float[Tensor, "B N K"]:
    """The values at their columns of `count`, zero in the others."""
    empty = values.new_zeros(len(values), count, values.shape[2])
    if len(values) == 1:
        return empty.index_copy(1, index[0], values)
    return empty.scatter(1, index[..., None].expand_as(values), values)


def field_of_people(
    generator: AvatarGenerator,
    people: People,
    points: Float[Tensor, "B N 3"],
    canonical: Float[Tensor, "B N 3"],
    near: Int64[Tensor, "B N"],
    method: Literal["fast", "differentiable"] = "fast",
) -> tuple[Float[Tensor, "B N"], Float[Tensor, "B N K"]]:
    """Distance (or, of a density, the number that stands for it) and features at posed points and their
    canonical images, after the residual deformation; `GeometryConfig` says which of these are used. `near`
    are the points' nearest posed vertices.
    """
    geometry = generator.config.geometry
    moved = points if geometry.deformation == "residual" else canonical
    if geometry.deformation != "inverse_skinning":
        centered = generator.frame.centered(moved)
        moved = moved + generator.deformation(centered, people.w, people.pose, people.betas)
    on_posed = geometry.prior == "observed"
    body = people.observed.at(points, near) if on_posed else people.canonical.at(moved, near)
    if geometry.prior == "none":
        body = without_distance(body)
    base = without_distance(body) if geometry.distance == "raw" else None
    sdf, _, features = generator.field(people.planes, people.layers, moved, body, method, base)
    return sdf, features


def without_distance(body: BodyPoints) -> BodyPoints:
    """The same body points at distance zero: nothing is told of it, and nothing added to."""
    return BodyPoints(
        distance=torch.zeros_like(body.distance), vertices=body.vertices, barycentric=body.barycentric
    )
