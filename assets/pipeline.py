"""From an avatar's fields to an asset, in stages that are timed.

    shape (extract ... atlas, see `assets.shape`) -> bake -> normals, occlusion on request -> rig

Which of them run is planned first (`assets.plan`): a mesh alone has no atlas and no colours.
"""

import numpy as np

from assets.asset.asset import Asset, AssetInfo, PlainAsset, Report, TexturedAsset
from assets.asset.bones import add_ends, aim_bones
from assets.asset.joints import drop_idle_joints
from assets.asset.rig import Morph, Skeleton
from assets.build_config import AvatarFields, BuildConfig
from assets.clock import Clock, Progress
from assets.plan import LeftOut
from assets.shape import Shape, find_pose, make_shape
from assets.skin.morph import beta_sliders
from assets.texture.atlas import Atlas
from assets.texture.bake import BakeConfig, Texture, bake_texture
from assets.texture.normal_map import bake_normals
from assets.texture.occlusion import bake_occlusion, distance_to
from avatargen.errors import InputError


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
            rest_rotations=shape.rest.rest_rotations,
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


def asset_info(avatar: AvatarFields) -> AssetInfo:
    """Where the asset comes from."""
    info = avatar.info
    return AssetInfo(
        seed=info.seed,
        weights_hash=info.weights_hash,
        version=info.version,
        licence=info.licence,
        betas=tuple(float(beta) for beta in avatar.betas),
        height_m=info.height_m,
        facts=info.facts,
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
