"""Residual deformation (section 3.3): a small correction of canonical points, by person, pose and shape.

The last layer starts at zero: an untrained network moves nothing. Metres.
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from avatargen.generator.config import DeformationConfig
from avatargen.generator.decoder import encode
from avatargen.generator.layers import EqualLinear, leaky_relu


class Deformation(nn.Module):
    """MLP of the encoded canonical point and (w, pose, shape)."""

    def __init__(self, config: DeformationConfig, *, w_size: int, joint_count: int, shape_count: int) -> None:
        super().__init__()
        self.config = config
        self.enter = EqualLinear(3 * (1 + 2 * config.frequencies), config.width)
        self.condition = EqualLinear(w_size + 3 * (joint_count - 1) + shape_count, config.width)
        self.layers = nn.ModuleList(EqualLinear(config.width, config.width) for _ in range(config.depth - 1))
        self.leave = EqualLinear(config.width, 3, zero=True)

    def forward(
        self,
        centered: Float[Tensor, "B N 3"],
        w: Float[Tensor, "B D"],
        pose: Float[Tensor, "B J 3"],
        betas: Float[Tensor, "B b"],
    ) -> Float[Tensor, "B N 3"]:
        """Metres to add to each canonical point.

        `centered` are the points scaled so that the box is -1..1. The root's rotation turns the whole person
        and deforms nothing, so it is left out of the condition.
        """
        condition = self.condition(torch.cat([w, pose[:, 1:].flatten(1), betas], dim=1))
        x = leaky_relu(self.enter(encode(centered, self.config.frequencies)) + condition[:, None])
        for layer in self.layers:
            x = leaky_relu(layer(x))
        return self.leave(x) * self.config.output_scale
