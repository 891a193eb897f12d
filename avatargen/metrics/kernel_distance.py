"""Kernel distance between two sets of features: the squared maximum mean discrepancy under a cubic kernel, as
the KID has it (Binkowski et al. 2018, "Demystifying MMD GANs", section 4), unbiased for sets of any size.

    k(x, y) = (x.y / F + 1)^3
    MMD^2 = mean k(x, x') over x != x'  +  mean k(y, y') over y != y'  -  2 mean k(x, y)

By definition the KID uses Inception; on other features the distance goes by another name.

Letters: N, M pictures, F features. float64.
"""

import numpy as np
from jaxtyping import Float, Float64

from avatargen.metrics.frechet import BLOCKS


def cubic(a: Float64[np.ndarray, "N F"], b: Float64[np.ndarray, "M F"]) -> Float64[np.ndarray, "N M"]:
    return (a @ b.T / a.shape[1] + 1) ** 3


def kernel_distance(a: Float[np.ndarray, "N F"], b: Float[np.ndarray, "M F"]) -> tuple[float, float]:
    """The distance, which for equal sets is zero on average and can be less, and its standard error, by
    leaving out a tenth of both sets at a time (jackknife). NaN for sets of fewer than two.
    """
    a, b = a.astype(np.float64), b.astype(np.float64)
    kernels = (cubic(a, a), cubic(b, b), cubic(a, b))
    every = [np.ones(len(each), dtype=bool) for each in (a, b)]
    parts = [unbiased(kernels, *(without(keep, block) for keep in every)) for block in range(BLOCKS)]
    return unbiased(kernels, *every), float(np.sqrt((BLOCKS - 1) * np.var(parts)))


def without(keep: np.ndarray, block: int) -> np.ndarray:
    """All but every tenth, from that one on."""
    left = keep.copy()
    left[block::BLOCKS] = False
    return left


def unbiased(
    kernels: tuple[Float64[np.ndarray, "N N"], Float64[np.ndarray, "M M"], Float64[np.ndarray, "N M"]],
    first: np.ndarray,
    second: np.ndarray,
) -> float:
    """The estimate over those pictures of both sets that are kept."""
    aa, bb = kernels[0][np.ix_(first, first)], kernels[1][np.ix_(second, second)]
    n, m = len(aa), len(bb)
    if min(n, m) < 2:
        return float("nan")
    own = [(k.sum() - np.trace(k)) / (c * (c - 1)) for k, c in ((aa, n), (bb, m))]
    return float(sum(own) - 2 * kernels[2][np.ix_(first, second)].mean())
