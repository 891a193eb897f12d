"""The generator of a weights file, of whichever kind it is.

load_generator() -> Sampler --sample(seed)--> Avatar
"""

from pathlib import Path

import torch

from avatargen.avatar import Sampler, load_single
from avatargen.body.model import Body
from avatargen.dressed_avatar import load_dressed_sampler
from avatargen.errors import InputError
from avatargen.generator.checkpoint import format_of
from avatargen.generator.dressed.checkpoint import DRESSED_FORMAT
from avatargen.shipped import shipped


def load_generator(
    weights: str | Path | None = None,
    body: str | Path | Body | None = None,
    device: str | torch.device = "cpu",
) -> Sampler:
    """Load a generator, by default that of dressed people that comes with the package, on its own body or
    another.

    A generator of dressed people answers on a processor alone.

    Raises:
        InputError: a file is missing or damaged, the weights fit neither this body nor the default one, or
        its weights shall answer on another device.
    """
    path = Path(weights or shipped("people.safetensors"))
    if format_of(path) != DRESSED_FORMAT:
        return load_single(path, body, device)
    if torch.device(device).type != "cpu":
        raise InputError(
            f"weights: {path} is of dressed people, which a processor answers; leave --device {device} out"
        )
    return load_dressed_sampler(path, body)
