"""What adversarial training and the metrics ask of a model that makes pictures of people.

AvatarGen's generator is one such model; those that it is compared with (`avatargen/baselines`) are others.
All are told the same labels and judged by the same discriminator.

Letters: B pictures, Z size of the latent, J joints, b directions of shape.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from jaxtyping import Float, Int64
from torch import Tensor

from avatargen.generator.config import RenderConfig
from avatargen.generator.picture import Picture


@dataclass(frozen=True, kw_only=True)
class Asked:
    """Which pictures are asked for: latents and labels, all on the model's device."""

    z: Float[Tensor, "B Z"]
    other_z: Float[Tensor, "B Z"]  # the second latent of mixed styles
    crossover: int  # resolution block from which the second latent rules; 0: none is mixed
    camera: Float[Tensor, "B 25"]
    mapped_camera: Float[Tensor, "B 25"]  # under which the latent is mapped
    pose: Float[Tensor, "B J 3"]  # axis-angle, radians
    betas: Float[Tensor, "B b"]
    seeds: Int64[Tensor, " B"] | None  # of samples along rays; none: they stand in the middle of their bins


@dataclass(frozen=True, kw_only=True)
class Generated:
    """Pictures, and the model's own losses on the people in them, weighted, by the names of the log.

    The losses are asked for only in the generator's half of a step.
    """

    picture: Picture
    losses: Callable[[], dict[str, Float[Tensor, ""]]]


class PictureModel(Protocol):
    """A torch module that makes pictures of people."""

    z_size: int
    render: RenderConfig  # raw and final size, samples along a ray

    def generate(self, asked: Asked) -> Generated:
        """Pictures of a batch; no host is waited for."""
        ...
