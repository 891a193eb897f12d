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

from avatargen.atomic import write_atomically
from avatargen.body.model import Body
from avatargen.data.dataset import Pictures
from avatargen.errors import TrainingError
from avatargen.run_folder import digest_arrays
from avatargen.training.adversarial_config import AdversarialConfig, OptimizerConfig
from avatargen.training.discriminator import Discriminator
from avatargen.training.picture_model import PictureModel

# how long to train, how many pictures at a time, and where they lie
MAY_CHANGE = ("training.images", "training.at_once", "data.folder")


@dataclass
class State:
    """All that a run continues from; `images` counts the pictures shown to the discriminator."""

    images: int
    generator: PictureModel
    average: PictureModel
    discriminator: Discriminator
    generator_optimizer: torch.optim.Adam
    discriminator_optimizer: torch.optim.Adam
    scaler: torch.amp.GradScaler  # keeps fp16 gradients from vanishing; does nothing in other precisions

    def parts(self) -> dict[str, Any]:
        """Everything that has a state dict, by name."""
        return {name: part for name, part in vars(self).items() if name != "images"}


def new_state(config: AdversarialConfig, model: PictureModel, label_size: int, device: torch.device) -> State:
    """A run before its first step: the model, and a discriminator of seeded random weights."""
    torch.manual_seed(config.seed)
    discriminator = Discriminator(config.discriminator, size=model.render.image_size, label_size=label_size)
    model.to(device)
    discriminator.to(device)
    lazy = config.losses.r1_every / (config.losses.r1_every + 1)  # of its steps one more is the penalty's
    rates = config.optimizer
    return State(
        images=0,
        generator=model,
        average=copy.deepcopy(model).eval().requires_grad_(False),
        discriminator=discriminator,
        generator_optimizer=adam(model.groups(rates), rates, 1.0),
        discriminator_optimizer=adam(
            [{"params": list(discriminator.parameters()), "lr": rates.discriminator_rate}], rates, lazy
        ),
        scaler=torch.amp.GradScaler(device.type, enabled=config.precision == "fp16"),
    )


def adam(groups: list[dict[str, Any]], config: OptimizerConfig, lazy: float) -> torch.optim.Adam:
    """Adam; `lazy` is the share of its steps that are not the penalty's."""
    for group in groups:
        group["lr"] *= lazy
    on_gpu = all(parameter.is_cuda for group in groups for parameter in group["params"])
    betas = (config.beta1**lazy, config.beta2**lazy)
    return torch.optim.Adam(groups, betas=betas, eps=1e-8, fused=on_gpu)


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
    config: AdversarialConfig, model: PictureModel, pictures: Pictures, body: Body, start: str
) -> dict[str, Any]:
    """All that a run depends on, as it is written beside it."""
    return {
        "training": dataclasses.asdict(config),
        "generator": model.settings(),
        "data": {"folder": str(pictures.folder.resolve()), "contents": pictures.contents()},
        "body": digest_arrays(vars(body)),
        "start": start,
    }
