"""Checkpoints of a generator of dressed people: safetensors, the configuration in the file's metadata.

Each garment and the skin are a safetensors file of their own, squeezed into one tensor of bytes: a volume's
whole numbers take a quarter of the room so, and what nobody wears is never unpacked.

    skin, garments.NAME: bytes --lzma--> safetensors --> LearnedSkin, LearnedGarment
"""

import dataclasses
import json
import lzma
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TypeVar

import torch
from jaxtyping import UInt8
from safetensors import SafetensorError
from safetensors.torch import load, save
from torch import Tensor, nn

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
from avatargen.generator.dressed.generator import LearnedGarment, LearnedSkin

DRESSED_FORMAT = "avatargen-dressed-3"
SKIN, GARMENT = "skin", "garments."
LARGEST = 1 << 28  # bytes that a part unpacks to at most

Part = TypeVar("Part", bound=nn.Module)


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class DressedCheckpoint:
    """A generator of dressed people as its file holds it. Parts are unpacked, and checked, when asked for."""

    path: str
    config: DressedConfig
    weights_hash: str
    notes: dict[str, str]
    parts: Mapping[str, UInt8[Tensor, " bytes"]]

    def garment(self, name: str) -> LearnedGarment:
        """One of the garments.

        Raises:
            InputError: its weights are damaged, not finite, or do not fit.
        """
        (config,) = (each for each in self.config.garments if each.name == name)
        return self.part(GARMENT + name, lambda: LearnedGarment(config, self.config))

    def skin(self) -> LearnedSkin:
        """The skins. Raises what `garment` does."""
        return self.part(SKIN, lambda: LearnedSkin(self.config.skin, self.config))

    def part(self, name: str, make: Callable[[], Part]) -> Part:
        """A module with the weights of a part."""
        tensors = unpacked(self.parts[name], self.path)
        require_finite(tensors, self.path)
        stored = sum(tensor.numel() for tensor in tensors.values())
        try:
            with Allowance(SLACK * stored + ROOM):
                module = make()
        except (ValueError, OverflowError, RuntimeError) as error:
            raise InputError(
                f"weights: the settings of {name} in {self.path} are damaged ({str(error)[:200]}); "
                "download the file anew"
            ) from error
        require_fit(tensors, module.state_dict(), self.path)
        module.load_state_dict(tensors)
        return module.eval().requires_grad_(False)


def save_dressed(
    config: DressedConfig,
    parts: Mapping[str, Mapping[str, Tensor]],
    path: str | Path,
    notes: dict[str, str] | None = None,
) -> str:
    """Write a generator, whole or not at all, fractions in half precision; returns the weights' hash. Parts
    are `skin` and `garments.NAME`.

    Raises:
        InputError: the weights are not finite, or the path cannot be written.
    """
    whole: dict[str, Tensor] = {}
    for name, tensors in parts.items():
        halved = {
            key: (tensor.half() if tensor.is_floating_point() else tensor).detach().cpu().contiguous()
            for key, tensor in tensors.items()
        }
        require_finite(halved, str(path))
        whole[name] = packed(halved)
    metadata = {
        "format": DRESSED_FORMAT,
        "config": json.dumps(dataclasses.asdict(config)),
        "notes": json.dumps(notes or {}),
    }
    write_atomically(path, in_fixed_order(save(whole, metadata)))
    return weights_hash(whole)


def load_dressed(path: str | Path) -> DressedCheckpoint:
    """Read a generator of dressed people. Its parts are checked when they are asked for.

    Raises:
        InputError: the file is missing, damaged, of another format, or lacks a part.
    """
    parts, metadata = read_tensors(Path(path))
    if metadata.get("format") != DRESSED_FORMAT:
        raise InputError(f"weights: {path} has format {metadata.get('format')!r}; {DRESSED_FORMAT!r} is read")
    try:
        config = from_json(DressedConfig, json.loads(metadata["config"]))
        notes = from_json(dict, json.loads(metadata.get("notes", "{}")))
    except InputError:
        raise
    except (KeyError, TypeError, ValueError, RecursionError, OverflowError) as error:
        raise InputError(
            f"weights: the configuration in {path} is damaged ({str(error)[:200]}); download the file anew"
        ) from error
    wanted = {SKIN, *(GARMENT + each.name for each in config.garments)}
    if missing := sorted(wanted - set(parts)):
        raise InputError(f"weights: {path} lacks {len(missing)} parts, first {missing[0]}; download it anew")
    return DressedCheckpoint(
        path=str(path),
        config=config,
        weights_hash=weights_hash(parts),
        notes={str(key): str(value) for key, value in notes.items()},
        parts=parts,
    )


def packed(tensors: dict[str, Tensor]) -> UInt8[Tensor, " bytes"]:
    """All tensors as squeezed bytes, the same each time."""
    return torch.frombuffer(bytearray(lzma.compress(save(tensors), preset=9)), dtype=torch.uint8)


def unpacked(part: Tensor, path: str) -> dict[str, Tensor]:
    """The tensors that a part's bytes hold.

    Raises:
        InputError: they are damaged, or too many.
    """
    try:
        stream = lzma.LZMADecompressor()
        inner = stream.decompress(part.numpy().tobytes(), LARGEST)
        if not stream.eof:
            raise InputError(
                f"weights: a part of {path} is cut off or above {LARGEST >> 20} MiB; download it anew"
            )
        return load(inner)
    except (lzma.LZMAError, EOFError, SafetensorError, ValueError, RuntimeError, TypeError) as error:
        raise InputError(f"weights: what {path} holds is damaged ({error}); download it anew") from error
