"""Random numbers that depend on nothing but a seed and their place: the same on every device, and made there.

Each is a hash of both (SplitMix64's finaliser, Steele et al. 2014). Letters: B seeds, N numbers.
"""

import torch
from jaxtyping import Float, Int64
from torch import Tensor

GOLDEN = -0x61C8864680B583EB  # 2^64 over the golden ratio, as a signed number
FIRST, SECOND = -0x40A7B892E31B1A47, -0x6B2FB644ECCEEE15
STREAM = 1 << 40  # numbers that a stream has room for


def uniform(seeds: Int64[Tensor, " B"], count: int, stream: int) -> Float[Tensor, "B N"]:
    """Numbers in 0 <= u < 1; those of different streams of a seed have nothing to do with each other."""
    place = torch.arange(1, count + 1, device=seeds.device) + stream * STREAM
    x = seeds[:, None] + place * GOLDEN
    x = (x ^ shifted(x, 30)) * FIRST
    x = (x ^ shifted(x, 27)) * SECOND
    return shifted(x ^ shifted(x, 31), 40).float() * 2.0**-24


def shifted(x: Int64[Tensor, "*any"], bits: int) -> Int64[Tensor, "*any"]:
    """To the right, as a number without a sign."""
    return (x >> bits) & ((1 << (64 - bits)) - 1)


def normal(seeds: Int64[Tensor, " B"], count: int, stream: int) -> Float[Tensor, "B N"]:
    """Standard normal numbers, by Box and Muller's transform; takes this stream and the next."""
    radius = (-2 * torch.log1p(-uniform(seeds, count, stream))).sqrt()
    return radius * torch.cos(2 * torch.pi * uniform(seeds, count, stream + 1))
