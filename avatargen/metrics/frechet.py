"""Frechet distance between two sets of features: of Gaussians with their means and covariances.

    d^2 = |m1 - m2|^2 + tr(C1 + C2 - 2 (C1 C2)^(1/2))

Letters: N pictures, F features. float64.
"""

import numpy as np
from jaxtyping import Float, Float64

BLOCKS = 10  # of the jackknife


def frechet_distance(a: Float[np.ndarray, "N F"], b: Float[np.ndarray, "M F"]) -> float:
    """Squared distance, as is usual; the trace of the root comes from eigenvalues of a symmetric product."""
    a, b = a.astype(np.float64), b.astype(np.float64)
    first, second = covariance(a), covariance(b)
    root = symmetric_root(first)
    spectrum = np.linalg.eigvalsh(root @ second @ root)
    cross = np.sqrt(np.maximum(spectrum, 0)).sum()
    apart = np.square(a.mean(axis=0) - b.mean(axis=0)).sum()
    return float(max(apart + np.trace(first) + np.trace(second) - 2 * cross, 0.0))


def covariance(features: Float64[np.ndarray, "N F"]) -> Float64[np.ndarray, "F F"]:
    centered = features - features.mean(axis=0)
    return centered.T @ centered / max(len(features) - 1, 1)


def symmetric_root(matrix: Float64[np.ndarray, "F F"]) -> Float64[np.ndarray, "F F"]:
    values, vectors = np.linalg.eigh(matrix)
    return (vectors * np.sqrt(np.maximum(values, 0))) @ vectors.T


def distance_error(a: Float[np.ndarray, "N F"], b: Float[np.ndarray, "M F"]) -> float:
    """Standard error of the distance, by leaving out a tenth of both sets at a time (jackknife)."""
    parts = [
        frechet_distance(
            np.delete(a, slice(i, None, BLOCKS), axis=0), np.delete(b, slice(i, None, BLOCKS), axis=0)
        )
        for i in range(BLOCKS)
    ]
    return float(np.sqrt((BLOCKS - 1) * np.var(parts)))
