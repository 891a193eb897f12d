"""What pictures are compared by: the built-in features, or a network from a file of the user's.

The built-in ones are fixed random convolutions at three scales, their means and standard deviations over the
picture. They need no weights and no download, and tell apart pictures whose colours, edges and layout differ.
A distance by them is a Frechet distance, but never the FID, which by definition uses Inception.

Letters: N pictures, S pixels a side, F features.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn import functional as F

from avatargen.errors import InputError

Features = Callable[[Float[Tensor, "N 3 S S"]], Float[Tensor, "N F"]]

WIDTH = 16  # channels a scale
INCEPTION_WIDTH = 2048
INCEPTION_SIZE = 299
CHUNK = 64


def random_features(images: Float[Tensor, "N 3 S S"]) -> Float[Tensor, "N F"]:
    """The built-in features of sRGB pictures in 0..1: 32 a scale, 96 in all."""
    draw = torch.Generator().manual_seed(0)
    kernel = torch.randn(WIDTH, 3, 5, 5, generator=draw)
    kernel = kernel - kernel.mean(dim=(2, 3), keepdim=True) * 0.5
    kernel = (kernel / kernel.flatten(1).norm(dim=1)[:, None, None, None]).to(images)
    x, rows = images * 2 - 1, []
    for _ in range(3):
        seen = F.relu(F.conv2d(F.pad(x, (2, 2, 2, 2), mode="replicate"), kernel))
        rows += [seen.mean(dim=(2, 3)), seen.std(dim=(2, 3))]
        x = F.avg_pool2d(x, 2)
    return torch.cat(rows, dim=1)


def load_inception(path: Path) -> Features:
    """Inception as a TorchScript file: pictures in 0..255 to [N, 2048], as the FID is measured by.

    Raises:
        InputError: no such file, or it gives something else.
    """
    try:
        network = torch.jit.load(str(path), map_location="cpu").eval()
        shape = tuple(network(torch.zeros(1, 3, INCEPTION_SIZE, INCEPTION_SIZE)).shape)
    except (RuntimeError, ValueError, OSError) as error:
        reason = str(error).splitlines()[0]
        raise InputError(f"eval: {path} is no TorchScript network of pictures ({reason})") from error
    if shape != (1, INCEPTION_WIDTH):
        raise InputError(
            f"eval: {path} gives {shape} for one picture; Inception gives (1, {INCEPTION_WIDTH})"
        )

    def features(images: Float[Tensor, "N 3 S S"]) -> Float[Tensor, "N F"]:
        wide = F.interpolate(images, size=(INCEPTION_SIZE,) * 2, mode="bilinear", align_corners=False)
        return network((wide * 255).round().clamp(0, 255))

    return features


@torch.no_grad()
def all_features(network: Features, images: Float[Tensor, "N 3 S S"]) -> Float[np.ndarray, "N F"]:
    """Features of many pictures, some at a time."""
    return torch.cat([network(part) for part in images.split(CHUNK)]).cpu().numpy()
