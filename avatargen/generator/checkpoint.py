"""Checkpoints: the generator's weights as safetensors, its configuration as JSON in the file's metadata. No
pickle.

The weights' hash is sha256 over every tensor's name, shape, type and bytes in order of name: it names the
weights, not the file.
"""

import dataclasses
import hashlib
import json
import typing
from pathlib import Path
from types import UnionType

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from torch import Tensor
from torch.overrides import TorchFunctionMode

from avatargen.atomic import write_atomically
from avatargen.errors import InputError
from avatargen.generator.config import GeneratorConfig
from avatargen.generator.generator import AvatarGenerator

FORMAT = "avatargen-1"
SLACK, ROOM = (
    20,
    1 << 22,
)  # numbers that making a network may pass through, for each one stored and beside them


@dataclasses.dataclass(frozen=True, kw_only=True)
class Checkpoint:
    """A generator read from a file, ready to run, with its weights' hash and the notes saved beside it."""

    generator: AvatarGenerator
    weights_hash: str
    notes: dict[str, str]


def save_checkpoint(
    generator: AvatarGenerator, path: str | Path, notes: dict[str, str] | None = None, *, half: bool = False
) -> str:
    """Write the generator's weights and configuration, whole or not at all; returns the weights' hash.

    `notes` are short texts kept in the metadata (how it was trained, licence). `half` rounds the weights to
    half precision, for a file of half the size; they are read as single precision again.

    Raises:
        InputError: the weights are not finite, or the path cannot be written.
    """
    tensors = {name: tensor.detach().cpu().contiguous() for name, tensor in generator.state_dict().items()}
    if half:
        tensors = {name: t.half() if t.is_floating_point() else t for name, t in tensors.items()}
    require_finite(tensors, str(path))
    metadata = {
        "format": FORMAT,
        "config": json.dumps(dataclasses.asdict(generator.config)),
        "notes": json.dumps(notes or {}),
    }
    write_atomically(path, in_fixed_order(save(tensors, metadata)))
    return weights_hash(tensors)


def in_fixed_order(file: bytes) -> bytes:
    """The same safetensors file with its metadata sorted: the library writes them in an order of chance."""
    length = int.from_bytes(file[:8], "little")
    header = json.loads(file[8 : 8 + length])
    header["__metadata__"] = dict(sorted(header["__metadata__"].items()))
    text = json.dumps(header, separators=(",", ":")).encode()
    text = text.ljust(-len(text) % 8 + len(text))  # tensors stay aligned to 8 bytes
    return len(text).to_bytes(8, "little") + text + file[8 + length :]


def load_checkpoint(path: str | Path) -> Checkpoint:
    """Read a generator; every weight is checked to be there, of the right shape, and finite.

    Raises:
        InputError: the file is missing, cut off, damaged, of another format, or its weights do not fit or are
        NaN.
    """
    tensors, metadata = read_tensors(Path(path))
    if metadata.get("format") != FORMAT:
        raise InputError(f"weights: {path} has format {metadata.get('format')!r}; {FORMAT!r} is read")
    try:
        config = from_json(GeneratorConfig, json.loads(metadata["config"]))
        notes = from_json(dict, json.loads(metadata.get("notes", "{}")))
        require_finite(tensors, str(path))
        stored = sum(tensor.numel() for tensor in tensors.values())
        with torch.random.fork_rng(devices=[]), Allowance(SLACK * stored + ROOM):
            generator = AvatarGenerator(config)
        require_fit(tensors, generator.state_dict(), str(path))
    except InputError:
        raise
    except (KeyError, TypeError, ValueError, RecursionError, OverflowError, RuntimeError) as error:
        raise InputError(
            f"weights: the configuration in {path} is damaged ({str(error)[:200]}); download the file anew"
        ) from error
    generator.load_state_dict(tensors)
    return Checkpoint(
        generator=generator.eval(),
        weights_hash=weights_hash(tensors),
        notes={str(name): str(note) for name, note in notes.items()},
    )


class Allowance(TorchFunctionMode):
    """Ends the making of networks that take more numbers than a file can fill."""

    def __init__(self, numbers: int) -> None:
        super().__init__()
        self.left = numbers

    def __torch_function__(
        self, func: typing.Any, types: typing.Any, args: tuple = (), kwargs: dict | None = None
    ) -> typing.Any:
        made = func(*args, **kwargs or {})
        self.left -= made.numel() if isinstance(made, Tensor) else 0
        if self.left < 0:
            raise ValueError("it asks for larger networks than the file holds")
        return made


def read_tensors(path: Path) -> tuple[dict[str, Tensor], dict[str, str]]:
    """All tensors and the metadata of a safetensors file.

    Raises:
        InputError: missing, cut off or damaged.
    """
    if not path.is_file():
        raise InputError(f"weights: there is no file {path}; give the path of a .safetensors checkpoint")
    try:
        with safe_open(path, framework="pt") as file:
            return {name: file.get_tensor(name) for name in list(file.keys())}, file.metadata() or {}
    except (SafetensorError, OSError) as error:
        raise InputError(
            f"weights: {path} is no whole safetensors file ({error}); download it anew"
        ) from error


def format_of(path: Path) -> str | None:
    """What kind of checkpoint a file says it is; nothing for one that cannot be read or does not say."""
    try:
        with safe_open(path, framework="pt") as file:
            return (file.metadata() or {}).get("format")
    except (SafetensorError, OSError):
        return None


def require_finite(tensors: dict[str, Tensor], path: str) -> None:
    for name, tensor in tensors.items():
        if tensor.is_floating_point() and not torch.isfinite(tensor).all():
            raise InputError(f"weights: {name} of {path} holds NaN or infinity; train or download anew")


def require_fit(tensors: dict[str, Tensor], wanted: dict[str, Tensor], path: str) -> None:
    """Names, shapes and types must be those the configuration asks for."""
    if missing := sorted(set(wanted) - set(tensors)):
        raise InputError(
            f"weights: {path} lacks {len(missing)} tensors, first {missing[0]}; download it anew"
        )
    if extra := sorted(set(tensors) - set(wanted)):
        raise InputError(
            f"weights: {path} has {len(extra)} unknown tensors, first {extra[0]}; download it anew"
        )
    for name, tensor in tensors.items():
        readable = (wanted[name].dtype, torch.float16 if wanted[name].is_floating_point() else None)
        if tensor.shape != wanted[name].shape or tensor.dtype not in readable:
            raise InputError(
                f"weights: {name} of {path} is {tensor.dtype} {tuple(tensor.shape)}; "
                f"{wanted[name].dtype} {tuple(wanted[name].shape)} is needed"
            )


def weights_hash(tensors: dict[str, Tensor]) -> str:
    """sha256 over names, shapes, types and bytes."""
    digest = hashlib.sha256()
    for name in sorted(tensors):
        tensor = tensors[name].detach().cpu().contiguous()
        digest.update(f"{name} {tuple(tensor.shape)} {tensor.dtype}\n".encode())
        digest.update(tensor.flatten().view(torch.uint8).numpy().tobytes())
    return digest.hexdigest()


def from_json(kind: typing.Any, value: typing.Any) -> typing.Any:
    """Rebuild nested dataclasses and tuples from JSON, by their declared types.

    Raises:
        TypeError: an unknown field, or a value of the wrong type.
    """
    if dataclasses.is_dataclass(kind):
        if not isinstance(value, dict):
            raise TypeError(f"{value!r} is no set of settings")
        types = typing.get_type_hints(kind)
        if unknown := set(value) - set(types):
            raise TypeError(f"unknown settings {sorted(unknown)}")
        return kind(**{name: from_json(types[name], item) for name, item in value.items()})  # pyright: ignore
    if typing.get_origin(kind) is UnionType:
        return (
            None
            if value is None
            else from_json(next(k for k in typing.get_args(kind) if k is not type(None)), value)
        )
    if typing.get_origin(kind) is tuple:
        kinds = typing.get_args(kind)
        kinds = [kinds[0]] * len(value) if kinds[-1] is Ellipsis else kinds
        return tuple(from_json(k, item) for k, item in zip(kinds, value, strict=True))
    if not isinstance(value, (int, float) if kind is float else kind):
        raise TypeError(f"{value!r} is no {kind.__name__}")
    return value
