"""What samples along rays cost and buy: picture error against time, with and without the shell.

Without it, a ray is sampled wherever it passes the box around the posed body, and every ray that does is
followed. The error is against the same picture at many samples within the same reach. Times are the
processor's, of rendering alone: posing the body and making the planes are the same for all.
"""

import time
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from avatargen.data.dataset import Pictures
from avatargen.generator.camera import camera_of_vector, rays
from avatargen.generator.generator import AvatarGenerator
from avatargen.generator.picture import CanonicalSurface, People, make_people, render
from avatargen.generator.renderer import Rendering
from avatargen.generator.shell import Shell, shell_around

STEPS = (12, 24, 36, 48)
MANY = 384  # samples a ray of the reference


@dataclass(frozen=True, kw_only=True)
class Cost:
    """One setting: means over pictures."""

    steps: int
    shell: bool
    seconds: float  # of the processor, a picture
    color: float  # mean absolute error of the raw colours, 0..1, over the whole picture
    mask: float  # of the coverage


@torch.no_grad()
def ray_costs(
    generator: AvatarGenerator, surface: CanonicalSurface, data: Pictures, pictures: int, seed: int = 0
) -> list[Cost]:
    """Every number of steps with and without the shell, on the first pictures' labels."""
    camera, pose, betas = data.row(torch.arange(pictures))
    draw = torch.Generator().manual_seed(seed)
    w = generator.mapping(torch.randn(pictures, generator.config.mapping.z_size, generator=draw), camera)
    people = make_people(generator, surface, w, generator.planes(w), pose, betas)
    size = generator.config.render.raw_size
    views = list(zip(*rays(camera_of_vector(camera), size), strict=True))
    settings = [(steps, shell) for steps in STEPS for shell in (True, False)]
    totals = {setting: torch.zeros(3, dtype=torch.float64) for setting in settings}
    for person, (origin, direction) in zip(people.parts, views, strict=True):
        view = (origin[None], direction[None])
        many, _ = timed(generator, person, view, MANY, shell=True)
        for steps, shell in settings:
            seen, seconds = timed(generator, person, view, steps, shell=shell)
            color, mask = (seen.features - many.features)[..., :3], seen.mask - many.mask  # white behind
            error = [seconds, float((color - mask[..., None]).abs().mean()), float(mask.abs().mean())]
            totals[steps, shell] += torch.tensor(error, dtype=torch.float64) / pictures
    return [
        Cost(steps=steps, shell=shell, seconds=float(t[0]), color=float(t[1]), mask=float(t[2]))
        for (steps, shell), t in totals.items()
    ]


def timed(
    generator: AvatarGenerator,
    person: People,
    view: tuple[Tensor, Tensor],
    steps: int,
    *,
    shell: bool,
) -> tuple[Rendering, float]:
    """One picture and the processor's seconds it took, the shell's making included."""
    settings = replace(generator.config.render, samples=steps)
    started = time.process_time()
    around = shell_around(person.posed.vertices, settings.shell)
    if not shell:
        around = Shell(box=around.box, marked=torch.ones_like(around.marked))
    seen = render(generator, person, view, None, settings=settings, shell=around)
    return seen, time.process_time() - started


def table(costs: list[Cost]) -> str:
    """Markdown."""
    lines = ["| steps | shell | CPU ms a picture | colour error | mask error |", "|---|---|---|---|---|"]
    lines += [
        f"| {c.steps} | {'yes' if c.shell else 'no'} "
        f"| {1000 * c.seconds:.0f} | {c.color:.4f} | {c.mask:.4f} |"
        for c in costs
    ]
    return "\n".join(lines)
