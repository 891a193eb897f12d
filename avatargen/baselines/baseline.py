"""What all baselines do alike: they map latent and label to a style, and say what they are made of.

Letters: B pictures, D size of a style, N points.
"""

import dataclasses
from pathlib import Path
from typing import Any, ClassVar

import torch
from jaxtyping import Float, Int64
from torch import Tensor

from avatargen.baselines.checkpoint import save_baseline
from avatargen.baselines.config import BaselineConfig
from avatargen.baselines.volume import Rays, box_rays
from avatargen.generator.camera import camera_of_vector
from avatargen.generator.density import Density
from avatargen.generator.draws import uniform
from avatargen.generator.mapping import Mapping
from avatargen.training.adversarial_config import OptimizerConfig
from avatargen.training.picture_model import Asked, PictureModel

RAYS, RAYS_AGAIN, LOSS_POINTS, LOSS_SHIFTS, LOSS_PIXELS, BEHIND = range(6)  # streams of random numbers
CLEAR = 4.0  # an untrained network, whose numbers are about 0, lets half of the light through the box


def within_bins(
    seeds: Int64[Tensor, " B"] | None, like: Float[Tensor, "B P"], count: int, stream: int
) -> Float[Tensor, "B P S"]:
    """Where in their bins samples of rays stand, 0..1: at random by seeds, in the middle without."""
    if seeds is None:
        return like.new_full((*like.shape, count), 0.5)
    return uniform(seeds, like.shape[1] * count, stream).unflatten(1, (like.shape[1], count))


def seeds_of(asked: Asked) -> Int64[Tensor, " B"]:
    """Seeds of the points at which losses are asked."""
    return torch.zeros_like(asked.camera[:, 0], dtype=torch.int64) if asked.seeds is None else asked.seeds


def opaque(x: Float[Tensor, "*any"], opacity: float) -> Float[Tensor, "*any"]:
    """What a density takes, of a network's number: much light is stopped within `opacity` metres where it
    is large, and little where it is 0.
    """
    return opacity * (CLEAR - x)


class Baseline(PictureModel):
    """A mapping network that is told camera, pose and shape, a box of space, and a density."""

    name: ClassVar[str]  # of the method, as commands and files call it
    shares: ClassVar[dict[str, float]] = {}  # of the rate, for parts that learn at less than the whole
    box: Tensor

    def __init__(self, config: BaselineConfig, density: Density) -> None:
        super().__init__()
        self.config = config
        self.z_size = config.mapping.z_size
        self.blocks = 2  # what is rendered, and what enlarges it
        self.render = config.render
        self.mapping = Mapping(config.mapping)
        self.density = density
        self.register_buffer("box", torch.tensor([config.low, config.high]), persistent=False)

    def styles(self, asked: Asked) -> tuple[Float[Tensor, "B D"], Float[Tensor, "B D"]]:
        """Styles of what comes before and of what comes from the crossover on.

        The camera of the label is the one that the latent is mapped under; pose and shape are as asked.
        """
        label = torch.cat([asked.mapped_camera, asked.pose.flatten(1), asked.betas], dim=1)
        w = self.mapping(asked.z, label)
        return w, self.mapping(asked.other_z, label) if asked.crossover else w

    def rays(self, asked: Asked, size: int) -> Rays:
        """Rays through the pixels of pictures of a size."""
        return box_rays(camera_of_vector(asked.camera), size, self.box)

    def centered(self, points: Float[Tensor, "*batch 3"]) -> Float[Tensor, "*batch 3"]:
        """Points scaled so that the box is -1..1 on each axis."""
        return (points - self.box[0]) / (self.box[1] - self.box[0]) * 2 - 1

    def anywhere(self, seeds: Int64[Tensor, " B"], count: int) -> Float[Tensor, "B N 3"]:
        """Random points in the box."""
        place = uniform(seeds, 3 * count, LOSS_POINTS).unflatten(1, (count, 3))
        return self.box[0] + place * (self.box[1] - self.box[0])

    def settings(self) -> dict[str, Any]:
        return {"model": self.name, **dataclasses.asdict(self.config)}

    def save(self, path: Path, notes: dict[str, str]) -> None:
        save_baseline(self, path, {"licence": "Apache-2.0", **notes})

    def groups(self, config: OptimizerConfig) -> list[dict[str, Any]]:
        """What learns, each part at its share of the rate."""
        rate, groups = config.generator_rate, {}
        for name, parameter in self.named_parameters():
            if parameter.requires_grad:
                share = next((share for part, share in self.shares.items() if name.startswith(part)), 1.0)
                groups.setdefault(share, []).append(parameter)
        return [{"params": parameters, "lr": rate * share} for share, parameters in groups.items()]
