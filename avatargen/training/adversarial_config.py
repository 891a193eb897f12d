"""Settings of the adversarial training and its presets: the only place where their defaults live.

`debug` runs in a minute; `cpu` is what a laptop learns with in hours; `gpu` is for one or a few GPUs;
`paper` follows section 4 of arXiv 2208.00561. Lengths are in pictures shown to the discriminator unless said
otherwise. The names of the losses are the paper's; their weights lie in the ranges that EG3D, StyleSDF and
xagen use.
"""

from dataclasses import dataclass, field, replace
from typing import Literal

from avatargen.errors import InputError
from avatargen.generator.config import (
    DEBUG,
    PAPER,
    SHIPPED,
    DeformationConfig,
    GeneratorConfig,
    GeometryConfig,
    RenderConfig,
)
from avatargen.ranges import MANY, require_ranges
from avatargen.training.discriminator import DiscriminatorConfig


@dataclass(frozen=True, kw_only=True)
class LossConfig:
    """Weights of the losses."""

    r1: float = 1.0
    r1_every: int = 16  # steps; the penalty is that many times as strong
    eikonal: float = 0.1
    minimal_surface: float = 0.01
    smpl: float = 0.5  # per metre; 0 leaves the body's surface out
    points: int = 192  # a person, where eikonal and minimal surface ask

    def __post_init__(self) -> None:
        weights = dict.fromkeys(("r1", "eikonal", "minimal_surface", "smpl"), (0.0, 1e6))
        require_ranges(self, "losses", weights | {"r1_every": (1, MANY), "points": (2, 1_000_000)})


@dataclass(frozen=True, kw_only=True)
class OptimizerConfig:
    """Adam, averaging of the weights, and when to give up."""

    generator_rate: float = 2.5e-3
    discriminator_rate: float = 2e-3
    density_share: float = 0.01  # of the generator's rate, for the sharpness, which is in metres; 0 holds it
    beta1: float = 0.0
    beta2: float = 0.99
    half_life: int = 10_000  # of the averaged weights
    ramp: float = 0.05  # the half-life is at most this share of the pictures shown so far
    largest_gradient: float = 1e4  # norm beyond which training stops

    def __post_init__(self) -> None:
        rates = dict.fromkeys(("generator_rate", "discriminator_rate"), (1e-12, 10.0))
        shares = dict.fromkeys(("beta1", "beta2"), (0.0, 0.999999)) | {"density_share": (0, 1e3)}
        lengths = {"half_life": (1, MANY), "ramp": (1e-6, 1e6), "largest_gradient": (1e-12, 1e12)}
        require_ranges(self, "optimizer", rates | shares | lengths)


@dataclass(frozen=True, kw_only=True)
class VarietyConfig:
    """What keeps the two networks from agreeing too early."""

    style_mixing: float = 0.0  # share of steps in which two latents share a person
    camera_swap: float = 0.5  # share of people whose latent is mapped under another picture's camera
    blur: float = 2.0  # pixels of Gaussian blur before the discriminator, at the start
    blur_fade: int = 10_000  # gone after this many

    def __post_init__(self) -> None:
        shares = dict.fromkeys(("style_mixing", "camera_swap"), (0.0, 1.0))
        require_ranges(self, "variety", shares | {"blur": (0, 100), "blur_fade": (1, MANY)})


@dataclass(frozen=True, kw_only=True)
class AdversarialConfig:
    """Everything a run depends on, beside its data and the weights it starts from."""

    networks: Literal["debug", "shipped", "gpu", "paper"] = "shipped"
    geometry: GeometryConfig = field(default_factory=GeometryConfig)
    deformation: DeformationConfig = field(default_factory=DeformationConfig)
    render: RenderConfig = field(default_factory=RenderConfig)
    discriminator: DiscriminatorConfig = field(default_factory=DiscriminatorConfig)
    losses: LossConfig = field(default_factory=LossConfig)
    optimizer: OptimizerConfig = field(default_factory=OptimizerConfig)
    variety: VarietyConfig = field(default_factory=VarietyConfig)
    images: int = 100_000  # the end
    batch: int = 8  # over all processes
    at_once: int = 0  # pictures that a process works on at a time, for less memory; 0: its whole share
    seed: int = 0
    snapshot_every: int = 2_000  # weights, which are kept, state and picture grid
    report_every: int = 10  # steps between lines of the log
    precision: Literal["no", "bf16", "fp16"] = "no"  # of both networks' convolutions; rendering keeps float32

    def __post_init__(self) -> None:
        if self.batch < 1 or self.batch % self.discriminator.group:
            raise InputError(
                f"training config: batch {self.batch} is no whole number of groups of "
                f"{self.discriminator.group}; change either"
            )
        if self.at_once and (self.batch % self.at_once or self.at_once % self.discriminator.group):
            raise InputError(
                f"training config: at_once {self.at_once} does not divide batch {self.batch} into whole "
                f"groups of {self.discriminator.group}; change either"
            )
        lengths = dict.fromkeys(("images", "snapshot_every", "report_every"), (1, MANY))
        require_ranges(self, "training", lengths | {"seed": (0, MANY)})
        require_ranges(self.render, "render", {"samples": (2, 4096), "shell": (0.001, 10)})
        require_ranges(self.render, "render", dict.fromkeys(("raw_size", "image_size"), (4, 4096)))
        require_ranges(self.render, "render", {"nearest": (1, 4), "initial_alpha": (1e-4, 10)})


MEDIUM = replace(
    SHIPPED,
    mapping=replace(SHIPPED.mapping, w_size=512, width=512),
    synthesis=replace(
        SHIPPED.synthesis,
        blocks=((4, 256), (8, 256), (16, 256), (32, 256), (64, 128), (128, 64)),
    ),
)
NETWORKS: dict[str, GeneratorConfig] = {"debug": DEBUG, "shipped": SHIPPED, "gpu": MEDIUM, "paper": PAPER}
NARROW = 0.12  # metres of shell: posed clothes hang nearer to the body than spread ones

PRESETS = {
    "debug": AdversarialConfig(
        networks="debug",
        deformation=DEBUG.deformation,
        render=replace(DEBUG.render, shell=NARROW, samples=8),
        discriminator=DiscriminatorConfig(capacity=256, channels=32, condition=16, group=2),
        losses=LossConfig(points=48),
        variety=VarietyConfig(blur_fade=200),
        images=400,
        batch=4,
        snapshot_every=200,
        report_every=5,
    ),
    "cpu": AdversarialConfig(
        deformation=DeformationConfig(width=32, depth=2, frequencies=4),
        render=replace(SHIPPED.render, shell=NARROW, samples=12, initial_alpha=0.003),
        # left to itself the surface turns to haze as soon as the discriminator sees details
        losses=LossConfig(eikonal=0.5, minimal_surface=0.05, smpl=2.0),
        optimizer=OptimizerConfig(
            generator_rate=5e-4, discriminator_rate=1e-3, density_share=0.0, half_life=1_000
        ),
        variety=VarietyConfig(blur_fade=20_000),
    ),
    "gpu": AdversarialConfig(
        networks="gpu",
        render=replace(
            SHIPPED.render, raw_size=64, image_size=256, samples=24, shell=NARROW, upsampler_channels=128
        ),
        discriminator=DiscriminatorConfig(capacity=16384, channels=512, condition=256),
        variety=VarietyConfig(blur=8.0, blur_fade=200_000),
        images=10_000_000,
        batch=32,
        snapshot_every=50_000,
        precision="bf16",
    ),
    "paper": AdversarialConfig(
        networks="paper",
        render=PAPER.render,
        discriminator=DiscriminatorConfig(capacity=32768, channels=512, condition=512),
        losses=LossConfig(r1=10.0, eikonal=1e-3, minimal_surface=0.05, smpl=1.0, points=1024),
        variety=VarietyConfig(style_mixing=0.9, blur=10.0, blur_fade=200_000),
        images=25_000_000,
        batch=32,
        at_once=8,
        snapshot_every=100_000,
        precision="bf16",
    ),
}
