"""Settings of the generator, the only place where their defaults live, and the presets.

`debug` runs in seconds; `shipped` is what the default weights use, sized for a CPU; `paper` follows arXiv
2208.00561. What depends on the body (box, vertex count, where the head is) is filled in by `for_body`.
"""

import hashlib
from dataclasses import dataclass, field, replace

import numpy as np

from avatargen.body.model import CanonicalBody
from avatargen.errors import InputError
from avatargen.generator.parts import JOINTS_OF_PARTS, Parts

MAX_SIZE = 4096  # widths, depths, resolutions
MAX_VERTICES = 2_000_000
COLOURS = 3
# numbers of which 0 means: without
MAY_BE_NONE = (
    "camera_features",
    "code_size",
    "regions",
    "vertex_features",
    "vertex_count",
    "frequencies",
    "shape_count",
)

Knots = tuple[tuple[float, float], ...]


@dataclass(frozen=True, kw_only=True)
class MappingConfig:
    """Mapping network (section 3.2): z and the camera to w."""

    z_size: int = 80
    camera_size: int = 25
    camera_features: int = 32  # width of the embedded camera; 0 leaves the camera out
    w_size: int = 448
    width: int = 512
    layers: int = 4
    normalize: bool = (
        False  # bring each z to unit mean square; this loses the length of z, which a coding may use
    )
    sign_gain: float = 200.0  # > 0: also feed tanh(gain z), so that attributes coded by signs switch sharply
    learning_rate_multiplier: float = 1.0
    average_decay: float = 0.998


@dataclass(frozen=True, kw_only=True)
class SynthesisConfig:
    """Tri-plane synthesis (section 3.2): (resolution, channels) from 4 up, doubling."""

    blocks: tuple[tuple[int, int], ...] = ((4, 64), (8, 64), (16, 48), (32, 32))
    plane_channels: int = 32
    noise: bool = False  # fixed per-pixel noise with a learned strength; off keeps fields free of it

    @property
    def resolution(self) -> int:
        return self.blocks[-1][0]


@dataclass(frozen=True, kw_only=True)
class PlanesConfig:
    """Where the planes lie: a box in metres, and an optional monotone warp of each axis."""

    low: tuple[float, float, float] = (-1.05, -1.2, -0.35)
    high: tuple[float, float, float] = (1.05, 1.0, 0.4)
    head_gain: float = 2.5  # texels per metre on the head over those elsewhere; 1 is no warp
    warp: tuple[Knots, Knots, Knots] | None = (
        None  # per axis (place, texel coordinate), both 0..1; see `for_body`
    )


@dataclass(frozen=True, kw_only=True)
class DecoderConfig:
    """Field decoder (section 3.2): plane features and body distance to residual, colour and features."""

    width: int = 64
    depth: int = 3  # hidden layers
    activation: str = "leaky_relu"  # or softplus
    features: int = 32  # what the renderer collects; the first three are the colour
    # what follows is not in the paper
    split: bool = True  # a network for each part of the body, where the body has SMPL's joint names
    parts: Parts = ()  # places of each part in the canonical space, metres; see `for_body`
    code_size: int = 48  # numbers a part's network takes from w to make the person's own layers; 0: none
    regions: int = 16  # colours of its own that a person has in each part; 0: none
    gated: bool = (
        True  # the residual may also take back a share of the body's distance, for free-hanging cloth
    )
    vertex_features: int = 32  # learned numbers per body vertex, shared by all people
    frequencies: int = 6  # of the encoded canonical point; 0 leaves the point out
    residual_scale: float = 0.1  # metres per unit of the last layer
    residual_limit: float = 0.5  # metres; softly kept by a tanh


@dataclass(frozen=True, kw_only=True)
class DeformationConfig:
    """Residual deformation network (section 3.3)."""

    width: int = 128
    depth: int = 6
    frequencies: int = 10
    output_scale: float = 0.1  # metres per unit of the last layer


@dataclass(frozen=True, kw_only=True)
class GeometryConfig:
    """What Table 2 of the paper compares; the defaults are what it settles on.

    Raises:
        InputError: a value that is none of the choices, or a residual to a body distance that is not asked.
    """

    representation: str = "sdf"  # or density: no surface, no distance, no geometry losses
    deformation: str = "both"  # inverse_skinning, residual (the network alone), or both
    prior: str = "canonical"  # where the body distance that the decoder reads is taken: observed, or none
    distance: str = "residual"  # predicted relative to the body's distance, or raw

    def __post_init__(self) -> None:
        for name, choices in GEOMETRY_CHOICES.items():
            if getattr(self, name) not in choices:
                raise InputError(
                    f"generator config: {name} = {getattr(self, name)!r}; choose {', '.join(choices)}"
                )
        if self.prior == "none" and self.distance == "residual":
            raise InputError("generator config: a residual needs a body distance; take distance raw")


GEOMETRY_CHOICES = {
    "representation": ("sdf", "density"),
    "deformation": ("both", "inverse_skinning", "residual"),
    "prior": ("canonical", "observed", "none"),
    "distance": ("residual", "raw"),
}


@dataclass(frozen=True, kw_only=True)
class RenderConfig:
    """Volume rendering (section 3.4) and the upsampling decoder."""

    nearest: int = 1  # posed body vertices that carry a point back to the canonical space, 1 to 4
    raw_size: int = 32  # pixels a side of the rendered feature picture
    image_size: int = 64  # pixels a side after upsampling; raw_size times a power of two
    samples: int = 24  # per ray
    shell: float = 0.25  # metres around the posed body within which rays are sampled
    initial_alpha: float = 0.01  # metres; sharpness of the density
    upsampler_channels: int = 32


@dataclass(frozen=True, kw_only=True)
class GeneratorConfig:
    """The whole generator."""

    mapping: MappingConfig = field(default_factory=MappingConfig)
    synthesis: SynthesisConfig = field(default_factory=SynthesisConfig)
    planes: PlanesConfig = field(default_factory=PlanesConfig)
    decoder: DecoderConfig = field(default_factory=DecoderConfig)
    deformation: DeformationConfig = field(default_factory=DeformationConfig)
    geometry: GeometryConfig = field(default_factory=GeometryConfig)
    render: RenderConfig = field(default_factory=RenderConfig)
    joint_count: int = 24
    vertex_count: int = 0  # of the body it is trained on; 0 until `for_body`
    shape_count: int = 10
    body_hash: str = ""  # of the canonical body it is trained on

    def __post_init__(self) -> None:
        require_sane_sizes(self)
        for (small, _), (large, _) in zip(self.synthesis.blocks, self.synthesis.blocks[1:], strict=False):
            if large != 2 * small:
                raise InputError(f"generator config: resolution {large} follows {small}; each must double")
        if self.decoder.activation not in ("leaky_relu", "softplus"):
            raise InputError(
                f"generator config: no activation {self.decoder.activation!r}; leaky_relu or softplus"
            )
        if not 1 <= self.render.nearest <= 4:
            raise InputError(
                f"generator config: nearest = {self.render.nearest}; choose 1 to 4 body vertices"
            )
        if self.geometry.prior == "none" and self.decoder.vertex_features:
            raise InputError("generator config: vertex features tell where the body is; prior none has none")
        steps = self.render.image_size / self.render.raw_size
        if steps < 1 or np.log2(steps) % 1:
            raise InputError(
                f"generator config: image size is {steps} times the raw size; a power of two is needed"
            )


def require_sane_sizes(config: GeneratorConfig) -> None:
    """Bound every whole number, so that a damaged checkpoint cannot ask for any amount of memory.

    Raises:
        InputError: a number is negative or too large.
    """
    parts = (config.mapping, config.synthesis, config.decoder, config.deformation, config.render, config)
    for part in parts:
        for name, value in vars(part).items():
            low, high = int(name not in MAY_BE_NONE), MAX_VERTICES if name == "vertex_count" else MAX_SIZE
            if isinstance(value, int) and not isinstance(value, bool) and not low <= value <= high:
                raise InputError(f"generator config: {name} = {value}; it must be {low} to {high}")
    if config.decoder.features < COLOURS:
        raise InputError(f"generator config: {config.decoder.features} features; a colour takes {COLOURS}")
    if not config.synthesis.blocks or max(max(block) for block in config.synthesis.blocks) > MAX_SIZE:
        raise InputError(
            f"generator config: blocks {config.synthesis.blocks}; sizes up to {MAX_SIZE} are taken"
        )


SHIPPED = GeneratorConfig()
DEBUG = GeneratorConfig(
    mapping=MappingConfig(z_size=16, camera_features=8, w_size=32, width=32, layers=2),
    synthesis=SynthesisConfig(blocks=((4, 16), (8, 16), (16, 16)), plane_channels=8),
    decoder=DecoderConfig(
        width=16, depth=2, split=False, code_size=8, regions=4, vertex_features=4, frequencies=2
    ),
    deformation=DeformationConfig(width=16, depth=2, frequencies=2),
    render=RenderConfig(raw_size=8, image_size=16, samples=6, upsampler_channels=8),
)
PAPER = GeneratorConfig(
    mapping=MappingConfig(
        z_size=512,
        camera_features=512,
        w_size=512,
        width=512,
        layers=8,
        normalize=True,
        sign_gain=0.0,
        learning_rate_multiplier=0.01,
    ),
    synthesis=SynthesisConfig(
        blocks=((4, 512), (8, 512), (16, 512), (32, 512), (64, 256), (128, 128), (256, 64)), noise=True
    ),
    planes=PlanesConfig(head_gain=1.0),
    decoder=DecoderConfig(
        depth=1,
        activation="softplus",
        split=False,
        code_size=0,
        regions=0,
        gated=False,
        vertex_features=0,
        frequencies=0,
    ),
    render=RenderConfig(raw_size=128, image_size=512, samples=48, initial_alpha=0.1, upsampler_channels=256),
)
PRESETS = {"debug": DEBUG, "shipped": SHIPPED, "paper": PAPER}


def for_body(
    config: GeneratorConfig, body: CanonicalBody, margin: tuple[float, float, float] = (0.1, 0.1, 0.24)
) -> GeneratorConfig:
    """Fit a preset to a body: its box with a margin in metres per axis (skirts reach far along z), counts,
    hash, and the warp that favours its head.

    Raises:
        InputError: the margin is not positive.
    """
    if not min(margin) > 0:
        raise InputError(f"generator config: margin {margin} m; the box must reach beyond the body")
    low = body.vertices.min(axis=0) - np.array(margin)
    high = body.vertices.max(axis=0) + np.array(margin)
    planes = replace(config.planes, low=triple(low), high=triple(high))
    if planes.head_gain != 1 and "head" in body.joint_names:
        planes = replace(planes, warp=head_warp(body, low, high, planes.head_gain))
    decoder = replace(config.decoder, parts=parts_of(body)) if config.decoder.split else config.decoder
    return replace(
        config,
        planes=planes,
        decoder=decoder,
        joint_count=len(body.parents),
        vertex_count=len(body.vertices),
        shape_count=body.source.shapedirs.shape[2],
        body_hash=body_hash(body),
    )


def parts_of(body: CanonicalBody) -> Parts:
    """The places of the body's parts, or none where a joint that makes them is missing."""
    if not {name for part in JOINTS_OF_PARTS for name in part} <= set(body.joint_names):
        return ()
    return tuple(
        tuple(triple(body.joints[body.joint_names.index(name)]) for name in part) for part in JOINTS_OF_PARTS
    )


def triple(values: np.ndarray) -> tuple[float, float, float]:
    x, y, z = (round(float(value), 4) for value in values)
    return (x, y, z)


def head_warp(
    body: CanonicalBody, low: np.ndarray, high: np.ndarray, gain: float
) -> tuple[Knots, Knots, Knots]:
    """Piecewise-linear warp of each axis that gives the head's interval `gain` times the texels per metre."""
    on_head = body.weights[:, body.joint_names.index("head")] > 0.5
    if not on_head.any():
        straight = ((0.0, 0.0), (1.0, 1.0))
        return (straight, straight, straight)
    head = (body.vertices[on_head] - low) / (high - low)
    x, y, z = (
        interval_warp(float(start), float(end), gain)
        for start, end in zip(head.min(axis=0), head.max(axis=0), strict=True)
    )
    return (x, y, z)


def interval_warp(start: float, end: float, gain: float) -> Knots:
    """Knots of the map of 0..1 onto itself that is `gain` times as steep on start..end as outside it."""
    outside = 1 / (1 + (gain - 1) * (end - start))
    first = start * outside
    second = first + (end - start) * outside * gain
    return ((0.0, 0.0), (round(start, 6), round(first, 6)), (round(end, 6), round(second, 6)), (1.0, 1.0))


def body_hash(body: CanonicalBody) -> str:
    """sha256 of the canonical vertices (to a tenth of a millimetre) and the faces: tells bodies apart."""
    vertices = np.rint(body.vertices.astype(np.float64) * 1e4).astype("<i4")
    return hashlib.sha256(vertices.tobytes() + body.faces.astype("<i4").tobytes()).hexdigest()
