"""From people, poses and cameras to pictures (sections 3.3 and 3.4).

    rays --samples--> posed points --canonical map, deformation--> canonical points --field--> density,
    features
         --volume rendering--> feature picture --upsampling decoder--> picture

Letters: B pictures, r raw size, S final size, K features, N points.
"""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from avatargen.body.distance import BodyDistance
from avatargen.body.model import Body, PosedBody, canonical_body, pose, shape
from avatargen.generator.camera import Camera, rays
from avatargen.generator.canonical import canonical_map
from avatargen.generator.decoder import BodyPoints, attach_gradient, body_points
from avatargen.generator.generator import AvatarGenerator
from avatargen.generator.renderer import Rendering, Samples, box_interval, composite, stratify

BACKGROUND = 1.0  # white


@dataclass(frozen=True, kw_only=True)
class Picture:
    """The final picture and the raw ones: colours nominally 0..1 sRGB, depth in metres, mask 0..1."""

    image: Float[Tensor, "B 3 S S"]
    raw: Float[Tensor, "B 3 r r"]
    depth: Float[Tensor, "B r r"]
    mask: Float[Tensor, "B r r"]


class CanonicalSurface:
    """The canonical body as the field needs it: distances, faces and vertices. Built once per body."""

    def __init__(self, body: Body) -> None:
        canonical = canonical_body(body)
        self.body = body
        self.distance = BodyDistance(canonical.vertices, canonical.faces)
        self.faces = torch.from_numpy(canonical.faces)
        self.vertices = torch.from_numpy(canonical.vertices)

    def at(self, points: Float[Tensor, "N 3"]) -> BodyPoints:
        """The body at canonical points; its distance passes gradients on to the points."""
        hit = self.distance.query(points.detach().cpu().numpy())
        near = body_points(hit, self.faces.to(points.device))
        return attach_gradient(near, points[None], self.vertices.to(points.device))


@dataclass(frozen=True, kw_only=True)
class Person:
    """One person to render: style, planes, pose and shape (each a batch of one), and the posed body."""

    w: Float[Tensor, "1 D"]
    planes: Float[Tensor, "1 3 C R R"]
    pose: Float[Tensor, "1 J 3"]
    betas: Float[Tensor, "1 b"]
    posed: PosedBody


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
    size = generator.config.render.raw_size
    w = generator.mapping(z, camera.vector)
    planes = generator.planes(w)
    origins, directions = rays(camera, size)
    seen = []
    for i in range(len(z)):
        one = slice(i, i + 1)
        shaped = shape(surface.body, betas[i].detach().cpu().numpy())
        posed = pose(surface.body, shaped, poses[i].detach().cpu().numpy())
        person = Person(w=w[one], planes=planes[one], pose=poses[one], betas=betas[one], posed=posed)
        seen.append(render_person(generator, surface, person, (origins[i], directions[i]), draw))
    features = (
        torch.stack([rendering.features for rendering in seen]).transpose(1, 2).unflatten(2, (size, size))
    )
    mask = torch.stack([rendering.mask for rendering in seen]).unflatten(1, (size, size))
    depth = torch.stack([rendering.depth for rendering in seen]).unflatten(1, (size, size))
    raw = features[:, :3] + (1 - mask[:, None]) * BACKGROUND
    image = generator.upsampler(torch.cat([raw, features[:, 3:]], dim=1), w)
    return Picture(image=image, raw=raw, depth=depth, mask=mask)


def render_person(
    generator: AvatarGenerator,
    surface: CanonicalSurface,
    person: Person,
    ray: tuple[Float[Tensor, "P 3"], Float[Tensor, "P 3"]],
    draw: torch.Generator | None,
) -> Rendering:
    """Volume rendering of one person; only samples within the shell around the posed body are asked."""
    settings = generator.config.render
    origin, direction = ray
    vertices = person.posed.vertices
    box = np.stack([vertices.min(axis=0) - settings.shell, vertices.max(axis=0) + settings.shell])
    near, far = box_interval(origin, direction, torch.from_numpy(box).to(origin))
    samples = stratify(near, far, settings.samples, draw)
    points = (origin[:, None] + samples.depth[..., None] * direction[:, None]).flatten(0, 1)
    canonical, away = canonical_map(person.posed)(points, settings.nearest)
    inside = (away < settings.shell) & (samples.width > 0).repeat_interleave(settings.samples)
    sigma, features = ask(generator, surface, person, canonical[inside])
    return composite(
        scatter(sigma[:, None], inside, samples)[..., 0], scatter(features, inside, samples), samples, far
    )


def ask(
    generator: AvatarGenerator, surface: CanonicalSurface, person: Person, points: Float[Tensor, "N 3"]
) -> tuple[Float[Tensor, " N"], Float[Tensor, "N K"]]:
    """Density and features at canonical points, after the residual deformation."""
    centered = generator.frame.centered(points)[None]
    moved = points + generator.deformation(centered, person.w, person.pose, person.betas)[0]
    sdf, _, features = generator.field(person.planes, person.w, moved[None], surface.at(moved))
    return generator.density(sdf[0]), features[0]


def scatter(values: Float[Tensor, "n K"], inside: Tensor, samples: Samples) -> Float[Tensor, "P S K"]:
    """Values at the samples that were asked, zero at the others."""
    full = values.new_zeros(len(inside), values.shape[1])
    full = full.index_put((inside.nonzero()[:, 0],), values)
    return full.unflatten(0, tuple(samples.depth.shape))
