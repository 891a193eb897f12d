"""What a step of adversarial training costs: pictures a second, where the time goes, memory.

The pictures are noise and the labels those of `data synth`: a step's cost does not depend on what is seen.
A row's time by phase comes from steps of their own, in which every phase is waited for.
"""

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any
from unittest import mock

import numpy as np
import torch
from torch import Tensor

from avatargen.data.dataset import Pictures
from avatargen.data.labels import Labels
from avatargen.data.poses import random_pose
from avatargen.generator import picture, posing, surface
from avatargen.generator.generator import AvatarGenerator
from avatargen.generator.superresolution import Upsampler
from avatargen.training import adversarial, losses
from avatargen.training.adversarial import Run, step_once
from avatargen.training.adversarial_config import PRESETS, AdversarialConfig
from avatargen.training.adversarial_state import new_state
from avatargen.training.avatar_model import avatar_model
from avatargen.training.batches import draw_batch, to_device
from avatargen.training.discriminator import Discriminator
from avatargen.training.orbit import orbit_cameras

if TYPE_CHECKING:
    from avatargen.body.model import Body

LABELS = 64
PHASES: tuple[tuple[str, Any, str], ...] = (
    ("planes", AvatarGenerator, "planes"),
    ("posing", posing.Posing, "__call__"),
    ("shell", picture, "shell_around"),
    ("rays", picture, "shell_samples"),
    ("nearest vertices", posing.PosedBodies, "nearest"),
    ("body distance", surface.BodySurface, "at"),
    ("field", picture, "field_of_people"),
    ("rendering", picture, "composite"),
    ("upsampler", Upsampler, "forward"),
    ("discriminator", Discriminator, "forward"),
    ("R1", adversarial, "r1_penalty"),
    ("geometry losses", losses, "losses_of"),
    ("backward", Tensor, "backward"),
    ("optimisers", torch.amp.GradScaler, "step"),
)


@dataclass(frozen=True, kw_only=True)
class TrainingRow:
    """One setting's cost. Seconds of a step by phase leave out the phases within; `rest` is what is left."""

    preset: str
    device: str
    precision: str
    batch: int
    at_once: int
    raw_size: int
    samples: int
    pictures_a_second: float
    seconds: float  # of a step
    user_seconds: float  # of the processor, in a step
    gigabytes: float  # the most that was held on a GPU
    phases: dict[str, float]


@dataclass(frozen=True, kw_only=True, eq=False)
class NoisePictures(Pictures):
    """Pictures of noise, in memory."""

    def image(self, index: int) -> Tensor:
        random = torch.Generator().manual_seed(index)
        return torch.rand(3, self.size, self.size, generator=random)


def noise_pictures(body: "Body", size: int) -> NoisePictures:
    """Poses as people take them, from all around."""
    rng, random = np.random.default_rng(0), torch.Generator().manual_seed(0)
    labels = Labels(
        names=tuple(str(i) for i in range(LABELS)),
        camera=orbit_cameras(LABELS, random).numpy(),
        pose=np.stack([random_pose(body.joint_names, rng) for _ in range(LABELS)]),
        betas=rng.normal(size=(LABELS, body.shapedirs.shape[2])).astype(np.float32),
    )
    return NoisePictures(folder=Path("noise"), labels=labels, size=size)


def measure_training(
    name: str, config: AdversarialConfig, body: "Body", device: torch.device, steps: int, warm: int = 2
) -> TrainingRow:
    """Steps of a fresh run."""
    from accelerate import Accelerator

    if device.type == "cuda":
        torch.set_float32_matmul_precision("high")
        torch.cuda.reset_peak_memory_stats()
    model, data = avatar_model(config, body), noise_pictures(body, config.render.image_size)
    state = new_state(config, model, data.labels.rows().shape[1], device)
    run = Run(config=config, accelerator=Accelerator(cpu=device.type == "cpu"))
    room = model.survey(data.row(torch.arange(len(data))))
    whole = slice(0, config.batch)
    batch = to_device(draw_batch(data, config, model, 1, whole, room), device)
    for step in range(warm):
        step_once(state, run, batch, step)  # the first with R1
    waited(device)
    started, processor = time.perf_counter(), time.process_time()
    for step in range(1, steps + 1):
        step_once(state, run, batch, step)
    waited(device)
    seconds = (time.perf_counter() - started) / steps
    processor = (time.process_time() - processor) / steps
    with phases(device) as times:
        step_once(state, run, batch, 1)
    held = torch.cuda.max_memory_allocated() / 1e9 if device.type == "cuda" else 0.0
    return TrainingRow(
        preset=name,
        device=torch.cuda.get_device_name() if device.type == "cuda" else "CPU",
        precision=config.precision,
        batch=config.batch,
        at_once=config.at_once or config.batch,
        raw_size=config.render.raw_size,
        samples=config.render.samples,
        pictures_a_second=config.batch / seconds,
        seconds=seconds,
        user_seconds=processor,
        gigabytes=held,
        phases=times,
    )


def waited(device: torch.device) -> float:
    """The time when all that was begun on a device is done."""
    if device.type == "cuda":
        torch.cuda.synchronize()
    return time.perf_counter()


@contextmanager
def phases(device: torch.device) -> Iterator[dict[str, float]]:
    """Seconds by phase of what runs inside, each without the phases within it."""
    times: dict[str, float] = {name: 0.0 for name, _, _ in PHASES} | {"rest": 0.0}
    names, since = ["rest"], [waited(device)]

    def turn_to(now: float) -> None:
        times[names[-1]] += now - since[0]
        since[0] = now

    def timed(name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        def call(*args: Any, **kwargs: Any) -> Any:
            turn_to(waited(device))
            names.append(name)
            try:
                return function(*args, **kwargs)
            finally:
                turn_to(waited(device))
                names.pop()

        return call

    with ExitStack() as patches:
        for name, owner, attribute in PHASES:
            patches.enter_context(mock.patch.object(owner, attribute, timed(name, getattr(owner, attribute))))
        yield times
        turn_to(waited(device))


def training_rows(
    body: "Body", names: Sequence[str], device: torch.device, steps: int, *, grow: bool
) -> Iterator[TrainingRow]:
    """Every preset as it is, with `grow` also with other batches, rays, samples and precisions."""
    for name in names:
        base = PRESETS[name]
        settings = [base]
        if grow:
            render = base.render
            settings += [replace(base, batch=2 * base.batch)]
            settings += [replace(base, render=replace(render, samples=2 * render.samples))]
            if render.raw_size < render.image_size:
                settings += [replace(base, render=replace(render, raw_size=2 * render.raw_size))]
            if device.type == "cuda":
                settings += [replace(base, precision="no" if base.precision != "no" else "bf16")]
        for config in settings:
            yield measure_training(name, config, body, device, steps)
            if device.type == "cuda":
                torch.cuda.empty_cache()


def training_table(rows: list[TrainingRow]) -> str:
    """Markdown: a line a setting."""
    lines = [
        "| preset | device | precision | batch (at once) | rays | samples | pictures/s | s a step | GB |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    lines += [
        f"| {r.preset} | {r.device} | {r.precision} | {r.batch} ({r.at_once}) | {r.raw_size}² | {r.samples} "
        f"| {r.pictures_a_second:.3g} | {r.seconds:.3g} | {r.gigabytes:.1f} |"
        for r in rows
    ]
    names = list(rows[0].phases) if rows else []
    lines += ["", "| milliseconds by phase | " + " | ".join(names) + " |", "|---" * (len(names) + 1) + "|"]
    lines += [
        f"| {r.preset}, {r.precision}, {r.batch} x {r.raw_size}² x {r.samples} | "
        + " | ".join(f"{1000 * r.phases[name]:.1f}" for name in names)
        + " |"
        for r in rows
    ]
    return "\n".join(lines) + "\n"
