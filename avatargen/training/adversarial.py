"""Adversarial training from single pictures (sections 3.4 and 3.5), in one loop, of any `PictureModel`.

    labels, z --generator--> pictures --dual discriminator--> logits
    pictures of people     ----------^

On a GPU nothing in a step waits for its numbers: they are looked at when a line of the log is due.

Letters: B pictures of a process.
"""

import json
import math
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, closing, nullcontext
from dataclasses import dataclass
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
from avatargen.generator.config import body_hash
from avatargen.generator.picture import Picture
from avatargen.run_folder import claim, cut_log
from avatargen.training.adversarial_config import AdversarialConfig
from avatargen.training.adversarial_state import (
    MAY_CHANGE,
    State,
    describe,
    new_state,
    restore,
    save_state,
)
from avatargen.training.batches import Batch, batches, split, to_device
from avatargen.training.best_snapshot import Watch, snapshot_path, watch_snapshot
from avatargen.training.losses import discriminator_loss, generator_loss, r1_penalty
from avatargen.training.picture_model import Generated, PictureModel
from avatargen.training.snapshot import Board, picture_grid, tensorboard

if TYPE_CHECKING:
    from accelerate import Accelerator


@dataclass(frozen=True, kw_only=True)
class Run:
    """What stays the same over the steps of a run."""

    config: AdversarialConfig
    accelerator: "Accelerator"

    def autocast(self) -> AbstractContextManager:
        """The precision of the networks' operations; without a scaler of accelerate's, as `State` has one."""
        name = self.config.precision
        half = torch.float16 if name == "fp16" else torch.bfloat16
        return nullcontext() if name == "no" else torch.autocast(self.accelerator.device.type, half)


def train(
    config: AdversarialConfig,
    model: PictureModel,
    pictures: Pictures,
    body: Body,
    out: Path,
    accelerator: "Accelerator",
    report: Callable[[str], None],
    start: str = "random weights",
    watch: Watch | None = None,
) -> PictureModel:
    """Run, or continue, the training of a fresh model in folder `out`; returns it with averaged weights.

    `start` names the weights that the model begins with. `report` takes progress lines. `watch` measures
    snapshots, of which the best is kept by name.

    Raises:
        TrainingError: gradients are not finite or explode, or the pictures' labels are of another body.
        InputError: the folder holds another run.
    """
    if not pictures.labels.may_be_of(body_hash(canonical_body(body))):
        raise TrainingError(
            f"train: the labels in {pictures.folder} are of another body; name it with --body"
        )
    if accelerator.device.type == "cuda":
        torch.set_float32_matmul_precision("high")  # of the networks; geometry multiplies no matrices
    run = Run(config=config, accelerator=accelerator)
    main, share = accelerator.is_main_process, share_of_process(config, accelerator)
    if main:
        settings = describe(config, model, pictures, body, start)
        claim(out, "config.json", settings, "train", made=["state.pt"], free=MAY_CHANGE)
    state = new_state(config, model, pictures.labels.rows().shape[1], accelerator.device)
    if (out / "state.pt").exists():
        restore(state, out / "state.pt")
    if main:
        cut_log(out / "log.jsonl", "images", state.images, "train")
    if main and state.images == 0:
        keep_weights(state, run, pictures, out)
    continue_to_end(state, run, pictures, out, share, report, watch)
    return state.average


def continue_to_end(
    state: State,
    run: Run,
    pictures: Pictures,
    out: Path,
    share: slice,
    report: Callable[[str], None],
    watch: Watch | None,
) -> None:
    """Step to the end, with lines of the log and snapshots on the way."""
    config, device, main = run.config, run.accelerator.device, run.accelerator.is_main_process
    board = tensorboard(out, state.images) if main else None
    started, first, steps = time.monotonic(), state.images, []
    room = state.generator.survey(pictures.row(torch.arange(len(pictures))))
    with closing(batches(pictures, config, state.generator, first // config.batch, share, room)) as coming:
        while state.images < config.images:
            step = state.images // config.batch
            steps.append(step_once(state, run, to_device(next(coming), device), step))
            told = (step + 1) % config.report_every == 0
            due = snapshot_is_due(state.images, config)
            if not (told or due or device.type == "cpu"):  # to look is to wait, but on the CPU
                continue
            lines = look(steps, state, config)
            steps = []
            if main and told:
                speed = (state.images - first) / (time.monotonic() - started)
                write_line(lines[-1], out, board)
                report(summarize(lines[-1], config, speed))
            if main and due:
                snapshot(state, run, pictures, out, watch, board)


def write_line(line: dict[str, float | int], out: Path, board: Board | None) -> None:
    with (out / "log.jsonl").open("a") as log:
        log.write(json.dumps(line) + "\n")
    if board:
        board(line)


def snapshot_is_due(images: int, config: AdversarialConfig) -> bool:
    """Whether the step that ended at `images` crossed a multiple of the interval, or the end."""
    before = images - config.batch
    return images // config.snapshot_every > before // config.snapshot_every or images >= config.images


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


def step_once(state: State, run: Run, batch: Batch, step: int) -> dict[str, Float[Tensor, ""]]:
    """One step of both networks on the same generated pictures; returns the numbers of the log.

    A batch that is worked on in parts is generated twice, so that one part's graph is kept at a time.
    """
    config = run.config
    sigma = config.variety.blur * max(0.0, 1 - state.images / config.variety.blur_fade)
    parts = split(batch, config.at_once or len(batch.real))
    with run.autocast(), torch.set_grad_enabled(len(parts) == 1):
        fakes = [state.generator.generate(part.asked) for part in parts]
    lazy = step % config.losses.r1_every == 0
    judged = discriminator_terms(state, run, parts, [fake.picture for fake in fakes], sigma, lazy=lazy)
    numbers = descend(judged, "discriminator", state, run)
    state.discriminator.requires_grad_(False)  # the generator's step wants no gradients of its judge
    numbers |= descend(generator_terms(state, run, parts, fakes, sigma), "generator", state, run)
    state.discriminator.requires_grad_(True)
    state.scaler.update()
    state.images += config.batch
    update_average(state, config)
    return numbers | state.generator.numbers()


def discriminator_terms(
    state: State, run: Run, parts: list[Batch], fakes: list[Picture], sigma: float, *, lazy: bool
) -> Iterator[tuple[Float[Tensor, ""], dict[str, Float[Tensor, ""]]]]:
    """The discriminator's loss on each part of a batch, now and then with R1, and the numbers of the log."""
    for batch, fake in zip(parts, fakes, strict=True):
        size, weights = fake.raw.shape[-1], run.config.losses
        real_raw = F.interpolate(batch.real, size=(size, size), mode="area")
        with run.autocast():
            on_fake = judge(state.discriminator, fake.image.detach(), fake.raw.detach(), batch.label, sigma)
            on_real = judge(state.discriminator, batch.real, real_raw, batch.real_label, sigma)
        loss = discriminator_loss(on_fake.float(), on_real.float())
        numbers = {
            "discriminator": loss.detach(),
            "real_logit": on_real.detach().mean(),
            "fake_logit": on_fake.detach().mean(),
        }
        if lazy:
            ratio = size / batch.real.shape[-1]
            penalty = r1_penalty(
                state.discriminator, blur(batch.real, sigma), blur(real_raw, sigma * ratio), batch.real_label
            )
            loss = loss + penalty * weights.r1 * weights.r1_every
        yield loss, numbers


def generator_terms(
    state: State, run: Run, parts: list[Batch], fakes: list[Generated], sigma: float
) -> Iterator[tuple[Float[Tensor, ""], dict[str, Float[Tensor, ""]]]]:
    """The generator's loss on each part of a batch, by the discriminator and by its own losses, and the
    numbers of the log."""
    for batch, fake in zip(parts, fakes, strict=True):
        with run.autocast():
            seen = fake if len(parts) == 1 else state.generator.generate(batch.asked)
            logits = judge(state.discriminator, seen.picture.image, seen.picture.raw, batch.label, sigma)
        adversarial = generator_loss(logits.float())
        own = seen.losses()
        numbers = {"generator": adversarial.detach(), **{name: loss.detach() for name, loss in own.items()}}
        yield torch.stack([adversarial, *own.values()]).sum(), numbers


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
    terms: Iterator[tuple[Float[Tensor, ""], dict[str, Float[Tensor, ""]]]],
    name: Literal["generator", "discriminator"],
    state: State,
    run: Run,
) -> dict[str, Float[Tensor, ""]]:
    """One step of a network down the mean loss of a batch's parts, whose gradients are averaged over the
    processes; returns the numbers of the log, the gradients' norm among them.

    In fp16 a step whose gradients overflow is left out, and the next one scales them less.
    """
    network, optimizer = getattr(state, name), getattr(state, f"{name}_optimizer")
    optimizer.zero_grad(set_to_none=True)
    count = run.config.batch // run.accelerator.num_processes
    share = (run.config.at_once or count) / count
    numbers: dict[str, Tensor] = {}
    for loss, own in terms:
        state.scaler.scale(loss * share).backward()
        numbers = {key: numbers.get(key, 0) + value * share for key, value in own.items()}
    gradients = [parameter.grad for parameter in network.parameters() if parameter.grad is not None]
    share_gradients(gradients, run)
    state.scaler.unscale_(optimizer)
    numbers[f"{name}_gradient"] = nn.utils.get_total_norm(gradients)
    state.scaler.step(optimizer)
    return numbers


def look(
    steps: list[dict[str, Float[Tensor, ""]]], state: State, config: AdversarialConfig
) -> list[dict[str, float | int]]:
    """The numbers of the steps since the last look, as lines of the log.

    Raises:
        TrainingError: gradients are not finite or explode; what was saved last stays.
    """
    numbers = torch.stack([torch.stack([value.float() for value in one.values()]) for one in steps]).cpu()
    may_overflow = state.scaler.is_enabled() and state.scaler.get_scale() > 1
    lines = []
    for number, row in enumerate(numbers.tolist(), start=1 - len(steps)):
        images = state.images + number * config.batch
        lines.append({"images": images} | dict(zip(steps[0], row, strict=True)))
        for name in ("discriminator", "generator"):
            norm = lines[-1][f"{name}_gradient"]
            overflow = may_overflow and not math.isfinite(norm)
            if not norm < config.optimizer.largest_gradient and not overflow:
                raise TrainingError(
                    f"train: the {name}'s gradient has norm {norm:.3g} at picture {images}, at most "
                    f"{config.optimizer.largest_gradient:.3g} is taken; lower the learning rates or raise r1 "
                    "(the last checkpoint is kept)"
                )
    return lines


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


def snapshot(
    state: State, run: Run, pictures: Pictures, out: Path, watch: Watch | None, board: Board | None
) -> None:
    """Write the averaged generator, a picture grid, whether it is the best and, last, the state to continue
    from.
    """
    write_atomically(out / "generator.safetensors", keep_weights(state, run, pictures, out).read_bytes())
    grid = out / "pictures" / f"{state.images:09d}.png"
    picture_grid(state.average, pictures, run.accelerator.device, grid)
    numbers = watch_snapshot(watch, state.average, state.images, out) if watch else {}
    if board and numbers:
        board({"images": state.images} | {f"snapshot/{name}": value for name, value in numbers.items()})
    save_state(state, out / "state.pt")


def keep_weights(state: State, run: Run, pictures: Pictures, out: Path) -> Path:
    """Write the averaged generator under the number of pictures shown: the last is not always the best."""
    random = torch.Generator().manual_seed(run.config.seed)
    device = run.accelerator.device
    z = torch.randn(1024, state.average.z_size, generator=random)
    camera, _, _ = pictures.row(torch.randint(len(pictures), (1024,), generator=random))
    state.average.settle(z.to(device), camera.to(device))
    path = snapshot_path(out, state.images)
    path.parent.mkdir(exist_ok=True)
    state.average.save(path, {"training": f"adversarial, {state.images} pictures"})
    return path


def summarize(line: dict[str, float | int], config: AdversarialConfig, speed: float) -> str:
    """One progress line."""
    return (
        f"{line['images']}/{config.images} pictures  G {line['generator']:.3f}  "
        f"D {line['discriminator']:.3f}  "
        f"logits {line['real_logit']:+.2f} {line['fake_logit']:+.2f}  "
        f"{speed:.1f} pictures/s"
    )
