"""What a step of adversarial training takes of a GPU, counted where there is none.

A step runs on tensors without numbers, and every operation is counted: its multiplications and additions
(those of matrix products and convolutions), and the bytes of what it reads and writes. An operation takes at
least as long as either needs at an H100's peak, and the sum is the least that a step can take: the roofline.
Searches for nearest vertices and closest faces are kernels of their own, and counted by their pairs.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any
from unittest import mock

import torch
from torch import Tensor
from torch.utils._python_dispatch import TorchDispatchMode
from torch.utils._pytree import tree_flatten
from torch.utils.flop_counter import flop_registry

from avatargen.commands.bench.training import noise_pictures
from avatargen.generator import closest, posing
from avatargen.generator.room import survey
from avatargen.training.adversarial import Run, step_once
from avatargen.training.adversarial_config import AdversarialConfig
from avatargen.training.adversarial_state import new_state
from avatargen.training.avatar_model import avatar_model
from avatargen.training.batches import draw_batch, to_device

if TYPE_CHECKING:
    from avatargen.body.model import Body

# an H100's, dense: convolutions in bf16, products of matrices in TF32, others in float32; bytes a second
PEAK = {"convolution": 989e12, "product": 495e12, "other": 67e12}
BANDWIDTH = 3.35e12
PAIR = 10  # operations for a point and a vertex
SURVEYED = 4  # labels that say how many rays and samples there are: on a CPU that takes seconds each
FACE, FACES = 90, 500  # operations for a point and a face, and faces that are not ruled out


@dataclass(frozen=True, kw_only=True)
class StepCost:
    """A step's operations and bytes, and the least seconds that they take."""

    preset: str
    batch: int
    teraflops: float
    gigabytes: float
    calls: int
    seconds: float


class Counting(TorchDispatchMode):
    """Adds up what is called while it is on."""

    def __init__(self) -> None:
        super().__init__()
        self.flops, self.bytes, self.seconds, self.calls = 0.0, 0, 0.0, 0

    def __torch_dispatch__(self, func: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        out = func(*args, **(kwargs or {}))
        returns = func._schema.returns
        view = returns and returns[0].alias_info and not returns[0].alias_info.is_write
        if not view and not func.__name__.startswith(("empty", "new_empty")):
            tensors = [part for part in tree_flatten((args, kwargs, out))[0] if isinstance(part, Tensor)]
            count = flop_registry.get(func._overloadpacket)
            flops = float(count(*args, **(kwargs or {}), out_val=out)) if count else 0.0
            kind = "convolution" if "conv" in func.__name__ else "product" if flops else "other"
            self.add(flops, sum(t.numel() * t.element_size() for t in tensors), kind)
        return out

    def add(self, flops: float, size: int, kind: str) -> None:
        self.flops, self.bytes, self.calls = self.flops + flops, self.bytes + size, self.calls + 1
        self.seconds += max(flops / PEAK[kind], size / BANDWIDTH)


def step_cost(name: str, config: AdversarialConfig, body: "Body") -> StepCost:
    """A step without R1, which comes once in `r1_every`."""
    meta = torch.device("meta")
    model, data = avatar_model(config, body), noise_pictures(body, config.render.image_size)
    labels = data.row(torch.arange(SURVEYED))
    room = survey(config.render, model.surface, labels, torch.device("cpu"))
    state = new_state(config, model, data.labels.rows().shape[1], meta)
    accelerator = SimpleNamespace(device=meta, num_processes=1, is_main_process=True)
    plain = replace(config, precision="no")  # tensors without numbers have no autocast
    run = Run(config=plain, accelerator=accelerator)  # pyright: ignore[reportArgumentType]
    batch = to_device(draw_batch(data, config, model, 1, slice(0, config.batch), room), meta)
    with Counting() as counting, kernels(counting):
        step_once(state, run, batch, 1)
    return StepCost(
        preset=name,
        batch=config.batch,
        teraflops=counting.flops / 1e12,
        gigabytes=counting.bytes / 1e9,
        calls=counting.calls,
        seconds=counting.seconds,
    )


@contextmanager
def kernels(counting: Counting) -> Iterator[None]:
    """Searches cost what their kernels do, and find nothing."""

    def nearest(posed: posing.PosedBodies, points: Tensor, count: int = 1) -> tuple[Tensor, Tensor]:
        pairs = points.shape[0] * points.shape[1] * posed.vertices.shape[1]
        counting.add(float(PAIR * pairs * count), points.numel() * 4, "other")
        shape = (*points.shape[:2], count)
        empty = points.new_zeros(shape)
        return empty, torch.zeros(shape, dtype=torch.long, device=points.device)

    def search(surfaces: closest.Surfaces, points: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        counting.add(float(FACE * FACES * points.shape[0] * points.shape[1]), points.numel() * 4, "other")
        share = points.new_zeros(points.shape[:2])
        return torch.zeros(points.shape[:2], dtype=torch.long, device=points.device), share, share

    with (
        mock.patch.object(posing.PosedBodies, "nearest", nearest),
        mock.patch.object(closest, "search_all", search),
    ):
        yield


def cost_table(costs: list[StepCost]) -> str:
    """Markdown: a line a preset."""
    lines = [
        "| preset | batch | TFLOP a step | GB a step | operations | least s a step on an H100 | pictures/s |",
        "|---|---|---|---|---|---|---|",
    ]
    lines += [
        f"| {c.preset} | {c.batch} | {c.teraflops:.2f} | {c.gigabytes:.0f} | {c.calls} | {c.seconds:.3f} "
        f"| {c.batch / c.seconds:.0f} |"
        for c in costs
    ]
    return "\n".join(lines) + "\n"
