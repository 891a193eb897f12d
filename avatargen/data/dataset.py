"""A folder of pictures with labels, as training and evaluation read it.

Letters: N pictures, S pixels a side, J joints, b directions of shape.
"""

import io
import struct
import warnings
import zlib
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float
from PIL import Image
from torch import Tensor

from avatargen.data.labels import FILE_NAME, Labels, read_labels
from avatargen.data.units import DEPTH_UNIT
from avatargen.eight_bits import eight_bits
from avatargen.errors import InputError
from avatargen.run_folder import digest_files

FORMATS = ("PNG", "JPEG", "WEBP")
MOST_PIXELS = 4096  # along a side


@dataclass(frozen=True, kw_only=True, eq=False)
class Pictures:
    """Pictures of one folder at `size` pixels a side, read from disk as they are asked for."""

    folder: Path
    labels: Labels
    size: int

    def __len__(self) -> int:
        return len(self.labels)

    def image(self, index: int) -> Float[Tensor, "3 S S"]:
        """sRGB 0..1."""
        return torch.from_numpy(self.read("images", index, "RGB").astype(np.float32) / 255).permute(2, 0, 1)

    def mask(self, index: int) -> Float[Tensor, "S S"]:
        """Coverage 0..1."""
        return torch.from_numpy(self.read("masks", index, "L").astype(np.float32) / 255)

    def depth(self, index: int) -> Float[Tensor, "H H"]:
        """True distance along the ray in metres, at the size it was made in; 0 beside the person."""
        picture = open_picture(self.path("depth", index))
        return torch.from_numpy(np.asarray(picture).astype(np.float32) * DEPTH_UNIT)

    def path(self, kind: str, index: int) -> Path:
        return self.folder / kind / self.labels.names[index].removeprefix("images/")

    def read(self, kind: str, index: int, mode: str) -> np.ndarray:
        path = self.path(kind, index)
        made = eight_bits(open_picture(path)).convert(mode)
        if made.width != made.height or made.width % self.size:
            raise InputError(
                f"data: {path} is {made.width} x {made.height} pixels; a square multiple of {self.size} "
                "is needed"
            )
        return np.asarray(made.reduce(made.width // self.size))

    def part(self, which: slice) -> "Pictures":
        """Some of the pictures."""
        labels = self.labels
        weights = None if labels.weights is None else labels.weights[which]
        arrays = {"camera": labels.camera[which], "pose": labels.pose[which], "betas": labels.betas[which]}
        return replace(self, labels=replace(labels, names=labels.names[which], weights=weights, **arrays))

    def contents(self) -> str:
        """A hash of labels and pictures: the same of the same data set, wherever it lies."""
        kinds = ("images", "masks", "depth")
        files = [self.path(kind, i) for i in range(len(self)) for kind in kinds]
        return digest_files(self.folder, [self.folder / FILE_NAME, *files])

    def choose(self, shape: tuple[int, ...], random: torch.Generator) -> Tensor:
        """Random pictures, each as often as its weight says."""
        weights = self.labels.weights
        if weights is None:
            return torch.randint(len(self), shape, generator=random)
        ends = torch.from_numpy(np.cumsum(weights, dtype=np.float64))
        place = torch.rand(shape, generator=random, dtype=torch.float64) * ends[-1]
        return torch.searchsorted(ends, place, right=True).clamp_max(len(self) - 1)

    def row(self, indices: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Cameras [N 25], poses [N J 3] and betas [N b] of pictures."""
        chosen = indices.numpy()
        labels = self.labels
        return tuple(torch.from_numpy(a[chosen]) for a in (labels.camera, labels.pose, labels.betas))  # pyright: ignore


def open_picture(path: Path) -> Image.Image:
    """Raises InputError where there is no whole picture, or one too large."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            # from memory: of a file, Pillow would take as much as a forged length says
            with Image.open(io.BytesIO(path.read_bytes()), formats=FORMATS) as picture:
                if max(picture.size) > MOST_PIXELS:
                    raise ValueError(
                        f"{picture.width} x {picture.height}; at most {MOST_PIXELS} a side are read"
                    )
                return picture.copy()
    except (OSError, SyntaxError, ValueError, OverflowError, struct.error, zlib.error) as error:
        raise InputError(f"data: {path} is no whole picture ({error}); make or prepare it anew") from error
    except (Image.DecompressionBombError, Warning) as error:
        raise InputError(f"data: {path} is no usual picture ({error}); make or prepare it anew") from error


def open_pictures(folder: Path, size: int) -> Pictures:
    """The data set in a folder.

    Raises:
        InputError: the folder holds no readable dataset.json, or no pictures.
    """
    labels = read_labels(folder / FILE_NAME)
    if not len(labels):
        raise InputError(f"data: {folder} lists no pictures; make or prepare some")
    return Pictures(folder=folder, labels=labels, size=size)
