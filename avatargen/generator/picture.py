"""From people, poses and cameras to pictures (sections 3.3 and 3.4).

    rays --shell--> posed points --canonical map, deformation--> canonical points --field--> density, features
         --volume rendering--> feature picture --upsampling decoder--> picture

Letters: B pictures, r raw size, S final size, K features, N points.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

from avatargen.body.distance import BodyDistance
from avatargen.body.model import Body, PosedBody, pose, pose_canonically, shape
from avatargen.generator.camera import Camera, rays
from avatargen.generator.canonical import CanonicalMap, canonical_map
from avatargen.generator.config import RenderConfig
from avatargen.generator.decoder import BodyPoints, PartLayers, attach_gradient, body_points
from avatargen.generator.generator import AvatarGenerator
from avatargen.generator.renderer import Rendering, Samples, composite
from avatargen.generator.shell import Shell, shell_around, shell_samples

BACKGROUND = 1.0  # white


@dataclass(frozen=True, kw_only=True)
class Picture:
    """The final picture and the raw ones: colours nominally 0..1 sRGB, depth in metres, mask 0..1."""

    image: Float[Tensor, "B 3 S S"]
    raw: Float[Tensor, "B 3 r r"]
    depth: Float[Tensor, "B r r"]
    mask: Float[Tensor, "B r r"]


class BodySurface:
    """A body's surface as the field needs it: distances, faces and vertices."""

    def __init__(self, body: PosedBody) -> None:
        self.distance = BodyDistance(body.vertices.astype(np.float32), body.shaped.body.faces)
        self.faces = torch.from_numpy(body.shaped.body.faces)
        self.vertices = torch.from_numpy(self.distance.vertices).float()

    def at(self, points: Float[Tensor, "N 3"]) -> BodyPoints:
        """The body at points of its space; its distance passes gradients on to the points."""
        hit = self.distance.query(points.detach().cpu().numpy())
        near = body_points(hit, self.faces.to(points.device))
        return attach_gradient(near, points[None], self.vertices.to(points.device))


class CanonicalSurface(BodySurface):
    """The surface of the canonical body. Built once per body."""

    def __init__(self, body: Body) -> None:
        self.canonical = pose_canonically(body)
        super().__init__(self.canonical)
        self.body = body


@dataclass(frozen=True, kw_only=True)
class Person:
    """One person to render: style, planes, decoder layers, pose and shape (each a batch of one), and the
    posed body.
    """

    w: Float[Tensor, "1 D"]
    planes: Float[Tensor, "1 3 C R R"]
    layers: tuple[PartLayers, ...]
    pose: Float[Tensor, "1 J 3"]
    betas: Float[Tensor, "1 b"]
    posed: PosedBody
    map: CanonicalMap

    @cached_property
    def observed(self) -> BodySurface:
        """The posed body's surface."""
        return BodySurface(self.posed)


def take_picture(
    generator: AvatarGenerator,
    surface: CanonicalSurface,
    z: Float[Tensor, "B Z"],
    camera: Camera,
    poses: Float[Tensor, "B J 3"],
    betas: Float[Tensor, "B b"],
    draw: torch.Generator | None = None,
) -> Picture:
    """Render people: latent, camera, axis-angle pose (radians) and shape to pictures.

    Samples are drawn at random along the rays with `draw`, and stand in the middle of their bins without.
    """
    w = generator.mapping(z, camera.vector)
    people = make_people(generator, surface, w, generator.planes(w), poses, betas)
    return picture_people(generator, surface, people, camera, [draw] * len(people))


def make_people(
    generator: AvatarGenerator,
    surface: CanonicalSurface,
    w: Float[Tensor, "B D"],
    planes: Float[Tensor, "B 3 C R R"],
    poses: Float[Tensor, "B J 3"],
    betas: Float[Tensor, "B b"],
) -> list[Person]:
    """Pose everybody's body. The pose and shape that pictures show carry no gradient. Networks made for fewer
    directions of shape than the body has are told the first of them."""
    people, told = [], (0, generator.config.shape_count - betas.shape[1])
    with torch.autocast(w.device.type, enabled=False):
        parts = [layers.of_each(len(w)) for layers in generator.layers(w)]
    for i, layers in enumerate(zip(*parts, strict=True)):
        one = slice(i, i + 1)
        shaped = shape(surface.body, betas[i].detach().cpu().numpy())
        posed = pose(surface.body, shaped, poses[i].detach().cpu().numpy())
        people.append(
            Person(
                w=w[one],
                planes=planes[one],
                layers=layers,
                pose=poses[one],
                betas=torch.nn.functional.pad(betas[one], told),
                posed=posed,
                map=canonical_map(posed, surface.canonical),
            )
        )
    return people


def picture_people(
    generator: AvatarGenerator,
    surface: CanonicalSurface,
    people: Sequence[Person],
    camera: Camera,
    draws: Sequence[torch.Generator | None],
) -> Picture:
    """A picture of each person by a camera each; `draws` place the samples, see `take_picture`."""
    size = generator.config.render.raw_size
    origins, directions = rays(camera, size)
    with torch.autocast(origins.device.type, enabled=False):  # distances need all their digits
        seen = [
            render_person(generator, surface, person, (origin, direction), draw)
            for person, origin, direction, draw in zip(people, origins, directions, draws, strict=True)
        ]
    features = torch.stack([r.features for r in seen]).transpose(1, 2).unflatten(2, (size, size))
    mask = torch.stack([r.mask for r in seen]).unflatten(1, (size, size))
    depth = torch.stack([r.depth for r in seen]).unflatten(1, (size, size))
    raw = features[:, :3] + (1 - mask[:, None]) * BACKGROUND
    w = torch.cat([person.w for person in people])
    image = generator.upsampler(torch.cat([raw, features[:, 3:]], dim=1), w)
    return Picture(image=image, raw=raw, depth=depth, mask=mask)


def render_person(
    generator: AvatarGenerator,
    surface: CanonicalSurface,
    person: Person,
    ray: tuple[Float[Tensor, "P 3"], Float[Tensor, "P 3"]],
    draw: torch.Generator | None,
    settings: RenderConfig | None = None,
    shell: Shell | None = None,
) -> Rendering:
    """Volume rendering of one person; only samples within the shell around the posed body are asked.

    Other settings and another shell than the generator's own can be given, to measure what they change.
    """
    settings = settings or generator.config.render
    origin, direction = ray
    shell = shell or shell_around(person.posed.vertices, settings.shell, origin.device)
    samples, far = shell_samples(shell, origin, direction, settings.samples, draw)
    hit = samples.length.any(dim=1).nonzero()[:, 0]  # rays that miss cost nothing from here on
    samples = Samples(depth=samples.depth[hit], length=samples.length[hit])
    points = (origin[hit, None] + samples.depth[..., None] * direction[hit, None]).flatten(0, 1)
    canonical, away = person.map(points, settings.nearest)
    near = (away < settings.shell).nonzero()[:, 0]
    sdf, features = field_of_person(generator, surface, person, points[near], canonical[near])
    distance = away.to(sdf).index_put((near,), sdf)  # beyond the shell there is nothing but distance
    features = scatter(features, near, len(points))
    shape = samples.depth.shape
    seen = composite(distance.view(shape), features.view(*shape, -1), samples, far[hit], generator.density)
    return Rendering(
        features=scatter(seen.features, hit, len(far)),
        depth=far.index_put((hit,), seen.depth),
        mask=scatter(seen.mask[:, None], hit, len(far))[:, 0],
    )


def field_of_person(
    generator: AvatarGenerator,
    surface: CanonicalSurface,
    person: Person,
    points: Float[Tensor, "N 3"],
    canonical: Float[Tensor, "N 3"],
    method: Literal["fast", "differentiable"] = "fast",
) -> tuple[Float[Tensor, " N"], Float[Tensor, "N K"]]:
    """Distance (or, of a density, the number that stands for it) and features at posed points and their
    canonical images, after the residual deformation; `GeometryConfig` says which of these are used.
    """
    geometry = generator.config.geometry
    moved = points if geometry.deformation == "residual" else canonical
    if geometry.deformation != "inverse_skinning":
        centered = generator.frame.centered(moved)[None]
        moved = moved + generator.deformation(centered, person.w, person.pose, person.betas)[0]
    body = person.observed.at(points) if geometry.prior == "observed" else surface.at(moved)
    if geometry.prior == "none":
        body = without_distance(body)
    base = without_distance(body) if geometry.distance == "raw" else None
    sdf, _, features = generator.field(person.planes, person.layers, moved[None], body, method, base)
    return sdf[0], features[0]


def without_distance(body: BodyPoints) -> BodyPoints:
    """The same body points at distance zero: nothing is told of it, and nothing added to."""
    return BodyPoints(
        distance=torch.zeros_like(body.distance), vertices=body.vertices, barycentric=body.barycentric
    )


def scatter(values: Float[Tensor, "n K"], row: Int[Tensor, " n"], count: int) -> Float[Tensor, "N K"]:
    """The values at their rows of `count`, zero in the others."""
    return values.new_zeros(count, values.shape[1]).index_put((row,), values)
