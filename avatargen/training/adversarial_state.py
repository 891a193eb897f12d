"""What an adversarial run continues from, and the folder it lives in.

OUT/config.json               settings; a folder never holds two runs
OUT/state.pt                  networks, averages, optimisers, pictures shown: to continue from
OUT/generator.safetensors     the averaged generator
OUT/log.jsonl                 a line every few steps; the same whether or not the run was stopped
OUT/pictures/000002000.png    people of the averaged generator
"""

import copy
import dataclasses
import io
import json
from dataclasses import dataclass
from pathlib import Path
from pickle import UnpicklingError
from typing import Any

import torch
from torch import Tensor

from avatargen.atomic import write_atomically
from avatargen.errors import TrainingError
from avatargen.generator.config import GeneratorConfig
from avatargen.generator.generator import AvatarGenerator
from avatargen.training.adversarial_config import AdversarialConfig, OptimizerConfig
from avatargen.training.discriminator import Discriminator


@dataclass
class State:
    """All that a run continues from; `images` counts the pictures shown to the discriminator."""

    images: int
    generator: AvatarGenerator
    average: AvatarGenerator
    discriminator: Discriminator
    generator_optimizer: torch.optim.Adam
    discriminator_optimizer: torch.optim.Adam
    scaler: torch.amp.GradScaler  # keeps fp16 gradients from vanishing; does nothing in other precisions

    def parts(self) -> dict[str, Any]:
        """Everything that has a state dict, by name."""
        return {name: part for name, part in vars(self).items() if name != "images"}


def new_state(
    config: AdversarialConfig,
    generator_config: GeneratorConfig,
    label_size: int,
    device: torch.device,
    start: dict[str, Tensor] | None = None,
) -> State:
    """Seeded random networks; the generator's weights are `start` where given, which may leave
    out the deformation's.

    Raises:
        TrainingError: those weights are of other networks.
    """
    torch.manual_seed(config.seed)
    generator = AvatarGenerator(generator_config)
    discriminator = Discriminator(
        config.discriminator, size=generator_config.render.image_size, label_size=label_size
    )
    if start is not None:
        try:
            deformation = generator.deformation.state_dict(prefix="deformation.")
            generator.load_state_dict(deformation | start)
        except RuntimeError as error:
            raise TrainingError(
                "train: the weights to start from are of other networks "
                f"({str(error).splitlines()[-1].strip()}); change the picture sizes or start without them"
            ) from error
    generator.to(device)
    discriminator.to(device)
    lazy = config.losses.r1_every / (config.losses.r1_every + 1)  # of its steps one more is the penalty's
    rates = config.optimizer
    return State(
        images=0,
        generator=generator,
        average=copy.deepcopy(generator).eval().requires_grad_(False),
        discriminator=discriminator,
        generator_optimizer=adam(generator_groups(generator, rates), rates, 1.0),
        discriminator_optimizer=adam(
            [{"params": list(discriminator.parameters()), "lr": rates.discriminator_rate}], rates, lazy
        ),
        scaler=torch.amp.GradScaler(device.type, enabled=config.precision == "fp16"),
    )


def generator_groups(generator: AvatarGenerator, config: OptimizerConfig) -> list[dict[str, Any]]:
    """All parameters at one rate, but the density's, which a step of that size would undo."""
    density = list(generator.density.parameters())
    others = [p for name, p in generator.named_parameters() if not name.startswith("density.")]
    rate = config.generator_rate
    return [{"params": others, "lr": rate}, {"params": density, "lr": rate * config.density_share}]


def adam(groups: list[dict[str, Any]], config: OptimizerConfig, lazy: float) -> torch.optim.Adam:
    """Adam; `lazy` is the share of its steps that are not the penalty's."""
    for group in groups:
        group["lr"] *= lazy
    return torch.optim.Adam(groups, betas=(config.beta1**lazy, config.beta2**lazy), eps=1e-8)


def save_state(state: State, path: Path) -> None:
    """Write the run's state, whole or not at all."""
    stream = io.BytesIO()
    content = {name: part.state_dict() for name, part in state.parts().items()}
    torch.save({"images": state.images, **content}, stream)
    write_atomically(path, stream.getvalue())


def restore(state: State, path: Path) -> None:
    """Continue from a saved state.

    Raises:
        TrainingError: the file is damaged or of other networks.
    """
    try:
        content = torch.load(path, map_location="cpu", weights_only=True)
        for name, part in state.parts().items():
            part.load_state_dict(content[name])
        state.images = int(content["images"])
    except (RuntimeError, KeyError, ValueError, EOFError, OSError, UnpicklingError) as error:
        raise TrainingError(f"train: {path} cannot be continued ({error}); name another folder") from error


def claim(out: Path, settings: dict[str, Any]) -> None:
    """Make the folder this run's, or see that it is. How long to train may change between calls.

    Raises:
        TrainingError: it holds a run of other settings.
    """
    out.mkdir(parents=True, exist_ok=True)
    path = out / "config.json"
    if not path.exists():
        write_atomically(path, json.dumps(settings, indent=1).encode())
        return
    try:
        found = dict(json.loads(path.read_bytes()))
    except (OSError, TypeError, ValueError, RecursionError) as error:
        raise TrainingError(f"train: {path} is damaged ({str(error)[:200]}); name another folder") from error
    differ = [name for name in settings if without_length(found.get(name)) != without_length(settings[name])]
    if differ:
        raise TrainingError(f"train: {out} holds a run with another {', '.join(differ)}; name another folder")


def without_length(part: Any) -> Any:
    part = json.loads(json.dumps(part))  # tuples become lists, as in the file
    return {k: v for k, v in part.items() if k != "images"} if isinstance(part, dict) else part


def describe(
    config: AdversarialConfig, generator_config: GeneratorConfig, data: Path, start: str
) -> dict[str, Any]:
    """The settings as they are written beside the run."""
    return {
        "training": dataclasses.asdict(config),
        "generator": dataclasses.asdict(generator_config),
        "data": str(data.resolve()),
        "start": start,
    }


def cut_log(path: Path, images: int) -> None:
    """Drop the lines behind `images`, and a torn last one: the continued run writes them again."""
    if not path.exists():
        return
    whole = [line for line in path.read_bytes().splitlines(keepends=True) if line.endswith(b"\n")]
    try:
        kept = [line for line in whole if json.loads(line)["images"] <= images]
    except (KeyError, TypeError, ValueError, RecursionError) as error:
        raise TrainingError(f"train: {path} is damaged ({str(error)[:200]}); name another folder") from error
    write_atomically(path, b"".join(kept))
