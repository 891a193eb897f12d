"""Mapping network: latent z and camera to the style w (section 3.2).

Letters: B people, Z latent size, D size of w, c numbers of a camera. The camera is EG3D's vector of 25: 16 of
the row-major cam2world matrix, 9 of the normalised intrinsics; a model may be told more beside it.
"""

import itertools

import torch
from jaxtyping import Float
from torch import Tensor, nn

from avatargen.generator.config import MappingConfig
from avatargen.generator.layers import EqualLinear, leaky_relu, normalize_second_moment


class Mapping(nn.Module):
    """z and camera to w, with a running mean of w for truncation."""

    average: Tensor

    def __init__(self, config: MappingConfig) -> None:
        super().__init__()
        self.config = config
        multiplier = config.learning_rate_multiplier
        inputs = config.z_size * (2 if config.sign_gain > 0 else 1) + config.camera_features
        sizes = [inputs, *[config.width] * (config.layers - 1), config.w_size]
        if config.camera_features:
            self.camera = EqualLinear(config.camera_size, config.camera_features)
        self.layers = nn.ModuleList(
            EqualLinear(i, o, learning_rate_multiplier=multiplier) for i, o in itertools.pairwise(sizes)
        )
        self.register_buffer("average", torch.zeros(config.w_size))

    def forward(
        self, z: Float[Tensor, "B Z"], camera: Float[Tensor, "B c"], truncation: float = 1.0
    ) -> Float[Tensor, "B D"]:
        """Map to w; truncation below 1 moves w toward the running mean (less variety, fewer failures)."""
        x = [normalize_second_moment(z) if self.config.normalize else z]
        if self.config.sign_gain > 0:
            x.append(torch.tanh(self.config.sign_gain * z))
        if self.config.camera_features:
            x.append(normalize_second_moment(self.camera(camera)))
        w = torch.cat(x, dim=1)
        for layer in self.layers:
            w = leaky_relu(layer(w))
        return w if truncation == 1 else torch.lerp(self.average, w, truncation)

    @torch.no_grad()
    def track_average(self, w: Float[Tensor, "B D"]) -> None:
        """Move the running mean of w toward this batch's."""
        self.average.lerp_(w.mean(dim=0), 1 - self.config.average_decay)
