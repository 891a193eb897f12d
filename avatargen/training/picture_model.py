"""What adversarial training and the metrics ask of a model that makes pictures of people.

AvatarGen's (`avatar_model`) is one; those that it is compared with (`avatargen/baselines`) are others. All
are told the same labels and judged by the same discriminator.

Letters: B pictures, Z size of the latent, J joints, b directions of shape.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from jaxtyping import Float, Int64
from torch import Tensor, nn

from avatargen.generator.config import RenderConfig
from avatargen.generator.picture import Picture
from avatargen.generator.room import Room
from avatargen.training.adversarial_config import OptimizerConfig


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
    room: Room | None = None  # what `PictureModel.survey` found of a set that these labels are from


def to_look_at(
    z: Float[Tensor, "B Z"],
    mapped_camera: Float[Tensor, "B 25"],
    camera: Float[Tensor, "B 25"],
    pose: Float[Tensor, "B J 3"],
    betas: Float[Tensor, "B b"],
) -> Asked:
    """Pictures that nothing is learned from: no styles are mixed, and nothing is drawn along rays."""
    return Asked(
        z=z,
        other_z=z,
        crossover=0,
        camera=camera,
        mapped_camera=mapped_camera,
        pose=pose,
        betas=betas,
        seeds=None,
    )


@dataclass(frozen=True, kw_only=True)
class Generated:
    """Pictures, and the model's own losses on the people in them, weighted, by the names of the log.

    The losses are asked for only in the generator's half of a step.
    """

    picture: Picture
    losses: Callable[[], dict[str, Float[Tensor, ""]]]


class PictureModel(nn.Module, ABC):
    """A module that makes pictures of people. Copies (`copy.deepcopy`) share what is not learned."""

    z_size: int
    blocks: int  # resolution blocks at which two styles can be mixed; with fewer than two none are
    render: RenderConfig  # raw and final size, samples along a ray

    @abstractmethod
    def generate(self, asked: Asked) -> Generated:
        """Pictures of a batch; no host is waited for."""

    @abstractmethod
    def settings(self) -> dict[str, Any]:
        """All that the networks depend on, in types of JSON: a run's folder keeps it."""

    @abstractmethod
    def save(self, path: Path, notes: dict[str, str]) -> None:
        """Write the weights as a file that can be used without the run, whole or not at all."""

    def groups(self, config: OptimizerConfig) -> list[dict[str, Any]]:
        """Parameters with their learning rates, as optimisers take them."""
        return [{"params": list(self.parameters()), "lr": config.generator_rate}]

    def survey(self, labels: tuple[Tensor, Tensor, Tensor]) -> Room | None:
        """What pictures of a set's cameras [N 25], poses [N J 3] and betas [N b] take at most, for a model
        that needs to know. Asked once a run.
        """
        return None

    def numbers(self) -> dict[str, Float[Tensor, ""]]:
        """What the log tells of the model beside its losses."""
        return {}

    def settle(self, z: Float[Tensor, "N Z"], camera: Float[Tensor, "N 25"]) -> None:
        """Take what is kept of many latents (a mean style), before weights are written."""
        return
