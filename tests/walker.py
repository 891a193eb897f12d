"""A small whole person without a network: the capsule body as a rigged, textured asset with sliders."""

import functools
from dataclasses import replace

import numpy as np

from assets import Asset, BuildConfig, build
from tests.test_pipeline import SMALL, stranger


@functools.cache
def walker(betas: tuple[float, ...] = (1.0, -0.5, 0.25), **settings: object) -> Asset:
    """Built with these betas; `settings` are BuildConfig's."""
    config: BuildConfig = replace(SMALL, morphs=True, **settings)  # pyright: ignore[reportArgumentType]
    return build(replace(stranger(), betas=np.array(betas, dtype=np.float32)), config)
