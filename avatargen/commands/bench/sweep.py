"""What is measured at each setting: the surface over resolution and faces, the texture over its size, the
generator's mapping over its neighbours, volume rendering over its steps.

Each point of a sweep is a row: what was set, what it cost, how far it is from the truth. Seconds are the
processor's: with the bench's one thread what a clock shows on an idle machine, and the same on a busy one.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product, takewhile

import numpy as np
import torch

from assets.build_config import BuildConfig
from assets.charting import Charting
from assets.draft import Draft, open_draft
from assets.mesh.surface import Surface, find_defects, smallest_angles
from assets.pipeline import plan_for, run
from assets.skin.attach import attach
from assets.skin.skin import SkinConfig, skin_attached
from assets.texture.bake import BakeConfig, bake_texture
from avatargen.avatar import Avatar
from avatargen.commands.bench.cost import Cost, measured
from avatargen.commands.bench.poses import posed_error
from avatargen.commands.bench.truth import Truth, match, normal_errors, texture_psnr
from avatargen.generator.person_field import PersonField
from avatargen.generator.renderer import box_interval, composite, stratify
from exporters.png import encode_png

SLIVER = 5.0  # degrees; a face with a smaller angle is one
RAYS = 48  # along the sides of the picture
REFERENCE_STEPS = 256


@dataclass(frozen=True, kw_only=True)
class SurfaceRow:
    """One mesh. Millimetres from mesh to field and from field to mesh, degrees between normals."""

    seed: int
    resolution: int
    faces: int
    seconds: dict[str, float]
    peak_mb: float
    mean_mm: float
    p99_mm: float
    max_mm: float
    back_mean_mm: float
    back_p99_mm: float
    back_max_mm: float
    normal_mean_deg: float
    normal_p99_deg: float
    slivers: float  # share of faces with an angle under 5 degrees
    closed: bool

    @property
    def total(self) -> float:
        return sum(self.seconds.values())


@dataclass(frozen=True, kw_only=True)
class TextureRow:
    """One texture on the default mesh; bytes are the picture's."""

    seed: int
    size: int
    seconds: dict[str, float]
    peak_mb: float
    psnr_db: float
    bytes: int


@dataclass(frozen=True, kw_only=True)
class MappingRow:
    """The generator's mapping with `nearest` neighbours, there and back over twenty poses."""

    seed: int
    nearest: int
    mean_mm: float
    median_mm: float
    p95_mm: float
    mapping_us: float
    stretch_p999: float  # edges in their worst pose over their canonical lengths
    stretch_max: float


@dataclass(frozen=True, kw_only=True)
class RayRow:
    """A picture by volume rendering with so many steps a ray, against one with 256."""

    seed: int
    steps: int
    seconds: float
    psnr_db: float


def sweep_surfaces(
    avatar: Avatar, truth: Truth, resolutions: Sequence[int], faces: Sequence[int]
) -> Iterator[SurfaceRow]:
    """Every resolution with every number of faces that it can give."""
    for resolution, count in product(resolutions, faces):
        row = surface_row(avatar, truth, BuildConfig(resolution=resolution, faces=count))
        if row is not None:
            yield row


def surface_row(avatar: Avatar, truth: Truth, config: BuildConfig) -> SurfaceRow | None:
    """A mesh and what it took; None where the surface has no more faces than asked for."""
    assert config.faces is not None, "a sweep is of numbers of faces"
    draft, costs = run_to_charts(avatar, config)
    if config.faces >= len(draft.cleaning.surface.faces):
        return None
    surface, error, found = draft.surface, draft.error, match(truth, draft.surface)
    back = 1000 * found.distance
    normals = normal_errors(truth, surface, found)
    return SurfaceRow(
        seed=avatar.seed,
        resolution=config.resolution,
        faces=config.faces,
        seconds={stage: cost.cpu_seconds for stage, cost in costs.items()},
        peak_mb=max(cost.peak_mb for cost in costs.values()),
        mean_mm=error.mean_mm,
        p99_mm=error.p99_mm,
        max_mm=error.max_mm,
        back_mean_mm=float(back.mean()),
        back_p99_mm=float(np.quantile(back, 0.99)),
        back_max_mm=float(back.max()),
        normal_mean_deg=float(normals.mean()),
        normal_p99_deg=float(np.quantile(normals, 0.99)),
        slivers=float((smallest_angles(surface) < SLIVER).mean()),
        closed=not find_defects(surface),
    )


def run_to_charts(avatar: Avatar, config: BuildConfig) -> tuple[Draft, dict[str, Cost]]:
    """The pipeline from the field to charts, and what each of its stages cost."""
    costs: dict[str, Cost] = {}
    with open_draft(avatar, config, charts=True) as draft:
        for stage in takewhile(lambda stage: stage.name != "bake", plan_for(config).stages):
            with measured() as costs[stage.name]:
                stage.run(draft)
                if stage.name == "charts" and draft.charting is not None:
                    draft.charting.result()  # beside other stages its seconds would count as theirs
    return draft, costs


def default_surface(avatar: Avatar, resolution: int, faces: int) -> Surface:
    """The mesh that textures and poses are measured on."""
    config = BuildConfig(content="mesh", resolution=resolution, faces=faces)
    with open_draft(avatar, config, charts=False) as draft:
        run(plan_for(config), draft)
    return draft.surface


def sweep_textures(
    avatar: Avatar, truth: Truth, surface: Surface, sizes: Sequence[int]
) -> Iterator[TextureRow]:
    """Every size, each with charts of its own."""
    found = match(truth, surface)
    for size in sizes:
        with Charting() as charting:
            charting.begin(surface, avatar.body, BuildConfig(texture=size))
            atlas = charting.result()
        with measured() as baking:
            texture = bake_texture(surface, atlas, avatar.color, BakeConfig(texture_size=size))
        with measured() as encoding:
            picture = encode_png(texture.texels)
        yield TextureRow(
            seed=avatar.seed,
            size=size,
            seconds={"bake": baking.cpu_seconds, "encode": encoding.cpu_seconds},
            peak_mb=max(baking.peak_mb, encoding.peak_mb),
            psnr_db=texture_psnr(truth, atlas, texture.texels, found),
            bytes=len(picture),
        )


def sweep_mapping(avatar: Avatar, surface: Surface, neighbours: Sequence[int]) -> Iterator[MappingRow]:
    """Twenty poses for every number of neighbours."""
    attachment = attach(surface, avatar.body)
    skin = skin_attached(attachment, avatar.body, SkinConfig())
    for nearest in neighbours:
        error = posed_error(surface, skin, attachment, avatar, nearest)
        yield MappingRow(seed=avatar.seed, nearest=nearest, **vars(error))


def sweep_rays(avatar: Avatar, steps: Sequence[int]) -> Iterator[RayRow]:
    """Every number of steps, against the reference."""
    reference = picture(avatar, REFERENCE_STEPS)
    for count in steps:
        with measured() as cost:
            error = picture(avatar, count) - reference
        noise = max(float((error**2).mean()), 1e-12)
        yield RayRow(
            seed=avatar.seed, steps=count, seconds=cost.cpu_seconds, psnr_db=float(-10 * np.log10(noise))
        )


@torch.inference_mode()
def picture(avatar: Avatar, steps: int) -> torch.Tensor:
    """Colours [P 3] along parallel rays from the front in the canonical pose, on white."""
    low, high = torch.from_numpy(avatar.bounds)
    x, y = (torch.linspace(float(low[a]), float(high[a]), RAYS) for a in (0, 1))
    place = torch.stack(torch.meshgrid(x, y, indexing="xy"), dim=-1).reshape(-1, 2)
    origin = torch.cat([place, torch.full((len(place), 1), float(high[2]) + 0.1)], dim=1)
    direction = torch.tensor([0.0, 0.0, -1.0]).expand_as(origin)
    near, far = box_interval(origin, direction, torch.from_numpy(avatar.bounds))
    samples = stratify(near, far, steps)
    points = (origin[:, None] + samples.depth[..., None] * direction[:, None]).reshape(-1, 3)
    assert isinstance(avatar.field, PersonField)
    density, distance = avatar.field.generator.density, avatar.sdf(points).view(-1, steps)
    sigma = density(distance)
    dense = torch.nn.functional.max_pool1d(sigma[:, None], 3, stride=1, padding=1)  # also at a neighbour's
    lit = (dense > 0.01 * sigma.max()).flatten()
    colors = torch.zeros(len(points), 3)
    colors[lit] = avatar.color(points[lit])
    seen = composite(distance, colors.view(-1, steps, 3), samples, far, density)
    return seen.features + (1 - seen.mask[:, None])
