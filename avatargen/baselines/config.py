"""What the configurations of all baselines share.

The box is observed space in metres, the person upright at its axis and facing +z.
"""

from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np

from avatargen.body.model import CanonicalBody
from avatargen.errors import InputError
from avatargen.generator.config import MAX_SIZE, MappingConfig, RenderConfig, body_hash, triple
from avatargen.ranges import require_ranges

CAMERA = 25  # numbers of a camera
MARGIN = 0.1  # metres of clothes beyond outstretched hands
TALLER, LOWER = (
    0.15,
    0.35,
)  # metres by which tall people reach beyond the body of mean shape, above and below it
FORWARD = 0.75  # how far limbs reach to the front and to the back, of how far they reach aside


@dataclass(frozen=True, kw_only=True)
class BaselineConfig:
    """Mapping network, rendering, and what depends on the body, which `for_body` fills in.

    Raises:
        InputError: a size that nothing can be made of.
    """

    mapping: MappingConfig = field(default_factory=MappingConfig)
    render: RenderConfig = field(default_factory=RenderConfig)
    features: int = 32  # what the renderer collects; the first three are the colour
    low: tuple[float, float, float] = (-1.0, -1.2, -0.75)
    high: tuple[float, float, float] = (1.0, 1.0, 0.75)
    body_hash: str = ""

    def __post_init__(self) -> None:
        for part in (self, self.mapping, self.render):
            for name, value in vars(part).items():
                low = int(name != "camera_features")
                if isinstance(value, int) and not isinstance(value, bool) and not low <= value <= MAX_SIZE:
                    raise InputError(f"baseline config: {name} = {value}; it must be {low} to {MAX_SIZE}")
        require_ranges(self, "baseline config", {"features": (4, MAX_SIZE)})
        require_ranges(self.render, "baseline config", {"samples": (2, MAX_SIZE)})
        if not all(-100 < low < high < 100 for low, high in zip(self.low, self.high, strict=True)):
            raise InputError(f"baseline config: the box from {self.low} to {self.high} m holds nobody")
        steps = self.render.image_size / self.render.raw_size
        if steps < 1 or np.log2(steps) % 1:
            raise InputError(
                f"baseline config: image size is {steps} times the raw size; a power of two is needed"
            )


AnyConfig = TypeVar("AnyConfig", bound=BaselineConfig)


def for_body(config: AnyConfig, body: CanonicalBody, render: RenderConfig) -> AnyConfig:
    """With the box that a body of this skeleton reaches, its label's length, and a run's rendering."""
    label = CAMERA + 3 * len(body.parents) + body.source.shapedirs.shape[2]
    aside = np.abs(body.vertices[:, 0]).max() + MARGIN
    below, above = body.vertices[:, 1].min() - LOWER, body.vertices[:, 1].max() + TALLER
    return replace(
        config,
        mapping=replace(config.mapping, camera_size=label),
        render=render,
        low=triple(np.array([-aside, below, -FORWARD * aside])),
        high=triple(np.array([aside, above, FORWARD * aside])),
        body_hash=body_hash(body),
    )


def told(
    *, z_size: int, features: int, width: int, layers: int, learning_rate_multiplier: float = 1.0
) -> MappingConfig:
    """A mapping network as StyleGAN2's, told the label by an embedding of `features` numbers."""
    return MappingConfig(
        z_size=z_size,
        camera_features=features,
        w_size=width,
        width=width,
        layers=layers,
        normalize=True,
        sign_gain=0.0,
        learning_rate_multiplier=learning_rate_multiplier,
    )
