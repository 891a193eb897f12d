"""From an avatar's fields to an asset: the stages below, in order.

`charts` begins to cut them in a process of its own, beside `fit`, `skin`, `measure` and `rest`; `atlas` waits
for it. Which stages a configuration needs is planned first (`assets.plan`): a mesh alone has no atlas and no
colours.
"""

import time
from collections.abc import Callable

from threadpoolctl import threadpool_limits

from assets import plan, stages
from assets.assemble import assemble, make_report
from assets.asset.asset import Asset, PlainAsset
from assets.build_config import AvatarFields, BuildConfig
from assets.draft import Draft, open_draft
from assets.plan import Plan, Stage
from avatargen.errors import InputError

STAGES = (
    Stage("extract", stages.extract, 0.4),
    Stage("clean", stages.clean, 0.08),
    Stage("simplify", stages.simplify, 0.15, plan.unless_simplified),
    Stage("charts", stages.charts, 0.0, plan.unless_charted),
    Stage("fit", stages.fit, 0.04, plan.unless_laid),
    Stage("skin", stages.skin, 0.02),
    Stage("measure", stages.measure, 0.1),
    Stage("rest", stages.rest, 0.02),
    Stage("atlas", stages.atlas, 0.05, plan.unless_charted),
    Stage("bake", stages.bake, 0.15, plan.unless_coloured),
    Stage("normals", stages.normals, 0.5, plan.unless_normal_map),
    Stage("occlusion", stages.occlusion, 0.5, plan.unless_occlusion),
)

Progress = Callable[[str, float], None]  # name of the stage that begins, share of the work behind it


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


# numpy's products are small here: more threads than one gain nothing, and once woken they spin on the cores
# that the field and xatlas could use, a quarter of all processor time
@threadpool_limits.wrap(limits=1, user_api="blas")
def build_content(avatar: AvatarFields, config: BuildConfig, progress: Progress | None = None) -> PlainAsset:
    """The avatar as what `config.content` asks for: a `PlainAsset`, `TexturedAsset` or `Asset`.

    Raises the errors of `build`, but for settings that ask for less.
    """
    planned = plan_for(config)
    with open_draft(avatar, config, charts="charts" in planned.names) as draft:
        seconds = run(planned, draft, progress)
        return assemble(draft, make_report(draft, planned.left_out, seconds))


def plan_for(config: BuildConfig) -> Plan:
    """The stages that the configuration needs, and what is left out."""
    return plan.make_plan(STAGES, config)


def run(planned: Plan, draft: Draft, progress: Progress | None = None) -> dict[str, float]:
    """Every planned stage, in order; seconds by stage."""
    seconds: dict[str, float] = {}
    for done, stage in enumerate(planned.stages):
        if progress is not None:
            progress(stage.name, planned.share(done))
        started = time.perf_counter()
        stage.run(draft)
        seconds[stage.name] = time.perf_counter() - started
    return seconds
