"""Before the fields: the mapping network learns to say what meets the eye of a person.

Points teach the conjunctions in the coding slowly (a full beard is three coordinates of z, and shows at few
points of one person in sixteen); traits teach them by thousands of people a step, for they need no points.

Letters: B people, D size of w, T traits.
"""

import math
from collections.abc import Callable

import torch
from jaxtyping import Float
from torch import Tensor

from avatargen.generator.mapping import Mapping
from avatargen.training.orbit import orbit_cameras
from avatargen.wardrobe.attributes import LATENT_SIZE, People
from avatargen.wardrobe.traits import traits

PEOPLE = 2048  # a step
LEARNING_RATE = 0.1  # equalised weights of a conjunction have far to go
RAREST = 0.2  # standard deviation under which a trait counts no more for being rare
WARM_UP = 30
REPORT_EVERY = 100


def learn_traits(mapping: Mapping, steps: int, seed: int, report: Callable[[str], None]) -> None:
    """Fit the first numbers of w to the traits, as many as w has room for, in place.

    `report` takes a progress line now and then.
    """
    size = mapping.config.w_size
    spread = traits(draw(PEOPLE, seed, -1)[0])[:, :size].std(dim=0).clamp_min(RAREST)
    optimizer = torch.optim.Adam(mapping.parameters(), lr=LEARNING_RATE, betas=(0.9, 0.99))
    for step in range(steps):
        for group in optimizer.param_groups:
            group["lr"] = LEARNING_RATE * min(1, (step + 1) / WARM_UP) * cosine(step / steps)
        people, cameras = draw(PEOPLE, seed, step)
        said = mapping(people.z, cameras)[:, : len(spread)]
        loss = ((said - traits(people)[:, :size]) / spread).square().mean()
        optimizer.zero_grad(set_to_none=True)
        loss.backward()
        optimizer.step()
        if (step + 1) % REPORT_EVERY == 0:
            report(f"traits {step + 1}/{steps}  unexplained {float(loss.detach()):.3f}")


def cosine(share: float) -> float:
    """From 1 at the start to 0.02 at the end."""
    return 0.02 + 0.98 * 0.5 * (1 + math.cos(math.pi * share))


def draw(count: int, seed: int, step: int) -> tuple[People, Float[Tensor, "B 25"]]:
    """People of a step, with cameras all around them."""
    random = torch.Generator().manual_seed((seed * 1_000_003 + step) % 2**63)
    return People(torch.randn(count, LATENT_SIZE, generator=random)), orbit_cameras(count, random)
