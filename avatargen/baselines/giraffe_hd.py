"""GIRAFFE-HD (Xue et al. 2022, arXiv 2203.14954).

    z, label --mapping--> w --feature field--> foreground: features, mask --2D renderer--> picture, mask
    z --mapping--> scene's w --feature field--> background: features --------2D renderer--> picture
    mask * foreground + (1 - mask) * background --> picture

As the paper: a feature field each for the object and for what lies behind it, told their codes by addition
(GIRAFFE), one for shape and one for appearance; both rendered small, refined by styled 2D renderers of their
own, and laid over one another only then, by a mask that the foreground's renderer refines; three regularisers
of that mask: it covers some of the picture, it is near 0 or 1, and it stays where the object's box is seen.

Not as the paper: no scale, turn or place of the object is drawn, for the label says where the person stands;
the mask begins as the one that rays see; raw pictures, laid over one another in the same way, also go to the
dual discriminator that all methods have; the background learns to be white, as all pictures' is.

Letters: B pictures, P rays, N points, D size of w, K features, S final size.
"""

import math
from dataclasses import dataclass, field, replace
from functools import partial

import torch
from jaxtyping import Bool, Float
from torch import Tensor, nn

from avatargen.baselines.baseline import BEHIND, RAYS, Baseline, opaque, within_bins
from avatargen.baselines.config import BaselineConfig, told
from avatargen.baselines.layers import wave_count, waves
from avatargen.baselines.volume import Rays, as_picture, paint_over, picture_of, render_once
from avatargen.generator.config import MappingConfig
from avatargen.generator.density import Density
from avatargen.generator.layers import EqualLinear, leaky_relu, without_autocast
from avatargen.generator.mapping import Mapping
from avatargen.generator.picture import BACKGROUND
from avatargen.generator.superresolution import Upsampler
from avatargen.training.picture_model import Asked, Generated

ROOM = 2.0  # metres behind the box's far side, over which the background is sampled
BEHIND_OPACITY = 0.25  # metres, as `opacity`
GAIN = 5.0  # of the density, which no style makes steeper
CODE = 0.3  # share of a code in a layer: with as much of it as of the point, people fill the box or vanish
SURE = 0.98  # of a mask: so far from 0 and 1 that its logit has a slope
STEEP = 4.0  # of a mask's logit: carried by its quarter, which is of the size of the other features
FAINT = 0.01  # mask of which a colour is not yet told
CARRIED = 4  # colour and mask


@dataclass(frozen=True, kw_only=True)
class GiraffeHDConfig(BaselineConfig):
    """The two fields and the mask's regularisers."""

    scene: MappingConfig = field(default_factory=MappingConfig)  # of the background, which is told no label
    frequencies: int = 6
    width: int = 128
    depth: int = 4  # layers of the foreground's field
    behind_width: int = 32
    behind_features: int = 8
    behind_samples: int = 2
    opacity: float = 0.05  # metres within which a density of one unit stops most light
    coverage: float = 2.0  # weights: the mask covers at least
    least: float = 0.08  # of the picture
    binary: float = 0.1  # it is near 0 or 1
    inside: float = 1.0  # it stays where rays meet the box


class FeatureField(nn.Module):
    """GIRAFFE's decoder: density by a point and the shape's code, features also by appearance and
    direction.
    """

    def __init__(
        self,
        *,
        frequencies: int,
        width: int,
        depth: int,
        features: int,
        w_size: int,
        opacity: float,
    ) -> None:
        super().__init__()
        self.frequencies, self.opacity = frequencies, opacity
        self.enter = EqualLinear(wave_count(3, frequencies), width)
        self.shape = EqualLinear(w_size, width)
        self.layers = nn.ModuleList(EqualLinear(width, width) for _ in range(depth - 1))
        self.again = nn.ModuleList(EqualLinear(w_size, width) for _ in range(depth - 1))
        self.sigma = EqualLinear(width, 1, zero=True)  # an even fog at first, whatever the codes say
        self.view = EqualLinear(width + 3, width)
        self.appearance = EqualLinear(w_size, width)
        self.leave = EqualLinear(width, features)

    def forward(
        self,
        w: Float[Tensor, "B D"],
        box: Float[Tensor, "2 3"],
        points: Float[Tensor, "B N 3"],
        direction: Float[Tensor, "B N 3"],
    ) -> tuple[Float[Tensor, "B N"], Float[Tensor, "B N K"]]:
        """What the density takes, and features of which the first three are the colour."""
        place = (points - box[0]) / (box[1] - box[0]) * 2 - 1
        x = add_code(self.enter(waves(place, self.frequencies)), self.shape(w))
        for layer, code in zip(self.layers, self.again, strict=True):
            x = add_code(layer(x), code(w))
        y = add_code(self.view(torch.cat([x, direction], dim=-1)), self.appearance(w))
        features = self.leave(y)
        color, more = torch.sigmoid(features[..., :3]), features[..., 3:]
        return opaque(GAIN * self.sigma(x)[..., 0], self.opacity), torch.cat([color, more], dim=-1)


def add_code(x: Float[Tensor, "B N W"], code: Float[Tensor, "B W"]) -> Float[Tensor, "B N W"]:
    """A layer's numbers at points and a share of a person's code, together of unit size, activated."""
    return leaky_relu((x + CODE * code[:, None]) / math.sqrt(1 + CODE**2))


class GiraffeHD(Baseline):
    """Feature fields of foreground and background, laid over one another after their 2D renderers."""

    name = "giraffe-hd"
    config: GiraffeHDConfig

    def __init__(self, config: GiraffeHDConfig) -> None:
        super().__init__(config, Density(config.opacity, "density").requires_grad_(False))
        w_size, scene_size = config.mapping.w_size, config.scene.w_size
        self.scene = Mapping(config.scene)
        self.front = FeatureField(
            frequencies=config.frequencies,
            width=config.width,
            depth=config.depth,
            features=config.features,
            w_size=w_size,
            opacity=config.opacity,
        )
        self.back = FeatureField(
            frequencies=1,
            width=config.behind_width,
            depth=2,
            features=config.behind_features,
            w_size=scene_size,
            opacity=BEHIND_OPACITY,
        )
        self.back_density = Density(BEHIND_OPACITY, "density").requires_grad_(False)
        self.front_upsampler = Upsampler(
            config.render, features=config.features + 1, w_size=w_size, carried=CARRIED
        )
        self.back_upsampler = Upsampler(config.render, features=config.behind_features, w_size=scene_size)

    def generate(self, asked: Asked) -> Generated:
        w, late = self.styles(asked)
        scene = self.scene(asked.z, asked.camera)
        with without_autocast(w.device):
            rays = self.rays(asked, self.render.raw_size)
            within = within_bins(asked.seeds, rays.near, self.render.samples, RAYS)
            seen = render_once(partial(self.front, w.float(), self.box), rays, within, self.density)
            behind = self.background(asked, scene.float(), rays)
            raw = lay_over(seen.features[..., :3], seen.mask[..., None], behind[..., :3])
            color = seen.features[..., :3] / (seen.mask[..., None] + FAINT)
            sure = torch.logit(SURE * seen.mask + (1 - SURE) / 2)[..., None] / STEEP
        front = torch.cat([color, sure, seen.features[..., 3:]], dim=-1)
        front = self.front_upsampler(as_picture(front), late)
        mask = torch.sigmoid(STEEP * front[:, 3:])
        image = lay_over(front[:, :3] * mask, mask, self.back_upsampler(as_picture(behind), scene))
        return Generated(
            picture=picture_of(image, as_picture(raw), seen),
            losses=lambda: self.mask_losses(mask[:, 0].float(), self.meets_box(asked)),
        )

    def background(self, asked: Asked, w: Float[Tensor, "B D"], rays: Rays) -> Float[Tensor, "B P K"]:
        """Colours, on white, and features of what lies behind the box."""
        beyond = replace(rays, near=rays.far, far=rays.far + ROOM)
        within = within_bins(asked.seeds, rays.near, self.config.behind_samples, BEHIND)
        seen = render_once(partial(self.back, w, self.box), beyond, within, self.back_density)
        return torch.cat([paint_over(seen, BACKGROUND), seen.features[..., 3:]], dim=-1)

    def meets_box(self, asked: Asked) -> Bool[Tensor, "B S S"]:
        """Which pixels of the final picture show a part of the object's box."""
        with without_autocast(asked.camera.device):
            rays = self.rays(asked, self.render.image_size)
        return (rays.far > rays.near).unflatten(1, (self.render.image_size,) * 2)

    def mask_losses(
        self, mask: Float[Tensor, "B S S"], meets_box: Bool[Tensor, "B S S"]
    ) -> dict[str, Float[Tensor, ""]]:
        """The three regularisers of the final mask, weighted."""
        config = self.config
        missing = (config.least - mask.mean(dim=(1, 2))).clamp_min(0)
        return {
            "mask_coverage": config.coverage * missing.mean(),
            "mask_binary": config.binary * torch.minimum(mask, 1 - mask).mean(),
            "mask_inside": config.inside * (mask * ~meets_box).mean(),
        }


def lay_over(
    front: Float[Tensor, "B *any"], mask: Float[Tensor, "B *one"], behind: Float[Tensor, "B *any"]
) -> Float[Tensor, "B *any"]:
    """A foreground, whose colours are as bright as its mask is dense, before a background."""
    return front + (1 - mask) * behind


SIZES = {
    "debug": GiraffeHDConfig(
        mapping=told(z_size=16, features=16, width=32, layers=2),
        scene=told(z_size=16, features=0, width=16, layers=2),
        features=8,
        frequencies=4,
        width=16,
        depth=2,
        behind_width=8,
        behind_features=4,
    ),
    "shipped": GiraffeHDConfig(
        mapping=told(z_size=80, features=128, width=1280, layers=4),
        scene=told(z_size=80, features=0, width=64, layers=2),
    ),
    "gpu": GiraffeHDConfig(
        mapping=told(z_size=80, features=128, width=1536, layers=4),
        scene=told(z_size=80, features=0, width=64, layers=2),
        features=64,
    ),
    "paper": GiraffeHDConfig(
        mapping=told(z_size=512, features=512, width=1024, layers=8, learning_rate_multiplier=0.01),
        scene=told(z_size=512, features=0, width=256, layers=8, learning_rate_multiplier=0.01),
        features=256,
        frequencies=10,
        width=256,
        depth=8,
        behind_width=128,
        behind_features=64,
        behind_samples=8,
    ),
}
