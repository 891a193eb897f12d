"""StyleNeRF (Gu et al. 2021, arXiv 2110.08985).

    z, label --mapping--> w --modulated MLP(waves of points)--> density, features
    --volume rendering at low resolution--> features --styled 1 x 1 layers, upsampling between--> picture

As the paper: an MLP whose every layer w modulates, features summed along rays before they become colours, an
upsampler of a pixel shuffle of repeated and learned channels with a fixed blur, no layer that sees its
neighbours but that blur, no direction of view and no noise, and the regularisation of the NeRF path: pixels
of the final picture are rendered straight at its full resolution, through the same layers without the
upsampling, and compared.

Not as the paper: the background is white, which no second NeRF has to draw; resolution does not grow while
it learns; one pass of samples along a ray; raw and final picture go to the dual discriminator that all
methods have.

Letters: B pictures, P rays, N points, D size of w, C channels, K features, S final size.
"""

import itertools
from dataclasses import dataclass
from functools import partial

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional as F

from avatargen.baselines.baseline import (
    LOSS_PIXELS,
    LOSS_POINTS,
    RAYS,
    Baseline,
    opaque,
    seeds_of,
    within_bins,
)
from avatargen.baselines.config import BaselineConfig, told
from avatargen.baselines.layers import ModulatedLinear, StyledLayer, wave_count, waves
from avatargen.baselines.volume import Field, as_picture, picture_of, render_once
from avatargen.generator.density import Density
from avatargen.generator.draws import uniform
from avatargen.generator.layers import EqualLinear, leaky_relu, upsample, without_autocast
from avatargen.generator.picture import BACKGROUND
from avatargen.generator.renderer import Rendering
from avatargen.training.picture_model import Asked, Generated

BLUR = (1.0, 2.0, 1.0)  # of the upsampler, along rows and columns
GREY = 0.5  # colour that an untrained network shows
CONTRAST = 0.25  # of the raw colour, per unit of the network's number


@dataclass(frozen=True, kw_only=True)
class StyleNeRFConfig(BaselineConfig):
    """The MLP, the styled layers and the path's regularisation."""

    frequencies: int = 6
    width: int = 128
    depth: int = 3  # layers of the field
    late: int = 64  # channels of the layers after rendering
    opacity: float = 0.05  # metres within which a density of one unit stops most light
    path: float = 0.2  # weight of the path's regularisation
    pixels: int = 32  # of each picture, that are rendered straight


class ShuffleUpsampler(nn.Module):
    """Twice the size: channels repeated, what is learned added, shuffled to four pixels, blurred
    (equation 9 of the paper).
    """

    kernel: Tensor

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.enter = EqualLinear(channels, channels)
        self.leave = EqualLinear(channels, 4 * channels, zero=True)
        row = torch.tensor(BLUR) / sum(BLUR)
        self.register_buffer("kernel", row[:, None] * row, persistent=False)

    def forward(self, x: Float[Tensor, "B C h v"]) -> Float[Tensor, "B C h2 v2"]:
        learned = self.leave(leaky_relu(self.enter(x.movedim(1, -1)))).movedim(-1, 1)
        wide = F.pixel_shuffle(x.repeat_interleave(4, dim=1) + learned, 2)
        return blurred(wide, self.kernel)


def blurred(x: Float[Tensor, "B C h v"], kernel: Float[Tensor, "3 3"]) -> Float[Tensor, "B C h v"]:
    """Each channel convolved with a kernel, borders repeated."""
    weight = kernel.to(x.dtype).expand(x.shape[1], 1, 3, 3)
    return F.conv2d(F.pad(x, (1, 1, 1, 1), mode="replicate"), weight, groups=x.shape[1])


class StyleNeRF(Baseline):
    """A style-modulated NeRF with layers after rendering."""

    name = "stylenerf"
    config: StyleNeRFConfig

    def __init__(self, config: StyleNeRFConfig) -> None:
        super().__init__(config, Density(config.opacity, "density").requires_grad_(False))
        w_size, late = config.mapping.w_size, config.late
        steps = round(config.render.image_size / config.render.raw_size).bit_length() - 1
        widths = [wave_count(3, config.frequencies), *[config.width] * config.depth]
        self.layers = nn.ModuleList(StyledLayer(i, o, w_size) for i, o in itertools.pairwise(widths))
        self.sigma = ModulatedLinear(config.width, 1, w_size, demodulate=False)
        self.feature = StyledLayer(config.width, config.features, w_size)
        self.raw_color = ModulatedLinear(config.features, 3, w_size, demodulate=False)
        inputs = [config.features, *[late] * (steps - 1)][:steps]
        self.styled = nn.ModuleList(StyledLayer(i, late, w_size) for i in inputs)
        self.more = nn.ModuleList(StyledLayer(late, late, w_size) for _ in inputs)
        self.grow = nn.ModuleList(ShuffleUpsampler(late) for _ in inputs)
        self.color = nn.ModuleList(
            ModulatedLinear(late, 3, w_size, demodulate=False, zero=True) for _ in inputs
        )

    def generate(self, asked: Asked) -> Generated:
        w, late = self.styles(asked)
        field = partial(self.field, w.float())
        with without_autocast(w.device):
            rays = self.rays(asked, self.render.raw_size)
            within = within_bins(asked.seeds, rays.near, self.render.samples, RAYS)
            seen = render_once(field, rays, within, self.density)
            raw = self.first_color(seen, late.float())
        image = self.enlarge(seen.features, raw, late)
        return Generated(
            picture=picture_of(image, as_picture(raw), seen),
            losses=lambda: {"nerf_path": self.path_loss(asked, field, late.float(), image)},
        )

    def field(
        self, w: Float[Tensor, "B D"], points: Float[Tensor, "B N 3"], _: Float[Tensor, "B N 3"]
    ) -> tuple[Float[Tensor, "B N"], Float[Tensor, "B N K"]]:
        """What the density takes, and features."""
        x = waves(self.centered(points), self.config.frequencies)
        for layer in self.layers:
            x = layer(x, w)
        return opaque(self.sigma(x, w)[..., 0], self.config.opacity), self.feature(x, w)

    def first_color(self, seen: Rendering, w: Float[Tensor, "B D"]) -> Float[Tensor, "B P 3"]:
        """The colours of rays' summed features, before the background."""
        mask = seen.mask[..., None]
        return CONTRAST * self.raw_color(seen.features, w) + GREY * mask + BACKGROUND * (1 - mask)

    def enlarge(
        self, features: Float[Tensor, "B P K"], raw: Float[Tensor, "B P 3"], w: Float[Tensor, "B D"]
    ) -> Float[Tensor, "B 3 S S"]:
        """The final picture: styled layers, and between them the upsampler."""
        x, color = features, as_picture(raw)
        for styled, more, grow, correct in zip(self.styled, self.more, self.grow, self.color, strict=True):
            wide = grow(as_picture(styled(x, w)))
            x = more(wide.flatten(2).transpose(1, 2), w)
            color = upsample(color) + as_picture(correct(x, w))
        return color

    def straight(self, seen: Rendering, w: Float[Tensor, "B D"]) -> Float[Tensor, "B P 3"]:
        """Final colours of single rays: the same layers, without the upsampling."""
        x, color = seen.features, self.first_color(seen, w)
        for styled, more, correct in zip(self.styled, self.more, self.color, strict=True):
            x = more(styled(x, w), w)
            color = color + correct(x, w)
        return color

    def path_loss(
        self, asked: Asked, field: Field, w: Float[Tensor, "B D"], image: Float[Tensor, "B 3 S S"]
    ) -> Float[Tensor, ""]:
        """Mean squared difference between some final pixels and what their own rays show (equation 10)."""
        config, size = self.config, self.render.image_size
        seeds = seeds_of(asked)
        with without_autocast(w.device):
            chosen = (uniform(seeds, config.pixels, LOSS_PIXELS) * size**2).long().clamp_max(size**2 - 1)
            rays = self.rays(asked, size).some(chosen)
            within = within_bins(asked.seeds, rays.near, self.render.samples, LOSS_POINTS)
            colors = self.straight(render_once(field, rays, within, self.density), w)
            there = image.float().flatten(2).gather(2, chosen[:, None].expand(-1, 3, -1)).transpose(1, 2)
        return config.path * (colors - there).square().mean()


SIZES = {
    "debug": StyleNeRFConfig(
        mapping=told(z_size=16, features=16, width=32, layers=2),
        features=16,
        frequencies=4,
        width=16,
        depth=2,
        late=16,
        pixels=8,
    ),
    "shipped": StyleNeRFConfig(mapping=told(z_size=80, features=128, width=1280, layers=4), features=64),
    "gpu": StyleNeRFConfig(
        mapping=told(z_size=80, features=128, width=1536, layers=4), features=128, late=256, depth=4
    ),
    "paper": StyleNeRFConfig(
        mapping=told(z_size=512, features=512, width=1024, layers=8, learning_rate_multiplier=0.01),
        features=256,
        frequencies=10,
        width=256,
        depth=8,
        late=256,
        pixels=256,
    ),
}
