"""Warm start: regress the canonical fields of an endless stream of wardrobe people straight from z.

    z --wardrobe--> traits                                      (first, the target of the mapping network)
    z --wardrobe--> signed distance, colour at pool points      (the target)
    z --generator-> signed distance, colour at the same points  (the prediction)

Every step draws new people, seeded by (seed, step), so a resumed run continues with the same numbers. The
checkpoint that ships holds the exponential moving average of the weights.
"""

import copy
import io
import json
import math
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from pickle import UnpicklingError
from typing import Any

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

from avatargen.atomic import write_atomically
from avatargen.body.model import CanonicalBody
from avatargen.errors import InputError, TrainingError
from avatargen.generator.checkpoint import save_checkpoint
from avatargen.generator.config import GeneratorConfig
from avatargen.generator.decoder import BodyPoints, fit_reach
from avatargen.generator.generator import AvatarGenerator
from avatargen.ranges import MANY, Range, require_ranges
from avatargen.run_folder import claim, cut_log, digest_arrays
from avatargen.training.learn_traits import learn_traits
from avatargen.training.orbit import orbit_cameras
from avatargen.training.pool import cached_pool, hangs
from avatargen.wardrobe import garments
from avatargen.wardrobe.attributes import CODING, LATENT_SIZE, People
from avatargen.wardrobe.chart import Places
from avatargen.wardrobe.layers import Layer
from avatargen.wardrobe.person import dress_up
from avatargen.wardrobe.stature import Sizing

OFF_BODY = 0.02  # m from the body where vertex features and the densest part of the pool end
# how long to train and how often to tell of it; the learning rate falls by the length that is given last
MAY_CHANGE = tuple(f"training.{name}" for name in ("steps", "save_every", "report_every"))
HELD_OUT_STEP = 2**40  # first of the steps that no training reaches


RANGES: dict[str, Range] = {
    "steps": (0, MANY),
    "trait_steps": (0, MANY),
    "people": (1, 100_000),
    "points": (1, 1_000_000),
    "candidates": (1, 1000),
    "skirts": (0, 1),
    "searched": (1, 1_000_000),
    "learning_rate": (1e-12, 10),
    "final_learning_rate": (0, 1),
    "field_rate": (1e-6, 1e6),
    "warm_up": (0, MANY),
    "averaging": (0, 1),
    "distance_unit": (1e-6, 1e6),
    "colour_weight": (0, 1e6),
    "betas_weight": (0, 1e6),
    "band": (1e-6, 10),
    "colour_band": (1e-6, 10),
    "pool": (1000, 100_000_000),
    "seed": (0, MANY),
    "held_out_batches": (1, MANY),
    "save_every": (1, MANY),
    "report_every": (1, MANY),
}


@dataclass(frozen=True, kw_only=True)
class WarmStartConfig:
    """Settings of the warm start; lengths in steps unless said otherwise."""

    steps: int = 6000
    trait_steps: int = 1400  # of the mapping network alone, before; 0 or weights to start from: none
    people: int = 64  # a step; variety of people teaches more than points of each
    points: int = 480  # a person
    candidates: int = 2  # pool points looked at for each one kept
    skirts: float = (
        0.25  # share of people drawn in skirts, the hardest to learn, beside those who choose them
    )
    searched: int = 4096  # pool points off the body looked at for each person whose cloth hangs there
    learning_rate: float = 2.5e-3
    final_learning_rate: float = 0.02  # of the first one
    field_rate: float = 3.0  # learning rate of mapping and decoder over that of planes and vertex features
    warm_up: int = 40
    averaging: float = 0.998  # of the weights, a step
    distance_unit: float = 0.01  # m; a distance error of this size costs as much as a colour error of 1
    colour_weight: float = 1.5
    betas_weight: float = 0.02
    band: float = 0.02  # m around the surface where distances count in full
    colour_band: float = 0.012  # m around the surface where colours count
    pool: int = 3_000_000
    seed: int = 0
    held_out_batches: int = 8
    save_every: int = 250
    report_every: int = 25

    def __post_init__(self) -> None:
        require_ranges(self, "warm start", RANGES)
        wanted = self.points * self.candidates // 2  # half of a person's points, where cloth hangs free
        if self.searched < wanted:
            raise InputError(
                f"warm start: found searched {self.searched}, wanted {wanted} or more, half of points times "
                "candidates; raise it or lower them"
            )
        if self.people * self.points * self.candidates > MANY:
            raise InputError("warm start: people, points and candidates make too many; lower one of them")


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
    """Mean errors over a batch: distance (mm, within the band), colour (0..1, within the colour
    band), betas (0 mean square).
    """

    distance_mm: float
    colour: float
    betas: float


class Stream:
    """Endless people: the batch of step s is a function of (seed, s) alone."""

    def __init__(self, pool: Places, config: WarmStartConfig, body: CanonicalBody) -> None:
        self.pool, self.config, self.sizing = pool, config, Sizing(body.source)
        self.off_body = torch.nonzero(hangs(pool.p) & (pool.body > OFF_BODY))[:, 0]

    def batch(self, step: int, people: int, skirts: float = 0.0) -> Batch:
        """People, a share of them in skirts whatever they draw, places near their surfaces, and targets."""
        random = torch.Generator().manual_seed((self.config.seed * 1_000_000_007 + step) % 2**63)
        z = torch.randn(people, LATENT_SIZE, generator=random)
        drawn = People(z).choosing(slice(round(skirts * people)), *garments.SKIRT)
        count = self.config.points
        index = torch.randint(len(self.pool.p), (people, count * self.config.candidates), generator=random)
        with torch.no_grad():
            self.search_free_cloth(index, drawn, random)
            places = self.pool[index]
            target = dress_up(places, drawn)
            keep = near_surface(target.sdf, count, random)
            rows = torch.arange(people)[:, None]
            kept = Layer(sdf=target.sdf[rows, keep], color=target.color[rows, keep])
            betas = self.sizing.betas(drawn)
        return Batch(
            people=drawn,
            camera=orbit_cameras(people, random),
            places=places[(rows, keep)],
            target=kept,
            betas=betas,
        )

    def search_free_cloth(self, index: Int[Tensor, "B M"], people: People, random: torch.Generator) -> None:
        """Cloth off the body, which few points of the pool meet, gets half of its wearer's points."""
        rows = torch.nonzero((garments.has_skirt(people) + garments.has_coat(people))[:, 0])[:, 0]
        drawn = torch.randint(len(self.off_body), (len(rows), self.config.searched), generator=random)
        found = self.off_body[drawn]
        sdf = garments.free_cloth(self.pool.p[found], People(people.z[rows]))
        keep = near_surface(sdf, index.shape[1] // 2, random)
        index[rows, : keep.shape[1]] = found.gather(1, keep)


def near_surface(sdf: Float[Tensor, "B M"], count: int, random: torch.Generator) -> Int[Tensor, "B N"]:
    """Indices of `count` points a row, drawn without replacement, preferring those near the surface."""
    preference = -(sdf.abs() / 0.012).clamp(max=6)
    gumbel = -torch.log(-torch.log(torch.rand(sdf.shape, generator=random).clamp(1e-7, 1 - 1e-7)))
    return torch.topk(preference + gumbel, count, dim=1, sorted=False).indices


def losses(
    generator: AvatarGenerator, batch: Batch, config: WarmStartConfig
) -> tuple[Float[Tensor, ""], Errors]:
    """The training loss and the plain errors behind it."""
    people, places, target = batch.people, batch.places, batch.target
    w = generator.mapping(people.z, batch.camera)
    planes = generator.planes(w)
    points = BodyPoints(distance=places.body, vertices=places.corners, barycentric=places.barycentric)
    sdf, color, _ = generator.field(planes, generator.layers(w), places.p, points)
    error = (sdf - target.sdf).abs()
    near = target.sdf.abs() < config.band
    weight = torch.where(near, 1.0, 0.15)
    painted = (target.sdf.abs() < config.colour_band).float()
    color_error = (color - target.color).abs().mean(-1)
    distance_loss = (error * weight).mean() / config.distance_unit
    color_loss = (color_error * painted).sum() / painted.sum().clamp(min=1)
    own = generator.betas(w)  # faces are no network's, where it was made for builds alone
    betas_loss = (own - batch.betas[:, : own.shape[1]]).square().mean()
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
    low = config.final_learning_rate
    return config.learning_rate * (low + (1 - low) * 0.5 * (1 + math.cos(math.pi * t)))


def held_out(generator: AvatarGenerator, stream: Stream, config: WarmStartConfig) -> Errors:
    """Mean errors on people no training step has seen."""
    with torch.no_grad():
        unseen = (stream.batch(HELD_OUT_STEP + i, config.people) for i in range(config.held_out_batches))
        rows = [losses(generator, batch, config)[1] for batch in unseen]
    mean = {name: float(np.mean([getattr(row, name) for row in rows])) for name in vars(rows[0])}
    return Errors(**mean)


@dataclass
class State:
    """All that a run continues from."""

    step: int
    generator: AvatarGenerator
    average: AvatarGenerator
    optimizer: torch.optim.Adam


def new_state(
    config: GeneratorConfig,
    training: WarmStartConfig,
    body: CanonicalBody,
    coarser: dict[str, Tensor] | None = None,
) -> State:
    """Freshly initialised networks on a body, seeded; or those of a coarser run, whose added plane
    resolutions start silent.

    Raises:
        TrainingError: the coarser weights are of other networks.
    """
    torch.manual_seed(training.seed)
    generator = AvatarGenerator(config)
    fit_reach(generator.decoder, body)
    if coarser is not None:
        refine(generator, coarser)
    optimizer = torch.optim.Adam(
        parameter_groups(generator, training), lr=training.learning_rate, betas=(0.9, 0.99)
    )
    return State(step=0, generator=generator, average=copy.deepcopy(generator).eval(), optimizer=optimizer)


def parameter_groups(generator: AvatarGenerator, training: WarmStartConfig) -> list[dict[str, Any]]:
    """Two groups: what is stored at the size it is used at, and equalised layers, which need larger steps.

    An equalised weight is of unit size whatever the layer's width: the same step changes it relatively less.
    """
    equalised, plain = [], []
    for name, parameter in generator.named_parameters():
        field = name.startswith(("mapping.", "decoder.", "shape.")) and not name.endswith("vertex_features")
        (equalised if field else plain).append(parameter)
    return [{"params": plain, "rate": 1.0}, {"params": equalised, "rate": training.field_rate}]


def refine(generator: AvatarGenerator, coarser: dict[str, Tensor]) -> None:
    """Load weights trained with fewer plane resolutions; the new ones add nothing until they learn to."""
    own = generator.state_dict()
    missing = set(own) - set(coarser)
    added = {name for name in missing if name.startswith("synthesis.blocks.")}
    if (
        missing != added
        or any(own[n].shape != coarser[n].shape for n in coarser if n in own)
        or not set(coarser) <= set(own)
    ):
        raise TrainingError(
            "warm start: the weights to start from differ in more than added plane resolutions; "
            "use the same preset"
        )
    silent = {name: torch.zeros_like(own[name]) for name in added if name.endswith("share.weight")}
    generator.load_state_dict(own | coarser | silent)


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
    except (RuntimeError, KeyError, ValueError, EOFError, OSError, UnpicklingError) as error:
        raise TrainingError(
            f"warm start: {path} cannot be continued ({error}); name another folder"
        ) from error


def step_once(state: State, batch: Batch, config: WarmStartConfig) -> Errors:
    """One optimisation step on the batch of `state.step`.

    Raises:
        TrainingError: the loss is not finite; the last saved state is kept.
    """
    for group in state.optimizer.param_groups:
        group["lr"] = group["rate"] * learning_rate(state.step, config)
    loss, errors = losses(state.generator, batch, config)
    if not torch.isfinite(loss):
        raise TrainingError(
            f"warm start: loss {float(loss.detach())} at step {state.step}; lower the learning-rate"
        )
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


def train(
    generator_config: GeneratorConfig,
    config: WarmStartConfig,
    body: CanonicalBody,
    out: Path,
    report: Callable[[str], None],
    coarser: dict[str, Tensor] | None = None,
) -> Errors:
    """Run, or continue, the warm start in folder `out`; returns the held-out errors of the averaged weights.

    `report` takes a progress line now and then.

    Writes `generator.safetensors` (the averaged weights), `state.pt` to continue from, `log.jsonl` with
    held-out errors, `config.json`, and `pool.npz`, which any run of the same pool, seed and body may share.

    Raises:
        InputError: the folder holds another run, or a pool of another.
        TrainingError: the loss is not finite, or the saved state is damaged.
    """
    settings = describe(generator_config, config, body, coarser)
    claim(out, "config.json", settings, "warm start", made=["state.pt"], free=MAY_CHANGE)
    stream = Stream(cached_pool(out / "pool.npz", body, config.pool, config.seed), config, body)
    state = new_state(generator_config, config, body, coarser)
    if (out / "state.pt").exists():
        restore(state, out / "state.pt")
        cut_log(out / "log.jsonl", "step", state.step, "warm start")
    elif coarser is None and config.trait_steps:
        learn_traits(state.generator.mapping, config.trait_steps, config.seed, report)
        state.average.mapping.load_state_dict(state.generator.mapping.state_dict())
    started, recent = time.monotonic(), []
    errors = held_out(state.average, stream, config)
    while state.step < config.steps:
        recent.append(step_once(state, stream.batch(state.step, config.people, config.skirts), config))
        if state.step % config.report_every == 0:
            report(summarize(state.step, recent, time.monotonic() - started, config))
            recent = []
        if state.step % config.save_every == 0 or state.step == config.steps:
            errors = held_out(state.average, stream, config)
            with (out / "log.jsonl").open("a") as log:  # before the state: a line behind it is cut off
                log.write(
                    json.dumps({"step": state.step, "people": state.step * config.people, **asdict(errors)})
                    + "\n"
                )
            save_state(state, out / "state.pt")
            finish(state, config, errors, out / "generator.safetensors")
    return errors


def describe(
    networks: GeneratorConfig,
    config: WarmStartConfig,
    body: CanonicalBody,
    coarser: dict[str, Tensor] | None,
) -> dict[str, Any]:
    """All that a run depends on, as it is written beside it."""
    start = coarser and digest_arrays({name: value.numpy() for name, value in coarser.items()})
    return {
        "training": asdict(config),
        "generator": asdict(networks),
        "body": digest_arrays(vars(body.source)),
        "start": start,
    }


def finish(state: State, config: WarmStartConfig, errors: Errors, path: Path) -> None:
    """Write the averaged generator with the mean of w, and notes on how it came to be."""
    random = torch.Generator().manual_seed(config.seed)
    with torch.no_grad():
        z = torch.randn(4096, LATENT_SIZE, generator=random)
        state.average.mapping.average.copy_(state.average.mapping(z, orbit_cameras(4096, random)).mean(0))
    notes = {
        "licence": "Apache-2.0",
        "coding": CODING,
        "training": f"warm start, {state.step} steps of {config.people} people and {config.points} points",
        "held_out": f"{errors.distance_mm:.3f} mm, colour {errors.colour:.4f}",
    }
    save_checkpoint(state.average, path, notes, half=True)


def summarize(step: int, recent: list[Errors], seconds: float, config: WarmStartConfig) -> str:
    """One progress line."""
    distance = np.mean([e.distance_mm for e in recent])
    colour = np.mean([e.colour for e in recent])
    return f"step {step}/{config.steps}  {distance:.3f} mm  colour {colour:.4f}  {seconds:.0f} s"
