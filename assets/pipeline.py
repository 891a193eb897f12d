"""From an avatar's fields to an asset: the stages in order, timed.

extract -> clean -> simplify -> skin -> fit, measure, rest -> bake -> normals, occlusion on request
                                    `-> atlas, in its own process -'

Which of them run is planned first (`assets.plan`): a mesh alone has no atlas and no colours.
"""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any, Protocol, runtime_checkable

import numpy as np
import torch
from jaxtyping import Float

from assets.asset import Asset, AssetInfo, PlainAsset, Report, TexturedAsset
from assets.atlas import Atlas, AtlasConfig, unwrap
from assets.attach import Attachment, attach
from assets.bake import BakeConfig, Texture, bake_texture
from assets.bones import Bones, add_ends, aim_bones
from assets.clean import Cleaning, tidy
from assets.clock import Clock, Progress
from assets.extract import ExtractConfig, Extraction, trace_whole
from assets.joints import body_on, drop_idle_joints
from assets.measure import SurfaceError, missed_error, surface_error
from assets.morph import beta_sliders
from assets.normal_map import bake_normals
from assets.occlusion import bake_occlusion, distance_to
from assets.plan import Content, Joints, LeftOut, Plan, make_plan
from assets.reduce import reduce, settle
from assets.rest import RestMesh, to_rest
from assets.rig import Morph, Skeleton
from assets.simplify import SimplifyConfig
from assets.skin import Skin, SkinConfig, parts_of_faces, skin_attached
from assets.surface import Surface
from avatargen.body.fingers import hand_of_joint
from avatargen.body.model import CanonicalBody
from avatargen.body.pose import named_pose
from avatargen.errors import InputError

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

    content: Content = "rigged"
    resolution: int = 512  # cells along the longest side of the avatar's box
    faces: int | None = 20_000  # None: all that the resolution gives, for a mesh alone
    texture: int = 1024  # texels along a side
    joints: Joints = "all"  # 24: no fingers; moving: those alone that move a vertex or carry one that does
    pose: str | Float[np.ndarray, "J 3"] = field(default="a", hash=False)  # rest pose: x, t, a or axis-angle
    head_detail: float = 2.0  # texels along a line on the head for one on the body
    normal_map: int | None = None  # texels along a side of the field's own normals; None: none
    ambient_occlusion: int | None = None  # texels along a side of how open the surface lies; None: none
    bones: Bones = "along"  # joints' frames have +y along their bones; world: they are the world's
    ends: bool = False  # a joint that moves nothing where each last bone ends
    morphs: bool = False  # a slider for each of the body's shape directions
    on_ground: bool = True  # soles at y = 0; otherwise the pelvis stays where the body model has it

    def __post_init__(self) -> None:
        ExtractConfig(resolution=self.resolution)
        if self.faces is not None:
            SimplifyConfig(target_faces=self.faces)
        BakeConfig(texture_size=self.texture)
        AtlasConfig(texture_size=self.texture, scales=((0, self.head_detail),))
        BakeConfig(texture_size=self.normal_map or self.texture)
        BakeConfig(texture_size=self.ambient_occlusion or self.texture)
        self.plan()

    def plan(self) -> Plan:
        """The stages that this takes. Raises InputError for settings that do not go together."""
        maps = self.normal_map is not None, self.ambient_occlusion is not None
        return make_plan(self.content, self.faces, self.joints, *maps)


@dataclass(frozen=True, kw_only=True)
class Shape:
    """A mesh on the way: canonical, skinned, measured, posed, and unwrapped where that is planned."""

    extraction: Extraction
    cleaning: Cleaning
    body: CanonicalBody  # on the joints that are wanted
    surface: Surface
    attachment: Attachment
    skin: Skin
    error: SurfaceError
    missed: SurfaceError | None
    rest: RestMesh
    atlas: Atlas | None


def build(avatar: AvatarFields, config: BuildConfig | None = None, progress: Progress | None = None) -> Asset:
    """The avatar as a rigged, textured mesh in a rest pose.

    Raises:
        InputError: a pose that does not fit the body, or settings that ask for less than a rigged asset.
        GeometryError: the field has no closed surface inside the avatar's bounds, or it cannot be kept whole.
        FieldError: the field is NaN or infinite.
    """
    asset = build_content(avatar, config or BuildConfig(), progress)
    if not isinstance(asset, Asset):
        raise InputError("build: the settings leave out the skeleton; use build_content for such assets")
    return asset


def build_content(avatar: AvatarFields, config: BuildConfig, progress: Progress | None = None) -> PlainAsset:
    """The avatar as what `config.content` asks for: a `PlainAsset`, `TexturedAsset` or `Asset`.

    Raises the errors of `build`, but for settings that ask for less.
    """
    clock = Clock(config.plan(), progress)
    shape = make_shape(avatar, config, clock)
    texture = normal_map = occlusion = None
    if shape.atlas is not None:
        with clock("bake"):
            texture = bake_texture(
                shape.surface, shape.atlas, avatar.color, BakeConfig(texture_size=config.texture)
            )
    if shape.atlas is not None and config.normal_map is not None:
        size = BakeConfig(texture_size=config.normal_map)
        with clock("normals"):
            normal_map = bake_normals(shape.surface, shape.rest, shape.atlas, avatar.sdf, size)
    if shape.atlas is not None and config.ambient_occlusion is not None:
        size = BakeConfig(texture_size=config.ambient_occlusion)
        with clock("occlusion"):
            occlusion = bake_occlusion(shape.surface, shape.atlas, distance_to(shape.surface), size)
    plain = plain_asset(avatar, shape, make_report(shape, texture, config, clock))
    if shape.atlas is None or texture is None:
        return plain
    textured = TexturedAsset(
        **vars(plain),
        uv=shape.atlas.uv,
        texture=texture.texels,
        normal_map=normal_map,
        occlusion=occlusion,
    )
    return textured if config.content == "textured" else rig(textured, shape, shape.atlas, avatar, config)


def make_shape(avatar: AvatarFields, config: BuildConfig, clock: Clock) -> Shape:
    """The stages that make the mesh; charts are cut in a process of their own meanwhile."""
    body = body_on(avatar.body, config.joints)
    rotations = find_pose(config.pose, body)
    with clock("extract"):
        extraction = trace_whole(avatar.sdf, avatar.bounds, ExtractConfig(resolution=config.resolution))
    with clock("clean"):
        cleaning = tidy(extraction.surface)
    surface = cleaning.surface
    if config.faces is not None:
        with clock("simplify"):
            surface = reduce(surface, avatar.sdf, config.faces)
    with clock("skin"):
        attachment = attach(surface, body)
        skin = skin_attached(attachment, body, SkinConfig())
    atlas = None
    with ThreadPoolExecutor(1) as beside:
        charts = None
        if "atlas" in clock.plan.stages:
            parts = parts_of_faces(surface, skin, hand_of_joint(body.joint_names))
            charts = beside.submit(unwrap, surface, parts, atlas_config(body, config))
        if config.faces is not None:
            with clock("fit"):
                surface = settle(surface, avatar.sdf)
        with clock("measure"):
            error = surface_error(surface, avatar.sdf)
            missed = None if config.faces is None else missed_error(surface, cleaning.surface)
        with clock("rest"):
            rest = to_rest(surface, skin, attachment, body, avatar.betas, rotations, config.on_ground)
        if charts is not None:
            with clock("atlas"):
                atlas = charts.result()
    return Shape(
        extraction=extraction,
        cleaning=cleaning,
        body=body,
        surface=surface,
        attachment=attachment,
        skin=skin,
        error=error,
        missed=missed,
        rest=rest,
        atlas=atlas,
    )


def plain_asset(avatar: AvatarFields, shape: Shape, report: Report) -> PlainAsset:
    """The mesh, split at the atlas's seams where there is one."""
    welded = np.arange(len(shape.surface.vertices)) if shape.atlas is None else shape.atlas.vertex_map
    return PlainAsset(
        vertices=shape.rest.vertices[welded].astype(np.float32),
        normals=shape.rest.normals[welded].astype(np.float32),
        faces=shape.surface.faces if shape.atlas is None else shape.atlas.faces,
        info=asset_info(avatar),
        welded=welded,
        canonical=shape.surface.vertices[welded].astype(np.float32),
        report=report,
    )


def rig(
    textured: TexturedAsset, shape: Shape, atlas: Atlas, avatar: AvatarFields, config: BuildConfig
) -> Asset:
    """A textured mesh with its skeleton and weights."""
    body = shape.body
    asset = Asset(
        **vars(textured),
        joints=shape.skin.joints[atlas.vertex_map],
        weights=shape.skin.weights[atlas.vertex_map],
        skeleton=Skeleton(
            joint_names=body.joint_names,
            parents=body.parents,
            T_world_joint=shape.rest.T_world_joint,
            turns=shape.rest.turns,
        ),
        morphs=make_morphs(avatar, shape, atlas, config) if config.morphs else (),
    )
    asset = drop_idle_joints(asset) if config.joints == "moving" else asset
    asset = add_ends(asset) if config.ends else asset
    return aim_bones(asset) if config.bones == "along" else asset


def make_morphs(avatar: AvatarFields, shape: Shape, atlas: Atlas, config: BuildConfig) -> tuple[Morph, ...]:
    """The body's shape directions as sliders of the split mesh."""
    sliders = beta_sliders(
        shape.surface,
        shape.skin,
        shape.attachment,
        shape.body,
        avatar.betas,
        find_pose(config.pose, shape.body),
    )
    return tuple(
        Morph(
            name=slider.name,
            vertices=slider.vertices[atlas.vertex_map].astype(np.float32),
            joints=slider.joints,
        )
        for slider in sliders
    )


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


def make_report(shape: Shape, texture: Texture | None, config: BuildConfig, clock: Clock) -> Report:
    """What the stages took, and what was left out: as planned, and as it turned out."""
    left_out = list(clock.plan.left_out)
    if config.faces is not None and len(shape.surface.faces) < 0.98 * config.faces:
        only = f"the surface has only {len(shape.surface.faces)} faces at this resolution"
        left_out.append(LeftOut(what="simplification", why=only))
    if shape.cleaning.dropped_components:
        count = shape.cleaning.dropped_components
        left_out.append(LeftOut(what=f"{count} hidden or loose pieces", why="one closed surface is kept"))
    if shape.atlas is not None and shape.atlas.plain:
        why = f"faces are packed one by one, because {shape.atlas.plain}"
        left_out.append(LeftOut(what="charts", why=why))
    return Report(
        seconds=tuple(clock.seconds.items()),
        error=shape.error,
        missed=shape.missed,
        welded_vertices=len(shape.surface.vertices),
        queries=shape.extraction.queries,
        dropped_components=shape.cleaning.dropped_components,
        texture_coverage=0.0 if texture is None else texture.coverage,
        left_out=tuple(left_out),
    )
