"""A person as several meshes on one skeleton: every layer goes through the pipeline by itself, and what comes
out is joined.

    layers -> faces shared out by what each needs -> the pipeline up to surfaces, layer by layer
           -> the rest of it from the outermost inward: what is hidden moves with what hides it
           -> join -> on the ground

Under clothes the body is left out, from a hand's breadth within their edges, and closed there; or kept, as it
is, inside them. Each mesh is closed, manifold and outward: one piece, or a few of what comes in pairs.

Letters: V vertices of the body, W of an asset.
"""

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float, Float64
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra
from threadpoolctl import threadpool_limits

from assets.assemble import assemble, finish_skeleton, make_report
from assets.asset.asset import Asset, Report
from assets.asset.drop import faces_left, without_hidden
from assets.asset.parts import join
from assets.asset.sway import add_springs
from assets.build_config import AvatarFields, BuildConfig
from assets.content import LeftOut
from assets.draft import Draft, open_draft
from assets.isosurface.extract import ExtractConfig, trace_whole
from assets.mesh.measure import SurfaceError
from assets.mesh.surface import Surface, directed_edges, edge_lengths, face_areas
from assets.pipeline import Progress, plan_for, run
from assets.plan import Plan
from assets.skin.attach import Carrier
from assets.skin.follow import Above, follow
from assets.skin.skin import Skin
from avatargen.body.model import CanonicalBody
from avatargen.errors import InputError

Hidden = Literal["drop", "keep"]
BODY = "body"
PIECE = 0.25  # of the largest piece's volume from which another one stays, such as the other shoe
LOOK = 128  # cells along the bounds' longest side, to see how large a layer is
DETAIL = {BODY: 4.0, "hair": 1.5, "shoes": 1.5}  # faces for an area, by those that cloth needs
CROWDED = 1.6  # faces for an area of what is seen of a body, by those of all of it
FEWEST = 100  # faces of a part
UNDER = 0.03  # m along the skin from what is seen of it up to which a body is kept


@runtime_checkable
class Layer(AvatarFields, Protocol):
    """What is needed of a layer."""

    def cover(self, points: np.ndarray) -> np.ndarray: ...


@runtime_checkable
class LayeredFields(AvatarFields, Protocol):
    """What is needed of a person who is built layer by layer."""

    @property
    def layers(self) -> Mapping[str, Layer]: ...

    @property
    def hidden(self) -> np.ndarray: ...


@threadpool_limits.wrap(limits=1, user_api="blas")
def build_parts(
    avatar: LayeredFields,
    config: BuildConfig | None = None,
    hidden: Hidden = "drop",
    progress: Progress | None = None,
) -> Asset:
    """The person as one asset of several parts, the body first. The parts' faces add up to `config.faces`;
    the body's texture has `config.texture` texels along a side, the others' half of that.

    Raises:
        InputError: settings that ask for less than a rigged asset or for too few faces, or a person who is
            one field.
        GeometryError: a layer has no closed surface, or it cannot be kept whole.
        FieldError: a field is NaN or infinite.
    """
    config = config or BuildConfig()
    if config.content != "rigged" or config.faces is None:
        raise InputError("parts: they are rigged and have a number of faces; leave the content as it is")
    if config.face != "none":
        raise InputError(
            "parts: lips and lids are cut in one mesh; leave the face as it is, or make one mesh"
        )
    layers = dict(avatar.layers)
    if config.faces < FEWEST * len(layers):
        raise InputError(
            f"parts: found {config.faces} faces for {len(layers)} parts; give {FEWEST * len(layers)} at least"
        )
    unseen = deep(avatar.body, avatar.hidden) if hidden == "drop" else np.zeros(len(avatar.hidden), bool)
    with ExitStack() as stack:
        drafts = draw_surfaces(avatar, layers, config, unseen, stack, progress)
        made = finish(avatar, layers, drafts, unseen)
    report = combined([each.report for each in made.values() if each.report], made)
    if unseen.any():
        dropped = LeftOut(what="the body under clothes", why="nobody sees it; its rims are closed")
        report = replace(report, left_out=(*report.left_out, dropped))
    asset = join(made, report)
    asset = finish_skeleton(on_ground(asset) if config.on_ground else asset, config)
    return add_springs(asset, avatar.body, avatar.betas, {}) if config.springs else asset


def of_part(config: BuildConfig, faces: int, *, first: bool) -> BuildConfig:
    """The settings of one part. What concerns all of them, the ground and the skeleton, comes later."""
    sizes = {name: getattr(config, name) for name in ("texture", "normal_map", "ambient_occlusion")}
    halves = {name: None if size is None else max(size // 2, 16) for name, size in sizes.items()}
    return replace(
        config,
        faces=faces,
        joints="24" if config.joints == "24" else "all",
        bones="world",
        ends=False,
        twist=False,
        springs=False,
        on_ground=False,
        **{name: size and size * (2 if first else 1) for name, size in halves.items()},
    )


@dataclass(frozen=True, kw_only=True)
class Half:
    """A part that has its surface, and what is still to be done."""

    draft: Draft
    planned: Plan
    seconds: dict[str, float]


def draw_surfaces(
    avatar: LayeredFields,
    layers: Mapping[str, Layer],
    config: BuildConfig,
    unseen: Bool[np.ndarray, " V"],
    stack: ExitStack,
    progress: Progress | None,
) -> dict[str, Half]:
    """Every part's surface. Each gets its share of the faces that are left, the body first."""
    sizes, found = areas(layers, unseen), {}
    shares = {name: sizes[name] * DETAIL.get(name, 1.0) for name in layers}
    left = config.faces or 0
    for number, (name, layer) in enumerate(layers.items()):
        if progress is not None:
            progress(name, 0.6 * number / len(layers))
        later = sum(shares[each] for each in layers if each not in found)
        wanted = max(round(left * shares[name] / later), FEWEST)
        seen = 1.0
        if name == BODY and unseen.any():
            seen = min(1.0, CROWDED * sizes[BODY] / whole_area(avatar.body))
        settings = of_part(config, round(wanted / seen), first=not found)
        planned = plan_for(settings)
        cut = planned.names.index("skin")
        draft = stack.enter_context(open_draft(layer, settings, charts=True, least_piece=PIECE))
        seconds = run(replace(planned, stages=planned.stages[:cut]), draft)
        rest = replace(planned, stages=planned.stages[cut:])
        found[name] = Half(draft=draft, planned=rest, seconds=seconds)
        faces = draft.surface.faces
        if name == BODY and unseen.any():
            left -= faces_left(faces, over_vertices(draft.surface.vertices, avatar.body, unseen))
        else:
            left -= len(faces)
    return found


def finish(
    avatar: LayeredFields,
    layers: Mapping[str, Layer],
    halves: Mapping[str, Half],
    unseen: Bool[np.ndarray, " V"],
) -> dict[str, Asset]:
    """Every part as an asset. Outer ones come first, as what lies beneath moves with them."""
    made: dict[str, Asset] = {}
    names = list(halves)
    for number, name in reversed(list(enumerate(names))):
        half, outer = halves[name], names[:number:-1]
        half.draft.follow = partial(beneath, [(layers[each], halves[each].draft) for each in outer])
        seconds = half.seconds | run(half.planned, half.draft)
        asset = assemble(half.draft, make_report(half.draft, half.planned.left_out, seconds))
        assert isinstance(asset, Asset), "rigged content"
        if name == BODY and unseen.any():
            assert asset.canonical is not None, "built from a field"
            asset = without_hidden(asset, over_vertices(asset.canonical, avatar.body, unseen))
        made[name] = asset
    return {name: made[name] for name in halves}


def beneath(
    outer: Sequence[tuple[Layer, Draft]], surface: Surface, skin: Skin, attachment: Carrier, moved: bool
) -> tuple[Skin, Carrier]:
    """A surface's weights, with `moved` those from the T-pose on, and attachment where others, the outermost
    first, hide some of it."""
    above = [
        Above(
            surface=draft.surface,
            skin=draft.moved if moved else draft.skin,
            attachment=draft.attachment,
            share=share,
        )
        for layer, draft in outer
        if (share := layer.cover(surface.vertices)).any()
    ]
    joint_count = len(outer[0][1].body.parents) if outer else 0
    return follow(surface, skin, attachment, above, joint_count) if above else (skin, attachment)


def areas(layers: Mapping[str, Layer], unseen: Bool[np.ndarray, " V"]) -> dict[str, float]:
    """Square metres of each layer, of the body what is seen; looked at coarsely."""
    look, found = ExtractConfig(resolution=LOOK, seeds=LOOK), {}
    for name, layer in layers.items():
        if name == BODY:
            found[name] = area_seen(layer.body, unseen)
        else:
            found[name] = float(face_areas(trace_whole(layer.sdf, layer.bounds, look).surface).sum())
    return found


def whole_area(body: CanonicalBody) -> float:
    """Square metres."""
    return area_seen(body, np.zeros(len(body.vertices), bool))


def area_seen(body: CanonicalBody, unseen: Bool[np.ndarray, " V"]) -> float:
    """Square metres of the body's faces with a corner that is seen."""
    areas = face_areas(surface_of(body))
    return float(areas[~unseen[body.faces].all(axis=1)].sum())


def surface_of(body: CanonicalBody) -> Surface:
    return Surface(vertices=body.vertices.astype(np.float64), faces=body.faces)


def deep(body: CanonicalBody, hidden: Bool[np.ndarray, " V"]) -> Bool[np.ndarray, " V"]:
    """The hidden vertices that lie farther than `UNDER` along the skin from any that is not."""
    if hidden.all() or not hidden.any():
        return hidden.copy()
    edges = directed_edges(body.faces)
    lengths = np.maximum(edge_lengths(surface_of(body), edges), 1e-9)
    graph = csr_array((lengths, (edges[:, 0], edges[:, 1])), shape=(len(hidden),) * 2)
    way = dijkstra(graph, directed=False, indices=np.flatnonzero(~hidden), min_only=True)
    return hidden & (way > UNDER)


def over_vertices(
    canonical: Float[np.ndarray, "W 3"], body: CanonicalBody, unseen: Bool[np.ndarray, " V"]
) -> Bool[np.ndarray, " W"]:
    """The points whose closest face of the body is unseen."""
    hit = body.distance.query(canonical)
    return np.asarray(unseen[body.faces[hit.face]].all(axis=1))


def on_ground(asset: Asset) -> Asset:
    """The asset, its lowest vertex at y = 0."""
    lift = np.array([0.0, -float(asset.vertices[:, 1].min()), 0.0])
    T_world_joint = asset.skeleton.T_world_joint.copy()
    T_world_joint[:, :3, 3] += lift
    return replace(
        asset,
        vertices=(asset.vertices + lift).astype(np.float32),
        skeleton=replace(asset.skeleton, T_world_joint=T_world_joint),
    )


def combined(reports: list[Report], made: Mapping[str, Asset]) -> Report:
    """One report of all parts: times and counts add up; of errors the mean is over the faces, the rest that
    of the worst part."""
    faces = np.array([len(asset.faces) for asset in made.values()], dtype=np.float64)
    missed = [report.missed for report in reports if report.missed is not None]
    stages = [stage for stage, _ in reports[0].seconds]
    return Report(
        seconds=tuple((stage, sum(dict(report.seconds)[stage] for report in reports)) for stage in stages),
        error=worst([report.error for report in reports], faces),
        missed=worst(missed, faces) if len(missed) == len(reports) else None,
        welded_vertices=sum(report.welded_vertices for report in reports),
        queries=sum(report.queries for report in reports),
        dropped_components=sum(report.dropped_components for report in reports),
        texture_coverage=float(np.mean([report.texture_coverage for report in reports])),
        left_out=tuple(dict.fromkeys(each for report in reports for each in report.left_out)),
    )


def worst(errors: list[SurfaceError], faces: Float64[np.ndarray, " P"]) -> SurfaceError:
    """The mean of the means by faces, and the largest of the others."""
    return SurfaceError(
        mean_mm=float(np.average([error.mean_mm for error in errors], weights=faces)),
        p99_mm=max(error.p99_mm for error in errors),
        max_mm=max(error.max_mm for error in errors),
    )
