"""Warm start: regress the canonical fields of an endless stream of wardrobe people straight from z.

    z --wardrobe--> signed distance, colour at pool points      (the target)
    z --generator-> signed distance, colour at the same points  (the prediction)

Every step draws new people, seeded by (seed, step), so a resumed run continues with the same numbers. The checkpoint that ships
holds the exponential moving average of the weights.
"""

import copy
import io
import json
import math
import time
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

from avatargen.atomic import write_atomically
from avatargen.body.model import CanonicalBody
from avatargen.errors import TrainingError
from avatargen.generator.config import GeneratorConfig
from avatargen.generator.decoder import BodyPoints
from avatargen.generator.generator import AvatarGenerator
from avatargen.training.pool import cached_pool
from avatargen.wardrobe import MARKS
from avatargen.wardrobe.attributes import People, phenotype
from avatargen.wardrobe.chart import Places
from avatargen.wardrobe.layers import Layer
from avatargen.wardrobe.person import dress_up

HELD_OUT_SEED = 1_000_003  # first of the seeds no training step uses


@dataclass(frozen=True, kw_only=True)
class WarmStartConfig:
    """Settings of the warm start; lengths in steps unless said otherwise."""

    steps: int = 12_000
    people: int = 16  # a step
    points: int = 4096  # a person
    candidates: int = 2  # pool points looked at for each one kept
    learning_rate: float = 3e-3
    final_learning_rate: float = 5e-5
    warm_up: int = 100
    averaging: float = 0.998  # of the weights, a step
    distance_unit: float = 0.01  # m; a distance error of this size costs as much as a colour error of 1
    colour_weight: float = 1.5
    betas_weight: float = 0.02
    band: float = 0.02  # m around the surface where distances count in full
    colour_band: float = 0.012  # m around the surface where colours count
    pool: int = 3_000_000
    seed: int = 0
    save_every: int = 250
    report_every: int = 25


@dataclass(frozen=True, kw_only=True)
class Batch:
    """People with points and their targets."""

    people: People
    camera: Float[Tensor, "B 25"]
    places: Places
    target: Layer
    betas: Float[Tensor, "B b"]


@dataclass(frozen=True, kw_only=True)
class Errors:
    """Mean errors over a batch: distance (mm, within the band), colour (0..1, within the colour band), betas (0 mean square)."""

    distance_mm: float
    colour: float
    betas: float


class Stream:
    """Endless people: the batch of step s is a function of (seed, s) alone."""

    def __init__(self, pool: Places, config: WarmStartConfig) -> None:
        self.pool, self.config = pool, config
        with np.load(MARKS, allow_pickle=False) as marks:
            self.phenotype_to_betas = torch.from_numpy(marks["phenotype_to_betas"])

    def batch(self, step: int, people: int) -> Batch:
        """People, places near their surfaces, and targets."""
        random = torch.Generator().manual_seed((self.config.seed * 1_000_000_007 + step) % 2**63)
        z = torch.randn(people, 80, generator=random)
        drawn = People(z)
        count = self.config.points
        index = torch.randint(len(self.pool.p), (people, count * self.config.candidates), generator=random)
        places = self.pool[index]
        with torch.no_grad():
            target = dress_up(places, drawn)
            keep = near_surface(target.sdf, count, random)
            rows = torch.arange(people)[:, None]
            kept = Layer(sdf=target.sdf[rows, keep], color=target.color[rows, keep])
            body = phenotype(drawn)
            ones = torch.ones(people, 1)
            betas = (torch.cat([body, ones], dim=1) @ self.phenotype_to_betas.T).clamp(-2.8, 2.8)
        return Batch(people=drawn, camera=orbit_cameras(people, random), places=places[(rows, keep)], target=kept, betas=betas)


def near_surface(sdf: Float[Tensor, "B M"], count: int, random: torch.Generator) -> Int[Tensor, "B N"]:
    """Indices of `count` points a row, drawn without replacement, preferring those near the surface."""
    preference = -(sdf.abs() / 0.012).clamp(max=6)
    gumbel = -torch.log(-torch.log(torch.rand(sdf.shape, generator=random).clamp(1e-7, 1 - 1e-7)))
    return torch.topk(preference + gumbel, count, dim=1, sorted=False).indices


def orbit_cameras(people: int, random: torch.Generator, distance: float = 2.7) -> Float[Tensor, "B 25"]:
    """EG3D camera vectors all around the person. The fields must not depend on them, so every step draws new ones."""
    angle = torch.rand(people, generator=random) * 2 * math.pi
    sine, cosine, zero, one = angle.sin(), angle.cos(), torch.zeros(people), torch.ones(people)
    # OpenCV axes in columns: right, down, forward (to the origin), position
    rows = [cosine, zero, -sine, sine * distance, zero, -one, zero, zero, -sine, zero, -cosine, cosine * distance, zero, zero, zero, one]
    intrinsics = torch.tensor([2.0, 0, 0.5, 0, 2.0, 0.5, 0, 0, 1]).expand(people, -1)
    return torch.cat([torch.stack(rows, dim=1), intrinsics], dim=1)


def losses(
    generator: AvatarGenerator, batch: Batch, config: WarmStartConfig
) -> tuple[Float[Tensor, ""], Errors]:
    """The training loss and the plain errors behind it."""
    people, places, target = batch.people, batch.places, batch.target
    w = generator.mapping(people.z, batch.camera)
    planes = generator.planes(w)
    points = BodyPoints(distance=places.body, vertices=places.corners, barycentric=places.barycentric)
    sdf, color, _ = generator.field(planes, w, places.p, points)
    error = (sdf - target.sdf).abs()
    near = target.sdf.abs() < config.band
    weight = torch.where(near, 1.0, 0.15)
    painted = (target.sdf.abs() < config.colour_band).float()
    color_error = (color - target.color).abs().mean(-1)
    distance_loss = (error * weight).mean() / config.distance_unit
    color_loss = (color_error * painted).sum() / painted.sum().clamp(min=1)
    betas_loss = (generator.betas(w) - batch.betas).square().mean()
    loss = distance_loss + config.colour_weight * color_loss + config.betas_weight * betas_loss
    errors = Errors(
        distance_mm=1000 * float((error.detach() * near).sum() / near.sum().clamp(min=1)),
        colour=float(color_loss.detach()),
        betas=float(betas_loss.detach()),
    )
    return loss, errors


def learning_rate(step: int, config: WarmStartConfig) -> float:
    """Linear warm-up, then a cosine down to the final rate."""
    if step < config.warm_up:
        return config.learning_rate * (step + 1) / config.warm_up
    t = min(1.0, (step - config.warm_up) / max(1, config.steps - config.warm_up))
    return config.final_learning_rate + (config.learning_rate - config.final_learning_rate) * 0.5 * (1 + math.cos(math.pi * t))


def held_out(generator: AvatarGenerator, stream: Stream, config: WarmStartConfig, batches: int = 8) -> Errors:
    """Mean errors on people no training step has seen."""
    rows = []
    with torch.no_grad():
        for i in range(batches):
            rows.append(losses(generator, stream.batch(2**40 + HELD_OUT_SEED + i, config.people), config)[1])
    mean = {name: float(np.mean([getattr(row, name) for row in rows])) for name in vars(rows[0])}
    return Errors(**mean)


@dataclass
class State:
    """All that a run continues from."""

    step: int
    generator: AvatarGenerator
    average: AvatarGenerator
    optimizer: torch.optim.Adam


def new_state(config: GeneratorConfig, training: WarmStartConfig) -> State:
    """Freshly initialised networks, seeded."""
    torch.manual_seed(training.seed)
    generator = AvatarGenerator(config)
    optimizer = torch.optim.Adam(generator.parameters(), lr=training.learning_rate, betas=(0.9, 0.99))
    return State(step=0, generator=generator, average=copy.deepcopy(generator).eval(), optimizer=optimizer)


def save_state(state: State, path: Path) -> None:
    """Write the run's state, whole or not at all."""
    stream = io.BytesIO()
    content = {
        "step": state.step,
        "generator": state.generator.state_dict(),
        "average": state.average.state_dict(),
        "optimizer": state.optimizer.state_dict(),
    }
    torch.save(content, stream)
    write_atomically(path, stream.getvalue())


def restore(state: State, path: Path) -> None:
    """Continue from a saved state.

    Raises:
        TrainingError: the file is damaged or of another configuration.
    """
    try:
        content = torch.load(path, map_location="cpu", weights_only=True)
        state.generator.load_state_dict(content["generator"])
        state.average.load_state_dict(content["average"])
        state.optimizer.load_state_dict(content["optimizer"])
        state.step = int(content["step"])
    except (RuntimeError, KeyError, ValueError, EOFError, OSError) as error:
        raise TrainingError(f"warm start: {path} cannot be continued ({error}); name another folder") from error


def step_once(state: State, stream: Stream, config: WarmStartConfig) -> Errors:
    """One optimisation step.

    Raises:
        TrainingError: the loss is not finite; the last saved state is kept.
    """
    for group in state.optimizer.param_groups:
        group["lr"] = learning_rate(state.step, config)
    loss, errors = losses(state.generator, stream.batch(state.step, config.people), config)
    if not torch.isfinite(loss):
        raise TrainingError(f"warm start: loss {float(loss)} at step {state.step}; lower --learning-rate and run again")
    state.optimizer.zero_grad(set_to_none=True)
    loss.backward()
    torch.nn.utils.clip_grad_norm_(state.generator.parameters(), 10.0)
    state.optimizer.step()
    decay = min(config.averaging, (state.step + 1) / (state.step + 10))
    with torch.no_grad():
        for kept, new in zip(state.average.parameters(), state.generator.parameters(), strict=True):
            kept.lerp_(new, 1 - decay)
    state.step += 1
    return errors


def train(generator_config: GeneratorConfig, config: WarmStartConfig, body: CanonicalBody, out: Path) -> AvatarGenerator:
    """Run, or continue, the warm start in folder `out`; returns the averaged generator.

    Writes `state.pt` to continue from, `log.jsonl` with held-out errors, and `config.json`.
    """
    out.mkdir(parents=True, exist_ok=True)
    write_atomically(out / "config.json", json.dumps(asdict(config), indent=1).encode())
    stream = Stream(cached_pool(out / "pool.npz", body, config.pool, config.seed), config)
    state = new_state(generator_config, config)
    if (out / "state.pt").exists():
        restore(state, out / "state.pt")
    started, recent = time.monotonic(), []
    while state.step < config.steps:
        recent.append(step_once(state, stream, config))
        if state.step % config.report_every == 0:
            report(state.step, recent, time.monotonic() - started, config)
            recent = []
        if state.step % config.save_every == 0 or state.step == config.steps:
            errors = held_out(state.average, stream, config)
            save_state(state, out / "state.pt")
            with (out / "log.jsonl").open("a") as log:
                log.write(json.dumps({"step": state.step, "people": state.step * config.people, **asdict(errors)}) + "\n")
    return state.average


def report(step: int, recent: list[Errors], seconds: float, config: WarmStartConfig) -> None:
    """One progress line."""
    distance = np.mean([e.distance_mm for e in recent])
    colour = np.mean([e.colour for e in recent])
    print(f"step {step}/{config.steps}  {distance:.3f} mm  colour {colour:.4f}  {seconds:.0f} s", flush=True)
