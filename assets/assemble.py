"""What the stages have made, put together: the asset and its report."""

import numpy as np

from assets.asset.asset import Asset, AssetInfo, PlainAsset, Report, TexturedAsset
from assets.asset.bones import add_ends, aim_bones
from assets.asset.joints import drop_idle_joints
from assets.asset.rig import Morph, Skeleton
from assets.asset.sway import add_springs
from assets.asset.twist import add_twists
from assets.build_config import AvatarFields, BuildConfig
from assets.content import LeftOut
from assets.draft import Draft
from assets.mesh.surface import euler_number
from assets.skin.morph import beta_sliders


def assemble(draft: Draft, report: Report) -> PlainAsset:
    """A `PlainAsset`, `TexturedAsset` or `Asset`, by the content that is wanted."""
    plain = plain_asset(draft, report)
    if draft.texture is None:
        return plain
    textured = TexturedAsset(
        **vars(plain),
        uv=draft.charted.uv,
        texture=draft.texture.texels,
        normal_map=draft.normal_map,
        occlusion=draft.occlusion,
    )
    return textured if draft.config.content == "textured" else rig(textured, draft)


def plain_asset(draft: Draft, report: Report) -> PlainAsset:
    """The mesh, split at the atlas's seams where there is one."""
    surface, atlas = draft.surface, draft.atlas
    welded = np.arange(len(surface.vertices)) if atlas is None else atlas.vertex_map
    return PlainAsset(
        vertices=draft.rest.vertices[welded].astype(np.float32),
        normals=draft.rest.normals[welded].astype(np.float32),
        faces=surface.faces if atlas is None else atlas.faces,
        info=asset_info(draft.avatar),
        welded=welded,
        canonical=surface.vertices[welded].astype(np.float32),
        report=report,
    )


def rig(textured: TexturedAsset, draft: Draft) -> Asset:
    """A textured mesh with its skeleton and weights."""
    body, config, welded = draft.body, draft.config, draft.charted.vertex_map
    asset = Asset(
        **vars(textured),
        joints=draft.moved.joints[welded],
        weights=draft.moved.weights[welded],
        skeleton=Skeleton(
            joint_names=body.joint_names,
            parents=body.parents,
            T_world_joint=draft.rest.T_world_joint,
            rest_rotations=draft.rest.rest_rotations,
        ),
        morphs=make_morphs(draft) if config.morphs else (),
    )
    if config.face != "none":
        from assets.face.face import with_face  # most assets are made without

        asset = with_face(asset, body)
    asset = finish_skeleton(asset, config)
    if not config.springs:
        return asset
    return add_springs(asset, body, draft.avatar.betas, getattr(draft.avatar, "layers", {}))


def finish_skeleton(asset: Asset, config: BuildConfig) -> Asset:
    """The skeleton with the joints and the frames that are wanted."""
    asset = drop_idle_joints(asset) if config.joints == "moving" else asset
    asset = add_ends(asset) if config.ends else asset
    asset = asset if config.bones == "world" else aim_bones(asset, config.bones)
    return add_twists(asset) if config.twist else asset


def make_morphs(draft: Draft) -> tuple[Morph, ...]:
    """The body's shape directions as sliders of the split mesh."""
    betas, rotations = draft.avatar.betas, draft.rotations
    sliders = beta_sliders(
        draft.surface, draft.skin, draft.attachment, draft.body, betas, rotations, draft.moved
    )
    return tuple(
        Morph(
            name=slider.name,
            vertices=slider.vertices[draft.charted.vertex_map].astype(np.float32),
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


def make_report(draft: Draft, planned: tuple[LeftOut, ...], seconds: dict[str, float]) -> Report:
    """What the stages took, and what was left out: as planned, and as it turned out."""
    left_out, faces = list(planned), draft.config.faces
    if faces is not None and len(draft.surface.faces) < 0.98 * faces:
        only = f"the surface has only {len(draft.surface.faces)} faces at this resolution"
        left_out.append(LeftOut(what="simplification", why=only))
    before, after = euler_number(draft.cleaning.surface), euler_number(draft.surface)
    if before != after:
        kept = f"{draft.config.simplifier} left {1 - after // 2} handles of {1 - before // 2}"
        left_out.append(LeftOut(what="handles where layers touch", why=kept))
    dropped = draft.cleaning.dropped_components
    if dropped:
        left_out.append(LeftOut(what=f"{dropped} hidden or loose pieces", why="one closed surface is kept"))
    if draft.atlas is not None and draft.atlas.plain:
        why = f"faces are packed one by one, because {draft.atlas.plain}"
        left_out.append(LeftOut(what="charts", why=why))
    if draft.atlas is not None and draft.atlas.unguided:
        why = f"xatlas has cut charts of its own, because {draft.atlas.unguided}"
        left_out.append(LeftOut(what="seams of clothes in the texture", why=why))
    return Report(
        seconds=tuple(seconds.items()),
        error=draft.error,
        missed=draft.missed,
        welded_vertices=len(draft.surface.vertices),
        queries=draft.extraction.queries,
        dropped_components=dropped,
        texture_coverage=0.0 if draft.texture is None else draft.texture.coverage,
        left_out=tuple(left_out),
    )
