"""From an avatar's fields to an asset: the stages in order, timed.

extract -> clean -> simplify -> skin -> measure, rest -> bake
                                  `---> atlas (its own process) ---'
"""

import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, Protocol, runtime_checkable

import numpy as np
import torch
from jaxtyping import Float

from assets.asset import Asset, AssetInfo, Report, Skeleton
from assets.atlas import Atlas, AtlasConfig, unwrap
from assets.attach import attach
from assets.bake import BakeConfig, bake_texture
from assets.clean import tidy
from assets.extract import ExtractConfig, trace
from assets.fit import fit
from assets.measure import surface_error
from assets.rest import to_rest
from assets.simplify import SimplifyConfig, simplify
from assets.skin import SkinConfig, parts_of_faces, skin_attached
from assets.surface import Surface, find_defects
from avatargen.body.model import CanonicalBody
from avatargen.body.pose import named_pose
from avatargen.errors import InputError

Progress = Callable[[str, float], None]  # name of the stage that begins, share of the work behind it
SHARES = {
    "extract": 0.4,
    "clean": 0.08,
    "simplify": 0.15,
    "skin": 0.05,
    "measure": 0.1,
    "rest": 0.02,
    "atlas": 0.05,
    "bake": 0.15,
}
DETAILED_JOINT = "head"  # whose part of the texture is finer: people look at faces


@runtime_checkable
class AvatarFields(Protocol):
    """What is needed of an avatar: fields in the canonical space, the canonical body, and where it comes
    from."""

    @property
    def body(self) -> CanonicalBody: ...

    @property
    def betas(self) -> np.ndarray: ...

    @property
    def bounds(self) -> np.ndarray: ...

    @property
    def info(self) -> Any: ...

    def sdf(self, points: torch.Tensor) -> torch.Tensor: ...

    def color(self, points: torch.Tensor) -> torch.Tensor: ...


@dataclass(frozen=True, kw_only=True)
class BuildConfig:
    """What the asset is to have. Raises InputError for values out of range."""

    resolution: int = 512  # cells along the longest side of the avatar's box
    faces: int = 20_000
    texture: int = 1024  # texels along a side
    pose: str | Float[np.ndarray, "J 3"] = field(default="a", hash=False)  # rest pose: x, t, a or axis-angle
    head_detail: float = 2.0  # texels along a line on the head for one on the body
    on_ground: bool = True  # soles at y = 0; otherwise the pelvis stays where the body model has it

    def __post_init__(self) -> None:
        ExtractConfig(resolution=self.resolution)
        SimplifyConfig(target_faces=self.faces)
        BakeConfig(texture_size=self.texture)
        AtlasConfig(texture_size=self.texture, scales=((0, self.head_detail),))


def build(avatar: AvatarFields, config: BuildConfig | None = None, progress: Progress | None = None) -> Asset:
    """The avatar as a rigged, textured mesh in a rest pose.

    Raises:
        InputError: a pose that does not fit the body.
        GeometryError: the field has no closed surface inside the avatar's bounds, or it cannot be kept whole.
        FieldError: the field is NaN or infinite.
    """
    config = config or BuildConfig()
    rotations = find_pose(config.pose, avatar.body)
    clock = Clock(progress)
    with clock("extract"):
        extraction = trace(avatar.sdf, avatar.bounds, ExtractConfig(resolution=config.resolution))
    with clock("clean"):
        cleaning = tidy(extraction.surface)
    with clock("simplify"):
        surface = simplify_fitted(cleaning.surface, avatar, config)
    with clock("skin"):
        attachment = attach(surface, avatar.body)
        skin = skin_attached(attachment, avatar.body, SkinConfig())
    with ThreadPoolExecutor(1) as beside:
        charts = beside.submit(
            unwrap, surface, parts_of_faces(surface, skin), atlas_config(avatar.body, config)
        )
        with clock("measure"):
            error = surface_error(surface, avatar.sdf)
        with clock("rest"):
            rest = to_rest(surface, skin, attachment, avatar.body, avatar.betas, rotations, config.on_ground)
        with clock("atlas"):
            atlas = charts.result()
    with clock("bake"):
        texture = bake_texture(surface, atlas, avatar.color, BakeConfig(texture_size=config.texture))
    return Asset(
        vertices=rest.vertices[atlas.vertex_map].astype(np.float32),
        normals=rest.normals[atlas.vertex_map].astype(np.float32),
        uv=atlas.uv,
        faces=atlas.faces,
        joints=skin.joints[atlas.vertex_map],
        weights=skin.weights[atlas.vertex_map],
        texture=texture.texels,
        skeleton=Skeleton(
            joint_names=avatar.body.joint_names,
            parents=avatar.body.parents,
            T_world_joint=rest.T_world_joint,
            turns=rest.turns,
        ),
        info=asset_info(avatar),
        welded=atlas.vertex_map,
        report=Report(
            seconds=tuple(clock.seconds.items()),
            error=error,
            welded_vertices=len(surface.vertices),
            queries=extraction.queries,
            dropped_components=cleaning.dropped_components,
            texture_coverage=texture.coverage,
            left_out=left_out(surface, atlas, config),
        ),
    )


class Clock:
    """Seconds of each stage, and a word to whoever watches when one begins."""

    def __init__(self, progress: Progress | None) -> None:
        self.progress = progress
        self.seconds: dict[str, float] = {}

    @contextmanager
    def __call__(self, stage: str) -> Iterator[None]:
        if self.progress is not None:
            self.progress(stage, sum(SHARES[done] for done in self.seconds))
        start = time.perf_counter()
        yield
        self.seconds[stage] = time.perf_counter() - start


def find_pose(pose: str | Float[np.ndarray, "J 3"], body: CanonicalBody) -> Float[np.ndarray, "J 3"]:
    """Axis-angle rotations of a named pose, or those given.

    Raises:
        InputError: an unknown name, or rotations that do not fit the body.
    """
    if isinstance(pose, str):
        return named_pose(pose, body.joint_names)
    if pose.shape != (len(body.parents), 3) or not np.isfinite(pose).all():
        raise InputError(
            f"pose: rotations have shape {pose.shape}; finite [{len(body.parents)}, 3] are needed"
        )
    return pose


def simplify_fitted(dense: Surface, avatar: AvatarFields, config: BuildConfig) -> Surface:
    """The surface at the faces asked for, moved onto the field where that leaves it sound."""
    simple = simplify(dense, SimplifyConfig(target_faces=config.faces))
    fitted = fit(simple, avatar.sdf)
    return simple if find_defects(fitted) else fitted


def atlas_config(body: CanonicalBody, config: BuildConfig) -> AtlasConfig:
    """Charts for the texture's size, finer on the head of a body that has one."""
    scales: tuple[tuple[int, float], ...] = ()
    if DETAILED_JOINT in body.joint_names:
        scales = ((body.joint_names.index(DETAILED_JOINT), config.head_detail),)
    return AtlasConfig(texture_size=config.texture, scales=scales)


def asset_info(avatar: AvatarFields) -> AssetInfo:
    """Where the asset comes from."""
    info = avatar.info
    return AssetInfo(
        seed=info.seed,
        weights_hash=info.weights_hash,
        version=info.version,
        licence=info.licence,
        betas=tuple(float(beta) for beta in avatar.betas),
    )


def left_out(surface: Surface, atlas: Atlas, config: BuildConfig) -> tuple[str, ...]:
    """What was not done, and why."""
    reasons = [
        "deformation network: the surface is taken in the canonical pose, where it has nothing to correct",
        "volume rendering and upsampling: a file holds a surface, not a picture",
    ]
    if len(surface.faces) < 0.98 * config.faces:
        reasons.append(f"simplification: the surface has only {len(surface.faces)} faces at this resolution")
    if atlas.plain:
        reasons.append(f"charts: faces are packed one by one, because {atlas.plain}")
    return tuple(reasons)
