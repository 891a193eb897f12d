"""Checkpoints of baselines: weights as safetensors, the method's name and configuration in the metadata."""

import dataclasses
import json
from pathlib import Path
from typing import TYPE_CHECKING

from safetensors.torch import save

from avatargen.atomic import write_atomically
from avatargen.generator.checkpoint import in_fixed_order, require_finite

if TYPE_CHECKING:
    from avatargen.baselines.baseline import Baseline

FORMAT = "avatargen-baseline-1"


def save_baseline(model: "Baseline", path: Path, notes: dict[str, str]) -> None:
    """Write weights and configuration, whole or not at all.

    Raises:
        InputError: the weights are not finite, or the path cannot be written.
    """
    tensors = {name: tensor.detach().cpu().contiguous() for name, tensor in model.state_dict().items()}
    require_finite(tensors, str(path))
    metadata = {
        "format": FORMAT,
        "model": model.name,
        "config": json.dumps(dataclasses.asdict(model.config)),
        "notes": json.dumps(notes),
    }
    write_atomically(path, in_fixed_order(save(tensors, metadata)))
