"""EG3D (Chan et al. 2022, arXiv 2112.07945), in the observed space.

    z, label --mapping--> w --synthesis--> tri-planes --decoder--> density, features
    --two-pass volume rendering--> raw picture --styled upsampling--> picture

As the paper: StyleGAN2's planes, a decoder of one hidden layer of 64 with softplus, as many samples where the
first found something as were spread evenly, colours that do not know the direction of view, a camera that is
swapped while mapping, a dual discriminator, and a density that changes little over a centimetre.

Not as the paper: the label that maps a latent holds pose and shape beside the camera; the second pass takes
its samples out of the same number, so that all methods ask their fields as often; the colour is carried
around the upsampling blocks, as AvatarGen's; the density is per metre, and a cubic between its samples.

Letters: B pictures, N points, C plane channels, R plane resolution, K features.
"""

from dataclasses import dataclass, field
from functools import partial

import torch
from jaxtyping import Float, Int64
from torch import Tensor
from torch.nn import functional as F

from avatargen.baselines.baseline import (
    LOSS_SHIFTS,
    RAYS,
    RAYS_AGAIN,
    Baseline,
    opaque,
    seeds_of,
    within_bins,
)
from avatargen.baselines.config import BaselineConfig, told
from avatargen.baselines.volume import as_picture, paint_over, picture_of, render_twice
from avatargen.generator.config import PlanesConfig, SynthesisConfig
from avatargen.generator.density import Density
from avatargen.generator.draws import uniform
from avatargen.generator.layers import EqualLinear, without_autocast
from avatargen.generator.picture import BACKGROUND
from avatargen.generator.planes import PlaneFrame, sample_planes
from avatargen.generator.superresolution import Upsampler
from avatargen.generator.synthesis import Synthesis
from avatargen.training.picture_model import Asked, Generated

OVERSHOOT = 0.001  # of colours beyond 0..1, which a sigmoid would reach nowhere (as Mip-NeRF)


@dataclass(frozen=True, kw_only=True)
class EG3DConfig(BaselineConfig):
    """Planes, decoder and the density's regularisation."""

    synthesis: SynthesisConfig = field(default_factory=SynthesisConfig)
    width: int = 64  # of the decoder's hidden layer
    opacity: float = 0.05  # metres within which a density of one unit stops most light
    smoothness: float = 0.25  # weight of the density's change
    points: int = 256  # a person, where it is asked
    shift: float = 0.01  # metres over which


class EG3D(Baseline):
    """Tri-planes in the observed space."""

    name = "eg3d"
    config: EG3DConfig

    def __init__(self, config: EG3DConfig) -> None:
        super().__init__(config, Density(config.opacity, "density").requires_grad_(False))
        w_size, channels = config.mapping.w_size, config.synthesis.plane_channels
        self.blocks = len(config.synthesis.blocks)
        self.synthesis = Synthesis(config.synthesis, w_size)
        self.frame = PlaneFrame(PlanesConfig(low=config.low, high=config.high))
        self.hidden = EqualLinear(channels, config.width)
        self.leave = EqualLinear(config.width, 1 + config.features)
        self.upsampler = Upsampler(config.render, features=config.features, w_size=w_size)

    def generate(self, asked: Asked) -> Generated:
        w, late = self.styles(asked)
        planes = self.synthesis(w, late, asked.crossover).float()
        with without_autocast(planes.device):
            rays = self.rays(asked, self.render.raw_size)
            again = self.render.samples // 2
            seen = render_twice(
                partial(self.field, planes),
                rays,
                within_bins(asked.seeds, rays.near, self.render.samples - again, RAYS),
                within_bins(asked.seeds, rays.near, again, RAYS_AGAIN),
                self.density,
            )
            raw = paint_over(seen, BACKGROUND)
        features = as_picture(torch.cat([raw, seen.features[..., 3:]], dim=-1))
        return Generated(
            picture=picture_of(self.upsampler(features, late), as_picture(raw), seen),
            losses=lambda: {"density_change": self.density_change(planes, seeds_of(asked))},
        )

    def field(
        self, planes: Float[Tensor, "B 3 C R R"], points: Float[Tensor, "B N 3"], _: Float[Tensor, "B N 3"]
    ) -> tuple[Float[Tensor, "B N"], Float[Tensor, "B N K"]]:
        """What the density takes, and features of which the first three are the colour."""
        hidden = F.softplus(self.hidden(sample_planes(planes, self.frame(points)) / 3))
        sigma, features = self.leave(hidden).tensor_split([1], dim=-1)
        features = torch.sigmoid(features) * (1 + 2 * OVERSHOOT) - OVERSHOOT
        return opaque(sigma[..., 0], self.config.opacity), features

    def density_change(
        self, planes: Float[Tensor, "B 3 C R R"], seeds: Int64[Tensor, " B"]
    ) -> Float[Tensor, ""]:
        """How much the density differs between neighbouring points, weighted."""
        config = self.config
        here = self.anywhere(seeds, config.points)
        shift = 2 * uniform(seeds, 3 * config.points, LOSS_SHIFTS).view_as(here) - 1
        there = here + config.shift * shift
        points = torch.cat([here, there], dim=1)
        with without_autocast(planes.device):
            number, _ = self.field(planes, points, points)
            first, second = self.density(number).chunk(2, dim=1)
        height = config.high[1] - config.low[1]  # the paper's densities are per side of its box
        return config.smoothness * height * (first - second).abs().mean()


SIZES = {
    "debug": EG3DConfig(
        mapping=told(z_size=16, features=16, width=32, layers=2),
        synthesis=SynthesisConfig(blocks=((4, 16), (8, 16), (16, 16)), plane_channels=8),
        features=8,
        width=16,
        points=32,
    ),
    "shipped": EG3DConfig(
        mapping=told(z_size=80, features=128, width=512, layers=4),
        synthesis=SynthesisConfig(blocks=((4, 512), (8, 256), (16, 64), (32, 32)), plane_channels=32),
    ),
    "gpu": EG3DConfig(
        mapping=told(z_size=80, features=128, width=512, layers=4),
        synthesis=SynthesisConfig(
            blocks=((4, 512), (8, 512), (16, 256), (32, 256), (64, 128), (128, 64)), plane_channels=32
        ),
    ),
    "paper": EG3DConfig(
        mapping=told(z_size=512, features=512, width=512, layers=8, learning_rate_multiplier=0.01),
        synthesis=SynthesisConfig(
            blocks=((4, 512), (8, 512), (16, 512), (32, 512), (64, 256), (128, 128), (256, 64)), noise=True
        ),
        points=1000,
    ),
}
