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
from dataclasses import dataclass
from pathlib import Path
from pickle import UnpicklingError
from typing import Any

import torch
from torch import Tensor

from avatargen.atomic import write_atomically
from avatargen.body.model import Body
from avatargen.data.dataset import Pictures
from avatargen.errors import TrainingError
from avatargen.generator.config import GeneratorConfig
from avatargen.generator.generator import AvatarGenerator
from avatargen.run_folder import digest_arrays
from avatargen.training.adversarial_config import AdversarialConfig, OptimizerConfig
from avatargen.training.discriminator import Discriminator

MAY_CHANGE = ("training.images", "data.folder")  # how long to train, and where the pictures lie


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


def describe(
    config: AdversarialConfig, generator_config: GeneratorConfig, pictures: Pictures, body: Body, start: str
) -> dict[str, Any]:
    """All that a run depends on, as it is written beside it."""
    return {
        "training": dataclasses.asdict(config),
        "generator": dataclasses.asdict(generator_config),
        "data": {"folder": str(pictures.folder.resolve()), "contents": pictures.contents()},
        "body": digest_arrays(vars(body)),
        "start": start,
    }
