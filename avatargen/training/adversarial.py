"""Adversarial training from single pictures (sections 3.4 and 3.5), in one loop.

    labels, z --generator--> pictures --dual discriminator--> logits
    pictures of people     ----------^

Everything random in a step is drawn from (seed, step) for the whole batch before it is divided among
processes: a resumed run, and one on more processes, sees the same numbers.

Letters: B pictures of a process, Z size of the latent, L length of a label.
"""

import json
import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional as F

from avatargen.atomic import write_atomically
from avatargen.body.model import Body, canonical_body
from avatargen.data.dataset import Pictures
from avatargen.errors import TrainingError
from avatargen.generator.camera import camera_of_vector
from avatargen.generator.checkpoint import Checkpoint, save_checkpoint
from avatargen.generator.config import GeneratorConfig, for_body
from avatargen.generator.decoder import fit_reach
from avatargen.generator.density import Density
from avatargen.generator.generator import AvatarGenerator
from avatargen.generator.picture import CanonicalSurface, Person, Picture, make_people, picture_people
from avatargen.run_folder import claim, cut_log
from avatargen.training.adversarial_config import NETWORKS, AdversarialConfig
from avatargen.training.adversarial_state import (
    MAY_CHANGE,
    State,
    describe,
    new_state,
    restore,
    save_state,
)
from avatargen.training.losses import (
    discriminator_loss,
    generator_loss,
    geometry_losses,
    r1_penalty,
)
from avatargen.training.snapshot import picture_grid, tensorboard

if TYPE_CHECKING:
    from accelerate import Accelerator

HALF_DIGITS = 2e-3  # share by which a number moves when a file keeps it in 16 bits, and some
SNAPSHOTS = "snapshots"  # folder of a run's averaged weights, each named by the pictures shown


@dataclass(frozen=True, kw_only=True)
class Batch:
    """What one process needs for a step: real pictures with labels, and draws for generated ones."""

    real: Float[Tensor, "B 3 S S"]
    real_label: Float[Tensor, "B L"]
    z: Float[Tensor, "B Z"]
    other_z: Float[Tensor, "B Z"]  # the second latent of mixed styles
    crossover: int  # plane resolution from which the second latent rules; 0: none is mixed
    camera: Float[Tensor, "B 25"]
    mapped_camera: Float[Tensor, "B 25"]  # which the latent is mapped under
    pose: Float[Tensor, "B J 3"]
    betas: Float[Tensor, "B b"]
    draws: list[torch.Generator]  # one a picture, for samples along rays and points of losses

    @property
    def label(self) -> Float[Tensor, "B L"]:
        """Camera, pose and betas of the generated pictures, as the discriminator takes them."""
        return torch.cat([self.camera, self.pose.flatten(1), self.betas], dim=1)


def draw_batch(
    pictures: Pictures, config: AdversarialConfig, networks: GeneratorConfig, step: int, share: slice
) -> Batch:
    """The batch of a step, or a process's share of it."""
    random = torch.Generator().manual_seed((config.seed * 1_000_000_007 + step) % 2**63)
    B, Z = config.batch, networks.mapping.z_size
    real, asked, swapped = pictures.choose((3, B), random)
    z, other_z = torch.randn(2, B, Z, generator=random)
    swap = torch.rand(B, generator=random) < config.variety.camera_swap
    mix = float(torch.rand((), generator=random)) < config.variety.style_mixing
    crossover = int(torch.randint(1, len(networks.synthesis.blocks), (), generator=random)) if mix else 0
    seeds = torch.randint(2**62, (B,), generator=random)[share]
    camera, pose, betas = pictures.row(asked[share])
    mapped = torch.where(swap[share, None], pictures.row(swapped[share])[0], camera)
    real_camera, real_pose, real_betas = pictures.row(real[share])
    return Batch(
        real=torch.stack([pictures.image(int(i)) for i in real[share]]),
        real_label=torch.cat([real_camera, real_pose.flatten(1), real_betas], dim=1),
        z=z[share],
        other_z=other_z[share],
        crossover=crossover,
        camera=camera,
        mapped_camera=mapped,
        pose=pose,
        betas=betas,
        draws=[torch.Generator().manual_seed(int(seed)) for seed in seeds],
    )


def to_device(batch: Batch, device: torch.device) -> Batch:
    tensors = {name: value.to(device) for name, value in vars(batch).items() if isinstance(value, Tensor)}
    return replace(batch, **tensors)


@dataclass(frozen=True, kw_only=True)
class Run:
    """What stays the same over the steps of a run."""

    config: AdversarialConfig
    surface: CanonicalSurface
    accelerator: "Accelerator"

    def autocast(self) -> torch.autocast:
        """The precision of the networks' operations; without a scaler of accelerate's, as `State` has one."""
        name = self.config.precision
        half = torch.float16 if name == "fp16" else torch.bfloat16
        return torch.autocast(self.accelerator.device.type, half, enabled=name != "no")


def train(
    config: AdversarialConfig,
    pictures: Pictures,
    body: Body,
    out: Path,
    accelerator: "Accelerator",
    report: Callable[[str], None],
    start: Checkpoint | None = None,
) -> AvatarGenerator:
    """Run, or continue, the training in folder `out`; returns the averaged generator.

    `start` gives the generator its first weights; without it they are random. `report` takes progress lines.

    Raises:
        TrainingError: gradients are not finite or explode, or the pictures' labels or the weights to start
            from are of another body.
        InputError: the folder holds another run.
    """
    networks = generator_config(config, body, start)
    if not pictures.labels.may_be_of(networks.body_hash):
        raise TrainingError(
            f"train: the labels in {pictures.folder} are of another body; name it with --body"
        )
    run = Run(config=config, surface=CanonicalSurface(body), accelerator=accelerator)
    main, share = accelerator.is_main_process, share_of_process(config, accelerator)
    if main:
        start_name = start.weights_hash if start else "random weights"
        settings = describe(config, networks, pictures, body, start_name)
        claim(out, "config.json", settings, "train", made=["state.pt"], free=MAY_CHANGE)
    state = begin(config, networks, pictures, body, accelerator.device, start)
    if (out / "state.pt").exists():
        restore(state, out / "state.pt")
    if main:
        cut_log(out / "log.jsonl", "images", state.images, "train")
    if main and state.images == 0:
        keep_weights(state, run, pictures, out)
    board = tensorboard(out, state.images) if main else None
    started, first = time.monotonic(), state.images
    while state.images < config.images:
        step = state.images // config.batch
        batch = to_device(draw_batch(pictures, config, networks, step, share), accelerator.device)
        numbers = step_once(state, run, batch, step)
        if main and (step + 1) % config.report_every == 0:
            line = {"images": state.images, **numbers}
            with (out / "log.jsonl").open("a") as log:
                log.write(json.dumps(line) + "\n")
            if board:
                board(line)
            report(summarize(line, config, (state.images - first) / (time.monotonic() - started)))
        if main and snapshot_is_due(state.images, config):
            snapshot(state, run, pictures, out)
    return state.average


def begin(
    config: AdversarialConfig,
    networks: GeneratorConfig,
    pictures: Pictures,
    body: Body,
    device: torch.device,
    start: Checkpoint | None,
) -> State:
    """The networks before the first step."""
    weights = first_weights(start, config) if start else None
    state = new_state(config, networks, pictures.labels.rows().shape[1], device, weights)
    if start is None:
        fit_reach(state.generator.decoder, canonical_body(body))
        state.average.load_state_dict(state.generator.state_dict())
    return state


def snapshot_is_due(images: int, config: AdversarialConfig) -> bool:
    """Whether the step that ended at `images` crossed a multiple of the interval, or the end."""
    before = images - config.batch
    return images // config.snapshot_every > before // config.snapshot_every or images >= config.images


def generator_config(config: AdversarialConfig, body: Body, start: Checkpoint | None) -> GeneratorConfig:
    """The networks of the preset, or of the weights to start from, with this run's geometry and rendering.

    The deformation is also this run's, unless the weights bring one that has learned.

    Raises:
        TrainingError: those weights are of another body.
    """
    fresh = for_body(NETWORKS[config.networks], canonical_body(body))
    networks = start.generator.config if start else fresh
    if networks.body_hash != fresh.body_hash:
        raise TrainingError("train: the weights to start from are of another body; start without them")
    decoder = networks.decoder
    if config.geometry.prior == "none":
        decoder = replace(decoder, vertex_features=0)
    learned = start is not None and learned_deformation(start.generator)
    deformation = networks.deformation if learned else config.deformation
    return replace(
        networks, geometry=config.geometry, render=config.render, decoder=decoder, deformation=deformation
    )


def learned_deformation(generator: AvatarGenerator) -> bool:
    """Whether the deformation moves anything; before adversarial training it does not."""
    leave = generator.deformation.leave
    return bool(leave.weight.any() or leave.bias.any())


def first_weights(start: Checkpoint, config: AdversarialConfig) -> dict[str, Tensor]:
    """The weights to start from; where nothing was rendered in their training, with this run's sharpness. A
    deformation that has not learned is left out, and begins anew.
    """
    weights, rendering = start.generator.state_dict(), start.generator.config.render
    if not learned_deformation(start.generator):
        weights = {name: value for name, value in weights.items() if not name.startswith("deformation.")}
    untrained = Density(rendering.initial_alpha).p.detach()
    if torch.isclose(weights["density.p"].cpu(), untrained, rtol=HALF_DIGITS):
        weights["density.p"] = Density(config.render.initial_alpha).p.detach()
    return weights


def share_of_process(config: AdversarialConfig, accelerator: "Accelerator") -> slice:
    """Which part of each batch is this process's.

    Raises:
        TrainingError: the batch cannot be divided into whole groups.
    """
    count, group = accelerator.num_processes, config.discriminator.group
    if config.batch % (count * group):
        raise TrainingError(
            f"train: a batch of {config.batch} is not divided over {count} processes in groups of {group}; "
            "change the batch"
        )
    each = config.batch // count
    return slice(accelerator.process_index * each, (accelerator.process_index + 1) * each)


def step_once(state: State, run: Run, batch: Batch, step: int) -> dict[str, float]:
    """One step of both networks on the same generated pictures; returns the numbers of the log."""
    config = run.config
    sigma = config.variety.blur * max(0.0, 1 - state.images / config.variety.blur_fade)
    with run.autocast():
        people, fake = generate(state.generator, run.surface, batch)
    numbers = improve_discriminator(state, run, batch, fake, sigma, lazy=step % config.losses.r1_every == 0)
    state.discriminator.requires_grad_(False)  # the generator's step wants no gradients of its judge
    numbers |= improve_generator(state, run, batch, people, fake, sigma)
    state.discriminator.requires_grad_(True)
    state.scaler.update()
    state.images += config.batch
    update_average(state, config)
    return numbers


def generate(
    generator: AvatarGenerator, surface: CanonicalSurface, batch: Batch
) -> tuple[list[Person], Picture]:
    """People of the batch's latents, and their pictures."""
    w = generator.mapping(batch.z, batch.mapped_camera)
    planes, late = generator.planes(w), w
    if batch.crossover:
        late = generator.mapping(batch.other_z, batch.mapped_camera)
        planes = generator.synthesis(w, late, batch.crossover)
    people = make_people(generator, surface, late.float(), planes.float(), batch.pose, batch.betas)
    return people, picture_people(generator, surface, people, camera_of_vector(batch.camera), batch.draws)


def improve_discriminator(
    state: State, run: Run, batch: Batch, fake: Picture, sigma: float, *, lazy: bool
) -> dict[str, float]:
    """One step of the discriminator, now and then with R1."""
    size, weights = fake.raw.shape[-1], run.config.losses
    real_raw = F.interpolate(batch.real, size=(size, size), mode="area")
    with run.autocast():
        on_fake = judge(state.discriminator, fake.image.detach(), fake.raw.detach(), batch.label, sigma)
        on_real = judge(state.discriminator, batch.real, real_raw, batch.real_label, sigma)
    loss = discriminator_loss(on_fake.float(), on_real.float())
    numbers = {
        "discriminator": float(loss.detach()),
        "real_logit": float(on_real.detach().mean()),
        "fake_logit": float(on_fake.detach().mean()),
    }
    if lazy:
        ratio = size / batch.real.shape[-1]
        penalty = r1_penalty(
            state.discriminator, blur(batch.real, sigma), blur(real_raw, sigma * ratio), batch.real_label
        )
        loss = loss + penalty * weights.r1 * weights.r1_every
    numbers["discriminator_gradient"] = descend(loss, "discriminator", state, run)
    return numbers


def improve_generator(
    state: State, run: Run, batch: Batch, people: list[Person], fake: Picture, sigma: float
) -> dict[str, float]:
    """One step of the generator, by the discriminator and by the losses of its geometry."""
    weights = run.config.losses
    with run.autocast():
        logits = judge(state.discriminator, fake.image, fake.raw, batch.label, sigma)
    adversarial = generator_loss(logits.float())
    shape = geometry_losses(state.generator, run.surface, people, weights.points, batch.draws)
    loss = (
        adversarial
        + weights.eikonal * shape.eikonal
        + weights.minimal_surface * shape.minimal_surface
        + weights.smpl * shape.smpl
    )
    norm = descend(loss, "generator", state, run)
    return {
        "generator": float(adversarial.detach()),
        "eikonal": float(shape.eikonal.detach()),
        "minimal_surface": float(shape.minimal_surface.detach()),
        "smpl": float(shape.smpl.detach()),
        "alpha": float(state.generator.density.alpha.detach()),
        "generator_gradient": norm,
    }


def judge(
    discriminator: nn.Module, image: Tensor, raw: Tensor, label: Tensor, sigma: float
) -> Float[Tensor, " B"]:
    """The discriminator's logits, both pictures blurred by the same width on the person."""
    ratio = raw.shape[-1] / image.shape[-1]
    return discriminator(blur(image, sigma), blur(raw, sigma * ratio), label)


def blur(picture: Float[Tensor, "B 3 S S"], sigma: float) -> Float[Tensor, "B 3 S S"]:
    """Gaussian blur of `sigma` pixels; beyond the picture the border repeats."""
    reach = int(3 * sigma)
    if reach == 0:
        return picture
    place = torch.arange(-reach, reach + 1, device=picture.device, dtype=picture.dtype)
    kernel = torch.exp(-0.5 * (place / sigma) ** 2)
    kernel = (kernel / kernel.sum()).expand(3, 1, 1, -1)
    wide = F.pad(picture, (reach,) * 4, mode="replicate")
    return F.conv2d(F.conv2d(wide, kernel, groups=3), kernel.transpose(2, 3), groups=3)


def descend(
    loss: Float[Tensor, ""], name: Literal["generator", "discriminator"], state: State, run: Run
) -> float:
    """One step of a network down a loss whose gradients are averaged over the processes; returns their norm.

    In fp16 a step whose gradients overflow is left out, and the next one scales them less.

    Raises:
        TrainingError: gradients are not finite or explode; what was saved last stays.
    """
    network, optimizer = getattr(state, name), getattr(state, f"{name}_optimizer")
    optimizer.zero_grad(set_to_none=True)
    state.scaler.scale(loss).backward()
    gradients = [parameter.grad for parameter in network.parameters() if parameter.grad is not None]
    share_gradients(gradients, run)
    state.scaler.unscale_(optimizer)
    norm = float(torch.cat([gradient.flatten() for gradient in gradients]).norm())
    overflow = state.scaler.is_enabled() and not math.isfinite(norm) and state.scaler.get_scale() > 1
    if not norm < run.config.optimizer.largest_gradient and not overflow:
        raise TrainingError(
            f"train: the {name}'s gradient has norm {norm:.3g} at picture {state.images}, at most "
            f"{run.config.optimizer.largest_gradient:.3g} is taken; lower the learning rates or raise r1 "
            "(the last checkpoint is kept)"
        )
    state.scaler.step(optimizer)
    return norm


def share_gradients(gradients: list[Tensor], run: Run) -> None:
    """Replace gradients by their mean over the processes; alone there is nothing to do."""
    if run.accelerator.num_processes == 1:
        return
    flat = torch.cat([gradient.flatten() for gradient in gradients])
    mean = run.accelerator.reduce(flat, reduction="mean")
    sizes = [gradient.numel() for gradient in gradients]
    for gradient, part in zip(gradients, mean.split(sizes), strict=True):  # pyright: ignore[reportAttributeAccessIssue]
        gradient.copy_(part.view_as(gradient))


@torch.no_grad()
def update_average(state: State, config: AdversarialConfig) -> None:
    """Move the averaged weights by the half-life that so many pictures call for."""
    half_life = min(config.optimizer.half_life, state.images * config.optimizer.ramp)
    keep = 0.5 ** (config.batch / max(half_life, 1e-8))
    for kept, new in zip(state.average.parameters(), state.generator.parameters(), strict=True):
        kept.lerp_(new, 1 - keep)


def snapshot(state: State, run: Run, pictures: Pictures, out: Path) -> None:
    """Write the averaged generator, a picture grid and, last, the state to continue from."""
    write_atomically(out / "generator.safetensors", keep_weights(state, run, pictures, out).read_bytes())
    picture_grid(state.average, run.surface, pictures, out / "pictures" / f"{state.images:09d}.png")
    save_state(state, out / "state.pt")


@torch.no_grad()
def keep_weights(state: State, run: Run, pictures: Pictures, out: Path) -> Path:
    """Write the averaged generator under the number of pictures shown: the last is not always the best."""
    random = torch.Generator().manual_seed(run.config.seed)
    average, device = state.average, run.accelerator.device
    z = torch.randn(1024, average.config.mapping.z_size, generator=random)
    camera, _, _ = pictures.row(torch.randint(len(pictures), (1024,), generator=random))
    average.mapping.average.copy_(average.mapping(z.to(device), camera.to(device)).mean(dim=0))
    notes = {"licence": "Apache-2.0", "training": f"adversarial, {state.images} pictures"}
    path = out / SNAPSHOTS / f"{state.images:09d}.safetensors"
    path.parent.mkdir(exist_ok=True)
    save_checkpoint(average, path, notes)
    return path


def summarize(line: dict[str, float | int], config: AdversarialConfig, speed: float) -> str:
    """One progress line."""
    return (
        f"{line['images']}/{config.images} pictures  G {line['generator']:.3f}  "
        f"D {line['discriminator']:.3f}  "
        f"logits {line['real_logit']:+.2f} {line['fake_logit']:+.2f}  eikonal {line['eikonal']:.3f}  "
        f"{speed:.1f} pictures/s"
    )
