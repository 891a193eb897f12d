"""StyleSDF (Or-El et al. 2022, arXiv 2112.11427).

    z, label --mapping--> w --FiLM--> SIREN(points, directions) --> distance, colour, features
    --volume rendering--> raw picture --styled 2D stage--> picture

As the paper: a SIREN whose sines take a gain and a shift from w in every layer, a head for the distance, one
more layer that knows the direction of view for the colour, density sigmoid(-d / alpha) / alpha with learned
alpha, the eikonal loss, and the minimal-surface loss exp(-100 |d|).

Not as the paper: the network's number is added to the distance from an upright box about as large as a
person, where the paper first fits the network to a sphere; its weights are stored at unit size (equalised
rates), which makes their relative steps at our rate those of the paper's 2e-5; the losses ask random points
of the box of space, not the rays' samples, at a few hundred a person; both stages learn together, judged by
the one discriminator that all methods have, which is told the camera in place of guessing it; the colour is
carried around the 2D stage's blocks.

Letters: B pictures, N points, D size of w, H width, K features.
"""

import math
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import torch
from jaxtyping import Float, Int64
from torch import Tensor, nn

from avatargen.baselines.baseline import RAYS, Baseline, seeds_of, within_bins
from avatargen.baselines.config import BaselineConfig, told
from avatargen.baselines.volume import as_picture, paint_over, picture_of, render_once
from avatargen.generator.density import Density
from avatargen.generator.layers import EqualLinear, without_autocast
from avatargen.generator.picture import BACKGROUND
from avatargen.generator.superresolution import Upsampler
from avatargen.training.losses import eikonal, minimal_surface, slope_of
from avatargen.training.picture_model import Asked, Generated

FREQUENCY = 30.0  # of the sines (SIREN), about which w moves it
FREQUENCY_SPREAD, SHIFT_SPREAD = 5.0, 0.1  # what a style of unit size moves frequency and phase by
SLENDER = (0.22, 0.62, 0.2)  # of the box of space: half the size of the box that the distance starts from


@dataclass(frozen=True, kw_only=True)
class StyleSDFConfig(BaselineConfig):
    """SIREN, sharpness and losses."""

    width: int = 128
    depth: int = 3  # layers before the distance
    alpha: float = 0.05  # metres, at the start
    residual_scale: float = 0.1  # metres per unit of the network's number
    eikonal: float = 0.1
    minimal_surface: float = 0.05
    points: int = 192  # a person, where the two are asked


class Sine(nn.Module):
    """sin(frequency (W x + b) + phase), frequency and phase by the style (FiLM)."""

    def __init__(self, inputs: int, outputs: int, w_size: int, *, first: bool = False) -> None:
        super().__init__()
        self.weight = nn.Parameter(torch.rand(outputs, inputs) * 2 - 1)
        self.bias = nn.Parameter((torch.rand(outputs) * 2 - 1) / math.sqrt(inputs))
        self.gain = 1 / inputs if first else math.sqrt(6 / inputs) / 25
        self.style = EqualLinear(w_size, 2 * outputs)

    def forward(self, x: Float[Tensor, "B N i"], w: Float[Tensor, "B D"]) -> Float[Tensor, "B N o"]:
        frequency, phase = self.style(w)[:, None].chunk(2, dim=-1)
        y = torch.nn.functional.linear(x, self.weight * self.gain, self.bias)
        return torch.sin((FREQUENCY + FREQUENCY_SPREAD * frequency) * y + SHIFT_SPREAD * phase)


class StyleSDF(Baseline):
    """A SIREN of the observed space."""

    name = "stylesdf"
    shares: ClassVar = {"density.": 0.01}  # a sharpness in metres, which a step of the whole rate would undo
    config: StyleSDFConfig
    slender: Tensor

    def __init__(self, config: StyleSDFConfig) -> None:
        super().__init__(config, Density(config.alpha))
        half = (self.box[1] - self.box[0]) / 2 * torch.tensor(SLENDER)
        self.register_buffer("slender", half, persistent=False)
        w_size, width = config.mapping.w_size, config.width
        widths = [3, *[width] * config.depth]
        self.layers = nn.ModuleList(
            Sine(i, width, w_size, first=number == 0) for number, i in enumerate(widths[:-1])
        )
        self.distance = EqualLinear(width, 1)
        self.view = Sine(width + 3, width, w_size)
        self.leave = EqualLinear(width, config.features)
        self.upsampler = Upsampler(config.render, features=config.features, w_size=w_size)

    def generate(self, asked: Asked) -> Generated:
        w, late = self.styles(asked)
        w = w.float()
        with without_autocast(w.device):
            rays = self.rays(asked, self.render.raw_size)
            within = within_bins(asked.seeds, rays.near, self.render.samples, RAYS)
            seen = render_once(partial(self.field, w), rays, within, self.density)
            raw = paint_over(seen, BACKGROUND)
        features = as_picture(torch.cat([raw, seen.features[..., 3:]], dim=-1))
        return Generated(
            picture=picture_of(self.upsampler(features, late), as_picture(raw), seen),
            losses=lambda: self.surface_losses(w, seeds_of(asked)),
        )

    def field(
        self, w: Float[Tensor, "B D"], points: Float[Tensor, "B N 3"], direction: Float[Tensor, "B N 3"]
    ) -> tuple[Float[Tensor, "B N"], Float[Tensor, "B N K"]]:
        """Signed distance in metres, and features of which the first three are the colour."""
        distance, x = self.surface(w, points)
        features = self.leave(self.view(torch.cat([x, direction], dim=-1), w))
        return distance, torch.cat([torch.sigmoid(features[..., :3]), features[..., 3:]], dim=-1)

    def surface(
        self, w: Float[Tensor, "B D"], points: Float[Tensor, "B N 3"]
    ) -> tuple[Float[Tensor, "B N"], Float[Tensor, "B N H"]]:
        """Signed distance in metres, and the last layer that it is read from."""
        x = self.centered(points)
        for layer in self.layers:
            x = layer(x, w)
        residual = self.config.residual_scale * self.distance(x)[..., 0]
        return distance_to_box(points - self.box.mean(dim=0), self.slender) + residual, x

    def surface_losses(
        self, w: Float[Tensor, "B D"], seeds: Int64[Tensor, " B"]
    ) -> dict[str, Float[Tensor, ""]]:
        """The eikonal and the minimal-surface loss at random points, weighted."""
        config = self.config
        with without_autocast(w.device), torch.enable_grad():
            points = self.anywhere(seeds, config.points).requires_grad_()
            distance, _ = self.surface(w, points)
            (gradient,) = torch.autograd.grad(distance.sum(), points, create_graph=True)
            slope = slope_of(gradient.flatten(0, 1))
            return {
                "eikonal": config.eikonal * eikonal(slope),
                "minimal_surface": config.minimal_surface * minimal_surface(distance.flatten()),
            }

    def numbers(self) -> dict[str, Float[Tensor, ""]]:
        return {"alpha": self.density.alpha.detach()}


def distance_to_box(points: Float[Tensor, "*batch 3"], half: Float[Tensor, "3"]) -> Float[Tensor, "*batch"]:
    """Signed distance from a box about the origin, by half its sides."""
    beyond = points.abs() - half
    outside = (beyond.clamp_min(0).square().sum(dim=-1) + 1e-12).sqrt()
    return outside + beyond.amax(dim=-1).clamp_max(0)


SIZES = {
    "debug": StyleSDFConfig(
        mapping=told(z_size=16, features=16, width=32, layers=2), features=8, width=16, depth=2, points=32
    ),
    "shipped": StyleSDFConfig(mapping=told(z_size=80, features=128, width=1280, layers=4)),
    "gpu": StyleSDFConfig(mapping=told(z_size=80, features=128, width=1536, layers=4), depth=4),
    "paper": StyleSDFConfig(
        mapping=told(z_size=256, features=256, width=1024, layers=8, learning_rate_multiplier=0.01),
        features=256,
        width=256,
        depth=8,
        points=1024,
    ),
}
