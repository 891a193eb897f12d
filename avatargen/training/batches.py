"""The batches of adversarial training: real pictures, and what generated ones are asked by.

Everything random in a step is drawn from (seed, step) for the whole batch before it is divided among
processes: a resumed run, and one on more processes, sees the same numbers.

Letters: B pictures of a process, L length of a label.
"""

from collections.abc import Generator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor

from avatargen.data.dataset import Pictures
from avatargen.generator.room import Room
from avatargen.training.adversarial_config import AdversarialConfig
from avatargen.training.picture_model import Asked, PictureModel


@dataclass(frozen=True, kw_only=True)
class Batch:
    """What one process needs for a step: real pictures with labels, and which ones to generate."""

    real: Float[Tensor, "B 3 S S"]
    real_label: Float[Tensor, "B L"]
    asked: Asked

    @property
    def label(self) -> Float[Tensor, "B L"]:
        """Camera, pose and betas of the generated pictures, as the discriminator takes them."""
        asked = self.asked
        return torch.cat([asked.camera, asked.pose.flatten(1), asked.betas], dim=1)


def draw_batch(
    pictures: Pictures,
    config: AdversarialConfig,
    model: PictureModel,
    step: int,
    share: slice,
    room: Room | None = None,
) -> Batch:
    """The batch of a step, or a process's share of it; on the CPU. `room` is from the model's survey."""
    random = torch.Generator().manual_seed((config.seed * 1_000_000_007 + step) % 2**63)
    B = config.batch
    real, asked, swapped = pictures.choose((3, B), random)
    z, other_z = torch.randn(2, B, model.z_size, generator=random)
    swap = torch.rand(B, generator=random) < config.variety.camera_swap
    mix = float(torch.rand((), generator=random)) < config.variety.style_mixing and model.blocks > 1
    crossover = int(torch.randint(1, model.blocks, (), generator=random)) if mix else 0
    seeds = torch.randint(2**62, (B,), generator=random)[share]
    camera, pose, betas = pictures.row(asked[share])
    mapped = torch.where(swap[share, None], pictures.row(swapped[share])[0], camera)
    real_camera, real_pose, real_betas = pictures.row(real[share])
    return Batch(
        real=torch.stack([pictures.image(int(i)) for i in real[share]]),
        real_label=torch.cat([real_camera, real_pose.flatten(1), real_betas], dim=1),
        asked=Asked(
            z=z[share],
            other_z=other_z[share],
            crossover=crossover,
            camera=camera,
            mapped_camera=mapped,
            pose=pose,
            betas=betas,
            seeds=seeds,
            room=room,
        ),
    )


def batches(
    pictures: Pictures,
    config: AdversarialConfig,
    model: PictureModel,
    first: int,
    share: slice,
    room: Room | None = None,
) -> Generator[Batch, None, None]:
    """The batches from step `first` on; a thread draws the next one while one is in use."""
    with ThreadPoolExecutor(1) as ahead:

        def begin(step: int) -> Any:
            return ahead.submit(lambda: pinned(draw_batch(pictures, config, model, step, share, room)))

        step, coming = first, begin(first)
        while True:
            batch, step = coming.result(), step + 1
            coming = begin(step)
            yield batch


def pinned(batch: Batch) -> Batch:
    """The same in memory from which a GPU copies by itself, where there is one."""
    return map_tensors(batch, Tensor.pin_memory) if torch.cuda.is_available() else batch


def to_device(batch: Batch, device: torch.device) -> Batch:
    """The same on a device, without waiting for the copies."""
    return map_tensors(batch, lambda tensor: tensor.to(device, non_blocking=True))


def split(batch: Batch, size: int) -> list[Batch]:
    """The batch in parts of so many pictures."""
    places = [slice(first, first + size) for first in range(0, len(batch.real), size)]
    return [map_tensors(batch, lambda tensor, own=own: tensor[own]) for own in places]


def map_tensors(batch: Batch, change: Any) -> Batch:
    """The batch with each of its tensors changed."""

    def changed(part: Any) -> dict[str, Any]:
        return {name: change(value) for name, value in vars(part).items() if isinstance(value, Tensor)}

    return replace(batch, asked=replace(batch.asked, **changed(batch.asked)), **changed(batch))
