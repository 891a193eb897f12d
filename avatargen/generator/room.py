"""How many rays and samples pictures take: found before training, so that no step asks a device for counts.

Letters: N labels.
"""

import math
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from avatargen.generator.camera import camera_of_vector, rays
from avatargen.generator.config import RenderConfig
from avatargen.generator.shell import shell_around, shell_samples
from avatargen.generator.surface import CanonicalSurface

SPARE, ROUND = 1.03, 64  # of room: times what was found, up to whole groups
MOST_SURVEYED, SURVEYED = 8192, 16  # labels, in all and at once


@dataclass(frozen=True, kw_only=True)
class Room:
    """Bounds on the rays of a picture that meet the shell, and on the samples within its reach."""

    rays: int
    samples: int


@torch.no_grad()
def survey(
    settings: RenderConfig,
    surface: CanonicalSurface,
    labels: tuple[Float[Tensor, "N 25"], Float[Tensor, "N J 3"], Float[Tensor, "N b"]],
    device: torch.device,
) -> Room:
    """The most that a picture of these cameras, poses and betas takes, and some; of many labels a part of
    them is asked. Samples stand in the middle of their bins.
    """
    count = len(labels[0])
    asked = torch.linspace(0, count - 1, min(count, MOST_SURVEYED)).long()
    most = torch.zeros(2, dtype=torch.long, device=device)
    for some in asked.split(SURVEYED):
        camera, poses, betas = (part[some].to(device) for part in labels)
        posed = surface.posing(device)(betas, poses)
        shell = shell_around(posed.vertices, settings.shell)
        origin, direction = rays(camera_of_vector(camera), settings.raw_size)
        samples, _ = shell_samples(shell, origin, direction, settings.samples)
        meets = samples.length.any(dim=2)
        points = origin[:, :, None] + samples.depth[..., None] * direction[:, :, None]
        within = posed.nearest(points.flatten(1, 2))[0][..., 0] < settings.shell
        near = (within.view_as(samples.depth) & meets[..., None]).sum(dim=(1, 2))
        most = torch.maximum(most, torch.stack([meets.sum(dim=1).amax(), near.amax()]))
    hit, near = most.tolist()
    every = settings.raw_size**2
    hit = min(every, math.ceil(hit * SPARE / ROUND) * ROUND)
    return Room(rays=hit, samples=min(hit * settings.samples, math.ceil(near * SPARE / ROUND) * ROUND))
