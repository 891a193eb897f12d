"""One person in a small file: what they are and wear, and what photographs show of them.

    Saved --encode--> person.safetensors --read_person--> Saved

What is told in words is JSON in the file's metadata, arrays are tensors, photographs PNG pictures whose
fourth channel tells where the person is. No pickle. A file names the weights and the body it was made with.
"""

import dataclasses
import io
import json
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float32, Float64
from PIL import Image
from safetensors import SafetensorError
from safetensors.torch import load, save
from torch import Tensor

from avatargen.errors import InputError
from avatargen.export.photo_pixels import Look
from avatargen.generator.checkpoint import from_json, in_fixed_order
from avatargen.photo.camera import Pinhole
from avatargen.photo.picture import LARGEST_SIDE
from avatargen.photo.problem import Fit
from avatargen.photo.seeing.pose import NAMES
from avatargen.wardrobe.makehuman.choose import Attributes
from exporters.png import encode_png

FORMAT = "avatargen-person-1"
LARGEST = 1 << 28  # bytes of a file
DAMAGES = (  # what reading damaged words and pictures ends in
    *(KeyError, TypeError, ValueError, AssertionError, RecursionError, OverflowError),
    *(OSError, SyntaxError, Image.DecompressionBombError),
)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Words:
    """What a file tells in words; `looks` name each photograph's focal length, pixels, and how tall the body
    fitted to it is, metres. `photo` are the facts of the photographs, as JSON."""

    attributes: Attributes
    seed: int
    height: float
    said: tuple[tuple[str, str], ...]
    weights_hash: str
    body_hash: str
    looks: tuple[tuple[float, float], ...] = ()
    photo: str = ""


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Saved:
    """A person. `turns` are the rotations of the first photograph's pose; `looks` and the colours `stuffs`
    are there where the photographs' pixels are on the texture."""

    words: Words
    betas: Float32[np.ndarray, " b"]
    turns: Float64[np.ndarray, "J 3"] | None = None
    looks: tuple[Look, ...] = ()
    stuffs: Float64[np.ndarray, "N 3"] | None = None


def encode_person(saved: Saved) -> bytes:
    """The file. Same person, same bytes."""
    arrays: dict[str, np.ndarray] = {"betas": saved.betas}
    if saved.turns is not None:
        arrays["turns"] = saved.turns
    if saved.stuffs is not None:
        arrays["stuffs"] = saved.stuffs
    for number, look in enumerate(saved.looks):
        fit, steps = look.fit, np.rint(255 * look.mask).astype(np.uint8)
        png = encode_png(np.concatenate([look.pixels, steps[..., None]], axis=2))
        found = {
            "picture": np.frombuffer(png, np.uint8).copy(),
            "landmarks": look.landmarks,
            "betas": fit.betas,
            "turns": fit.rotations,
            "move": fit.move,
        }
        found |= {} if look.face is None else {"face": look.face}
        arrays |= {f"looks.{number}.{name}": array for name, array in found.items()}
    tensors = {name: torch.from_numpy(np.array(array, order="C")) for name, array in arrays.items()}
    metadata = {"format": FORMAT, "person": json.dumps(dataclasses.asdict(saved.words))}
    return in_fixed_order(save(tensors, metadata))


def read_person(path: Path) -> Saved:
    """Read a person.

    Raises:
        InputError: the file is missing, damaged, or holds no person.
    """
    try:
        if path.stat().st_size > LARGEST:
            raise InputError(f"person: {path} is larger than {LARGEST >> 20} MiB, which no person's file is")
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"person: cannot read {path} ({error.strerror or error}); check the path") from error
    return decode_person(data, str(path))


def decode_person(data: bytes, name: str) -> Saved:
    """The person of a file's bytes; `name` is what errors call it.

    Raises:
        InputError: they are damaged, or hold no person.
    """
    tensors, metadata = decode(data, name)
    if metadata.get("format") != FORMAT:
        raise InputError(
            f"person: {name} holds {metadata.get('format')!r}, wanted {FORMAT!r}; give a file that "
            "--save-person wrote"
        )
    try:
        return person_of(tensors, json.loads(metadata["person"]))
    except DAMAGES as error:
        raise InputError(f"person: {name} is damaged ({str(error)[:120]}); save the person anew") from error


def decode(data: bytes, name: str) -> tuple[dict[str, Tensor], dict[str, str]]:
    """All tensors, finite, and the metadata. Raises InputError for what is no whole safetensors file."""
    try:
        tensors = load(data)
        metadata = json.loads(data[8 : 8 + int.from_bytes(data[:8], "little")]).get("__metadata__", {})
    except (SafetensorError, ValueError) as error:
        raise InputError(
            f"person: {name} is no whole safetensors file; give a file that --save-person wrote"
        ) from error
    bad = [key for key, t in tensors.items() if t.is_floating_point() and not torch.isfinite(t).all()]
    if bad:
        raise InputError(f"person: {bad[0]} of {name} holds NaN or infinity; save the person anew")
    return tensors, metadata


def person_of(tensors: dict[str, Tensor], told: Any) -> Saved:
    """The person that a file's parts make. Raises ValueError, TypeError or KeyError where they do not."""
    words: Words = from_json(Words, told)
    left = dict(tensors)

    def take(name: str, *shape: int | None, kind: torch.dtype = torch.float64) -> Any:
        found = left.pop(name)
        fits = len(shape) == found.ndim and all(
            n in (None, m) for n, m in zip(shape, found.shape, strict=True)
        )
        if not fits or found.dtype != kind:
            raise ValueError(f"{name} is {found.dtype} {tuple(found.shape)}")
        return found.numpy()

    betas = take("betas", None, kind=torch.float32)
    turns = take("turns", None, 3) if words.photo else None
    if words.photo and not isinstance(json.loads(words.photo), dict):
        raise ValueError("what it tells of photographs is no object")
    looks = []
    for number, (focal, height) in enumerate(words.looks):
        at = f"looks.{number}."
        pixels, mask = read_picture(take(at + "picture", None, kind=torch.uint8).tobytes())
        if not focal > 0 or turns is None:
            raise ValueError(f"{at} has a focal length of {focal}, or no pose")
        fit = Fit(
            betas=take(at + "betas", None),
            rotations=take(at + "turns", len(turns), 3),
            move=take(at + "move", 3),
            camera=Pinhole(width=pixels.shape[1], height=pixels.shape[0], focal=focal),
            height=height,
            height_known=True,
            uncertain=(),
        )
        face = take(at + "face", None, 2) if at + "face" in left else None
        landmarks = take(at + "landmarks", len(NAMES), 2)
        looks.append(Look(pixels=pixels, mask=mask, landmarks=landmarks, face=face, fit=fit))
    stuffs = take("stuffs", None, 3) if looks else None
    if left:
        raise ValueError(f"unknown {sorted(left)[0]}")
    return Saved(words=words, betas=betas, turns=turns, looks=tuple(looks), stuffs=stuffs)


def read_picture(png: bytes) -> tuple[np.ndarray, Float32[np.ndarray, "H L"]]:
    """Pixels and mask of a picture that a file holds. Raises ValueError where it is none of ours."""
    image = Image.open(io.BytesIO(png), formats=("PNG",))
    if image.mode != "RGBA" or max(image.size) > LARGEST_SIDE:
        raise ValueError(f"a picture is {image.mode} {image.width} x {image.height}")
    found = np.asarray(image)
    return np.ascontiguousarray(found[..., :3]), found[..., 3].astype(np.float32) / 255
