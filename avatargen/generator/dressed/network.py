"""One garment's network: its signed distance at canonical points.

It reads the body's distance, features that it learned on the body's surface, and the encoded point. The
distance starts as the body's; the network learns what differs. Colour, way to an edge and place on the cloth
need no network: they are read off the body beneath (least squares found them; a network beside them gained
nothing).

Letters: N points, I inputs, O outputs. Metres; negative inside.
"""

import itertools

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional as F

from avatargen.generator.dressed.config import GarmentConfig
from avatargen.generator.layers import LEAK

RESIDUAL_SCALE = 0.1  # metres per unit of the last layer
SHAPE = 2  # outputs that make the distance: residual, and the share of the body's distance it takes back


class GarmentNetwork(nn.Module):
    """The network of one garment."""

    def __init__(self, config: GarmentConfig) -> None:
        super().__init__()
        self.config = config
        sizes = [config.inputs, *[config.width] * config.depth, SHAPE]
        self.layers = nn.ModuleList(nn.Linear(i, o) for i, o in itertools.pairwise(sizes))
        last = self.layers[-1]
        assert isinstance(last, nn.Linear)
        nn.init.zeros_(last.weight)
        nn.init.zeros_(last.bias)

    def forward(self, x: Float[Tensor, "N I"]) -> Float[Tensor, "N O"]:
        for layer in self.layers[:-1]:
            x = F.leaky_relu(layer(x), LEAK, inplace=not torch.is_grad_enabled())
        return self.layers[-1](x)


def signed_distance(raw: Float[Tensor, "N O"], distance: Float[Tensor, " N"]) -> Float[Tensor, " N"]:
    """Body distance, less the share that is taken back of it, plus the residual."""
    return distance * (1 - torch.tanh(raw[:, 1])) + RESIDUAL_SCALE * raw[:, 0]
