"""The generator: latent to field (sections 3.2 and 3.3).

    z, camera --mapping--> w --planes--> tri-planes      }
                           w --layers--> decoder layers  } --field(points)--> distance, colour, features
                           w --betas--> the person's own shape

Letters: B people, N points, D size of w, C plane channels, R plane resolution, K features. Canonical space,
metres.
"""

from typing import Literal

import torch
from jaxtyping import Float
from torch import Tensor, nn

from avatargen.generator.config import GeneratorConfig
from avatargen.generator.decoder import BodyPoints, Decoder, PartLayers
from avatargen.generator.deformation import Deformation
from avatargen.generator.density import Density
from avatargen.generator.layers import EqualLinear, leaky_relu
from avatargen.generator.mapping import Mapping
from avatargen.generator.planes import PlaneFrame, sample_planes
from avatargen.generator.superresolution import Upsampler
from avatargen.generator.synthesis import Synthesis

SHAPE_LIMIT = 3.0  # standard deviations; softly kept by a tanh


class AvatarGenerator(nn.Module):
    """All networks of the generator, on one body."""

    def __init__(self, config: GeneratorConfig) -> None:
        super().__init__()
        self.config = config
        w_size = config.mapping.w_size
        self.mapping = Mapping(config.mapping)
        self.synthesis = Synthesis(config.synthesis, w_size)
        self.frame = PlaneFrame(config.planes)
        self.decoder = Decoder(
            config.decoder,
            plane_channels=config.synthesis.plane_channels,
            w_size=w_size,
            vertex_count=config.vertex_count,
        )
        self.shape = ShapeHead(w_size, config.shape_count)
        self.deformation = Deformation(
            config.deformation, w_size=w_size, joint_count=config.joint_count, shape_count=config.shape_count
        )
        self.density = Density(config.render.initial_alpha, config.geometry.representation)
        self.upsampler = Upsampler(config.render, features=config.decoder.features, w_size=w_size)

    def planes(self, w: Float[Tensor, "B D"]) -> Float[Tensor, "B 3 C R R"]:
        """The people's tri-planes."""
        return self.synthesis(w)

    def layers(self, w: Float[Tensor, "B D"]) -> tuple[PartLayers, ...]:
        """The people's decoder layers; who asks much of one person makes them once."""
        return self.decoder.layers_of(w)

    def betas(self, w: Float[Tensor, "B D"]) -> Float[Tensor, "B b"]:
        """The people's body shapes, each within +-3."""
        return self.shape(w)

    def field(
        self,
        planes: Float[Tensor, "B 3 C R R"],
        layers: tuple[PartLayers, ...],
        points: Float[Tensor, "B N 3"],
        body: BodyPoints,
        method: Literal["fast", "differentiable"] = "fast",
        base: BodyPoints | None = None,
    ) -> tuple[Float[Tensor, "B N"], Float[Tensor, "B N 3"], Float[Tensor, "B N K"]]:
        """Signed distance (metres), colour (sRGB 0..1) and features at canonical points, of people's planes
        and layers.

        `method` is that of `sample_planes`: `differentiable` where the gradient of the field is itself
        penalised. The distance is `body`'s plus the residual, or `base`'s where one is given.
        """
        features = sample_planes(planes, self.frame(points), method)
        x = self.decoder.inputs(features, self.frame.centered(points), body)
        shape, picture = self.decoder(x, points, layers).tensor_split([2], dim=-1)
        return self.decoder.signed_distance(shape, (base or body).distance), picture[..., :3], picture


class ShapeHead(nn.Module):
    """w to betas: a linear part plus a small MLP, softly limited."""

    def __init__(self, w_size: int, shape_count: int, width: int = 64) -> None:
        super().__init__()
        self.linear = EqualLinear(w_size, shape_count, zero=True)
        self.enter = EqualLinear(w_size, width)
        self.leave = EqualLinear(width, shape_count, zero=True)

    def forward(self, w: Float[Tensor, "B D"]) -> Float[Tensor, "B b"]:
        x = self.linear(w) + self.leave(leaky_relu(self.enter(w)))
        return SHAPE_LIMIT * torch.tanh(x / SHAPE_LIMIT)
