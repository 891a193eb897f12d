"""From an avatar's field to the mesh of an asset, in canonical and rest pose, with weights and charts.

extract -> clean -> simplify -> skin -> fit, measure, rest
                                  `-> atlas, in its own process
"""

from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial

import numpy as np
from jaxtyping import Float

from assets.asset.joints import body_on
from assets.build_config import AvatarFields, BuildConfig
from assets.clock import Clock
from assets.isosurface.adaptive import trace_adaptively
from assets.isosurface.extract import ExtractConfig, Extraction, trace, trace_whole
from assets.mesh.clean import Cleaning, clean
from assets.mesh.measure import SurfaceError, missed_error, surface_error
from assets.mesh.surface import Surface
from assets.simplify.reduce import reduce, refit
from assets.skin.attach import Attachment, attach
from assets.skin.rest import RestMesh, to_rest
from assets.skin.skin import Skin, SkinConfig, parts_of_faces, skin_attached
from assets.texture.atlas import Atlas, AtlasConfig, ChartProgram, unwrap
from avatargen.body.fingers import hand_of_joint
from avatargen.body.model import CanonicalBody
from avatargen.body.pose import named_pose
from avatargen.errors import InputError

SEEDS = 32  # cells along the bounds' longest side at which the search ends: of all pieces the largest is kept
DETAILED_JOINT = "head"  # whose part of the texture is finer: people look at faces


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


def make_shape(avatar: AvatarFields, config: BuildConfig, clock: Clock) -> Shape:
    """The stages that make the mesh; charts are cut meanwhile."""
    body = body_on(avatar.body, config.joints)
    rotations = find_pose(config.pose, body)
    with ExitStack() as running:
        program = running.enter_context(ChartProgram()) if "atlas" in clock.plan.stages else None
        with clock("extract"):
            extraction = find_surface(avatar, config.resolution, config.faces)
        with clock("clean"):
            cleaning = clean(extraction.surface)
        surface, charts, atlas = cleaning.surface, None, None
        if config.faces is not None:
            with clock("simplify"):
                surface = reduce(surface, avatar.sdf, config.faces)
        if program is not None:
            beside = running.enter_context(ThreadPoolExecutor(1))
            charts = beside.submit(cut_charts, surface, body, config, program)
        if config.faces is not None:
            with clock("fit"):
                surface = refit(surface, avatar.sdf)
        with clock("skin"):
            attachment = attach(surface, body)
            skin = skin_attached(attachment, body, SkinConfig())
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


def find_surface(avatar: AvatarFields, resolution: int, faces: int | None) -> Extraction:
    """The avatar's surface, as coarsely as the faces left allow, or with None at the full resolution."""
    way = trace if faces is None else partial(trace_adaptively, faces=faces)
    return trace_whole(avatar.sdf, avatar.bounds, ExtractConfig(resolution=resolution, seeds=SEEDS), way)


def cut_charts(surface: Surface, body: CanonicalBody, config: BuildConfig, program: ChartProgram) -> Atlas:
    """Charts of a surface whose vertices may still move a little, cut where other joints move it."""
    skin = skin_attached(attach(surface, body), body, SkinConfig())
    parts = parts_of_faces(surface, skin, hand_of_joint(body.joint_names))
    return unwrap(surface, parts, atlas_config(body, config), program)


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
