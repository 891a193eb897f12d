"""A folder of pictures with labels, as training and evaluation read it.

The pictures are files of their own, or all in one (`avatargen.data.packed`), as is found in the folder.

Letters: N pictures, S pixels a side, J joints, b directions of shape.
"""

import io
import struct
import warnings
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float, UInt8, UInt16
from PIL import Image
from torch import Tensor

from avatargen.data.labels import FILE_NAME, Labels, read_labels
from avatargen.data.packed import PACK_NAME, Pack, read_pack
from avatargen.data.units import DEPTH_UNIT
from avatargen.eight_bits import eight_bits
from avatargen.errors import InputError
from avatargen.run_folder import digest, digest_arrays, digest_files

FORMATS = ("PNG", "JPEG", "WEBP")
MOST_PIXELS = 4096  # along a side
KINDS = ("images", "masks", "depth")


@dataclass(frozen=True, kw_only=True, eq=False)
class Pictures:
    """Pictures of one folder at `size` pixels a side, read from disk as they are asked for."""

    folder: Path
    labels: Labels
    size: int
    pack: Pack | None = None

    def __len__(self) -> int:
        return len(self.labels)

    def pixels(self, indices: Tensor) -> UInt8[Tensor, "N 3 S S"]:
        """sRGB 0..255 of several pictures."""
        return torch.from_numpy(self.read("images", indices.tolist())).permute(0, 3, 1, 2)

    def image(self, index: int) -> Float[Tensor, "3 S S"]:
        """sRGB 0..1."""
        return self.pixels(torch.tensor([index]))[0].float() / 255

    def mask(self, index: int) -> Float[Tensor, "S S"]:
        """Coverage 0..1."""
        return torch.from_numpy(self.read("masks", [index])[0]).float() / 255

    def depth(self, index: int) -> Float[Tensor, "H H"]:
        """True distance along the ray in metres, at the size it was made in; 0 beside the person."""
        return torch.from_numpy(self.depth_steps(index).astype(np.float32) * DEPTH_UNIT)

    def depth_steps(self, index: int) -> UInt16[np.ndarray, "H H"]:
        """The same in steps of DEPTH_UNIT, as it is stored."""
        name = self.labels.names[index]
        if self.pack is not None and self.pack.holds([name]):
            return self.pack.depth(name)
        return np.asarray(open_picture(self.path("depth", index))).astype(np.uint16)

    def holds(self, kind: str) -> bool:
        """Whether there are images, masks or depth: those of the first picture tell for all."""
        if self.pack is not None and self.pack.holds(self.labels.names[:1]):
            return kind in self.pack.arrays
        return self.path(kind, 0).exists()

    def own_size(self) -> int:
        """Pixels a side of the first picture as it is stored."""
        if self.pack is not None and self.pack.holds(self.labels.names[:1]):
            return self.pack.arrays["images"].shape[1]
        return open_picture(self.path("images", 0)).width

    def path(self, kind: str, index: int) -> Path:
        """Where a picture lies that has a file of its own."""
        return self.folder / kind / self.labels.names[index].removeprefix("images/")

    def read(self, kind: str, indices: Sequence[int]) -> UInt8[np.ndarray, "N S S *c"]:
        """Images or masks. Raises InputError where one is broken, or of no multiple of the size."""
        names = [self.labels.names[i] for i in indices]
        if self.pack is not None and self.pack.holds(names):
            return self.pack.read(kind, names, self.size)
        if len(indices) != 1:
            return np.concatenate([self.read(kind, [i]) for i in indices])
        path = self.path(kind, indices[0])
        made = eight_bits(open_picture(path)).convert("RGB" if kind == "images" else "L")
        if made.width != made.height or made.width % self.size:
            raise InputError(
                f"data: {path} is {made.width} x {made.height} pixels; a square multiple of {self.size} "
                "is needed"
            )
        return np.array(made.reduce(made.width // self.size))[None]

    def part(self, which: slice) -> "Pictures":
        """Some of the pictures."""
        labels = self.labels
        weights = None if labels.weights is None else labels.weights[which]
        arrays = {"camera": labels.camera[which], "pose": labels.pose[which], "betas": labels.betas[which]}
        return replace(self, labels=replace(labels, names=labels.names[which], weights=weights, **arrays))

    def contents(self) -> str:
        """A hash of labels and pictures: the same of the same data set, wherever it lies."""
        if self.pack is not None and self.pack.holds(self.labels.names):
            self.pack.check()
            labels = digest(self.folder / FILE_NAME)
            return digest_arrays({**self.pack.digests, "labels": labels, "names": self.labels.names})
        files = [self.path(kind, i) for i in range(len(self)) for kind in KINDS]
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
    """The data set in a folder. Pictures that its file of all does not hold are files of their own.

    Raises:
        InputError: the folder holds no readable dataset.json, no pictures, or a damaged file of them.
    """
    labels = read_labels(folder / FILE_NAME)
    if not len(labels):
        raise InputError(f"data: {folder} lists no pictures; make or prepare some")
    if not (folder / PACK_NAME).exists():
        return Pictures(folder=folder, labels=labels, size=size)
    pack = read_pack(folder / PACK_NAME)
    pictures = Pictures(folder=folder, labels=labels, size=size, pack=pack)
    for i, name in enumerate(labels.names):
        if name not in pack.rows and not pictures.path("images", i).exists():
            raise InputError(
                f"data: {pack.path} holds no {name}, which {FILE_NAME} lists; pack the data set anew"
            )
    return pictures
