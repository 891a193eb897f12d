"""Checkpoints of a generator of dressed people: safetensors, the configuration in the file's metadata.

The tensors are a safetensors file themselves, deflated into one tensor of bytes: tables of whole numbers
take less than half the room so.
"""

import dataclasses
import json
import zlib
from pathlib import Path

import torch
from jaxtyping import UInt8
from safetensors import SafetensorError
from safetensors.torch import load, save
from torch import Tensor

from avatargen.atomic import write_atomically
from avatargen.errors import InputError
from avatargen.generator.checkpoint import (
    ROOM,
    SLACK,
    Allowance,
    from_json,
    in_fixed_order,
    read_tensors,
    require_finite,
    require_fit,
    weights_hash,
)
from avatargen.generator.dressed.config import DressedConfig
from avatargen.generator.dressed.generator import DressedGenerator

DRESSED_FORMAT = "avatargen-dressed-1"
PACKED = "packed"
LARGEST = 1 << 29  # bytes that a file unpacks to at most


@dataclasses.dataclass(frozen=True, kw_only=True)
class DressedCheckpoint:
    """A generator of dressed people read from a file, ready to run."""

    generator: DressedGenerator
    weights_hash: str
    notes: dict[str, str]


def save_dressed(generator: DressedGenerator, path: str | Path, notes: dict[str, str] | None = None) -> str:
    """Write the generator, whole or not at all, its networks in half precision; returns the weights' hash.

    Raises:
        InputError: the weights are not finite, or the path cannot be written.
    """
    tensors = {
        name: (tensor.half() if tensor.is_floating_point() else tensor).detach().cpu().contiguous()
        for name, tensor in generator.state_dict().items()
    }
    require_finite(tensors, str(path))
    metadata = {
        "format": DRESSED_FORMAT,
        "config": json.dumps(dataclasses.asdict(generator.config)),
        "notes": json.dumps(notes or {}),
    }
    write_atomically(path, in_fixed_order(save({PACKED: packed(tensors)}, metadata)))
    return weights_hash(tensors)


def load_dressed(path: str | Path) -> DressedCheckpoint:
    """Read a generator of dressed people; every weight is checked: there, of the right shape, finite.

    Raises:
        InputError: the file is missing, damaged, of another format, or its weights do not fit.
    """
    tensors, metadata = read_tensors(Path(path))
    if metadata.get("format") != DRESSED_FORMAT:
        raise InputError(f"weights: {path} has format {metadata.get('format')!r}; {DRESSED_FORMAT!r} is read")
    whole = unpacked(tensors, str(path))
    generator, notes = built(whole, metadata, str(path))
    return DressedCheckpoint(generator=generator, weights_hash=weights_hash(whole), notes=notes)


def packed(tensors: dict[str, Tensor]) -> UInt8[Tensor, " bytes"]:
    """All tensors as deflated bytes, the same each time."""
    return torch.frombuffer(bytearray(zlib.compress(save(tensors), 9)), dtype=torch.uint8)


def unpacked(tensors: dict[str, Tensor], path: str) -> dict[str, Tensor]:
    """The tensors that a file's bytes hold.

    Raises:
        InputError: it holds none, they are damaged, or too many.
    """
    try:
        stream = zlib.decompressobj()
        inner = stream.decompress(tensors[PACKED].numpy().tobytes(), LARGEST)
        if stream.unconsumed_tail:
            raise InputError(f"weights: {path} unpacks to more than {LARGEST >> 20} MiB; download it anew")
        return load(inner)
    except (KeyError, zlib.error, SafetensorError, ValueError, RuntimeError) as error:
        raise InputError(f"weights: what {path} holds is damaged ({error}); download it anew") from error


def built(
    tensors: dict[str, Tensor], metadata: dict[str, str], path: str
) -> tuple[DressedGenerator, dict[str, str]]:
    """The generator that a file's tensors and settings make."""
    try:
        config = from_json(DressedConfig, json.loads(metadata["config"]))
        notes = from_json(dict, json.loads(metadata.get("notes", "{}")))
        require_finite(tensors, path)
        stored = sum(tensor.numel() for tensor in tensors.values())
        with torch.random.fork_rng(devices=[]), Allowance(SLACK * stored + ROOM):
            generator = DressedGenerator(config)
        require_fit(tensors, generator.state_dict(), path)
    except InputError:
        raise
    except (KeyError, TypeError, ValueError, RecursionError, OverflowError, RuntimeError) as error:
        raise InputError(
            f"weights: the configuration in {path} is damaged ({str(error)[:200]}); download the file anew"
        ) from error
    generator.load_state_dict(tensors)
    return generator.eval().requires_grad_(False), {str(k): str(v) for k, v in notes.items()}
