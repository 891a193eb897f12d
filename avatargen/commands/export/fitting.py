"""--tolerance and --budget: choose resolution and faces from measured curves, build, and say how it went;
what leaving things out saved, by the same curves.
"""

from argparse import Namespace
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from assets.asset.asset import PlainAsset
from assets.build_config import BuildConfig
from assets.clock import Progress
from assets.pipeline import build_content
from assets.plan import LeftOut
from avatargen.avatar import Avatar, shipped
from avatargen.commands.export.choose import Choice, Curves, load_curves, within_budget, within_tolerance

TRIES = 3  # of ever finer settings, until a tolerance is kept


@dataclass(frozen=True, kw_only=True)
class Wish:
    """What was asked for: a tolerance (mm, of 99 % of the surface) or a budget (seconds of the process)."""

    tolerance_mm: float | None
    budget_s: float | None

    def __bool__(self) -> bool:
        return self.tolerance_mm is not None or self.budget_s is not None


@dataclass(frozen=True, kw_only=True)
class Fit:
    """The asset that settings from the curves gave, and what was expected of them."""

    asset: PlainAsset
    settings: BuildConfig
    tries: int
    choice: Choice  # the one that was kept
    predicted_seconds: float  # of the process, when the first try began

    def facts(self, wish: Wish, seconds: float) -> dict[str, object]:
        """Asked for, predicted and achieved, for the report."""
        assert self.asset.report is not None  # only assets that were not built have none
        return {
            "asked": {"tolerance_mm": wish.tolerance_mm, "budget_s": wish.budget_s},
            "tries": self.tries,
            "predicted": {"p99_mm": self.choice.p99_mm, "seconds": round(self.predicted_seconds, 3)},
            "achieved": {"p99_mm": self.asset.report.error.p99_mm, "seconds": round(seconds, 3)},
        }


def wish_of(given: Namespace) -> Wish:
    return Wish(tolerance_mm=given.tolerance, budget_s=given.budget)


def curves_for(avatar: Avatar | None) -> Curves:
    """The curves that come with the package, scaled to this machine where there is an avatar to time."""
    return load_curves(shipped("curves.json"), avatar)


def build_fitted(avatar: Avatar, config: BuildConfig, wish: Wish, elapsed: float, progress: Progress) -> Fit:
    """Build with settings from the curves; where a tolerance is missed, again with finer ones.

    `elapsed` seconds of the process are spent. Raises the errors of `build_content`, and InputError where the
    budget has no room for anything.
    """
    found, predicted = None, 0.0
    for tries, (settings, choice) in enumerate(candidates(wish, config, curves_for(avatar), elapsed), 1):
        predicted = predicted or elapsed + choice.seconds
        asset = build_content(avatar, settings, progress)
        found = Fit(asset=asset, settings=settings, tries=tries, choice=choice, predicted_seconds=predicted)
        assert asset.report is not None  # only assets that were not built have none
        if wish.tolerance_mm is None or asset.report.error.p99_mm <= wish.tolerance_mm:
            break
    assert found is not None  # there always is a first candidate
    return found


def candidates(
    wish: Wish, config: BuildConfig, curves: Curves, elapsed: float
) -> Iterator[tuple[BuildConfig, Choice]]:
    """Settings to try in turn, each with what is expected of it.

    Raises:
        InputError: the budget has no room for anything.
    """
    texture = None if config.content == "mesh" else config.texture
    choices = curves.choices(texture, config.normal_map, config.ambient_occlusion)
    if wish.budget_s is not None:
        choices = [within_budget(choices, wish.budget_s - elapsed)]
    elif wish.tolerance_mm is not None:
        choices = within_tolerance(choices, wish.tolerance_mm)[:TRIES]
    for choice in choices:
        yield replace(config, resolution=choice.resolution, faces=choice.faces), choice


def savings(left_out: Sequence[LeftOut], config: BuildConfig, avatar: Avatar) -> list[dict[str, object]]:
    """What was left out, for the report."""
    curves = curves_for(avatar)
    return [saving(item, config, curves) for item in left_out]


def saving(item: LeftOut, config: BuildConfig, curves: Curves) -> dict[str, object]:
    """What leaving a part out saved, by the curves; nothing is said where nothing was measured."""
    said: dict[str, object] = {"what": item.what, "why": item.why}
    stages = [*item.stages, "encode"] if "bake" in item.stages else item.stages
    if stages:
        faces = config.faces or curves.most_faces
        seconds = (curves.stage_seconds(stage, config.resolution, faces, config.texture) for stage in stages)
        said["seconds_saved"] = round(sum(seconds), 3)
    if "bake" in item.stages:
        said["bytes_saved"] = curves.texture_bytes(config.texture)
    return said


def describe(config: BuildConfig, wish: Wish, name: str) -> str:
    """The plan in words, for --dry-run; seconds are those of the machine that the bench ran on."""
    curves = curves_for(None)
    lines = [f"{name}: {config.content}"]
    if wish:
        config, choice = next(candidates(wish, config, curves, 0.0))
        lines.append(f"chosen: about {choice.seconds:.1f} s, {choice.p99_mm:.2f} mm p99")
    faces = "all" if config.faces is None else f"{config.faces:,}"
    texture = "none" if config.content == "mesh" else str(config.texture)
    lines.append(
        f"resolution {config.resolution}, faces {faces}, texture {texture}, "
        f"normal map {config.normal_map or 'none'}, "
        f"ambient occlusion {config.ambient_occlusion or 'none'}, joints {config.joints}"
    )
    plan = config.plan()
    lines.append("stages: " + ", ".join(plan.stages))
    for item in plan.left_out:
        said = saving(item, config, curves)
        saved = f" (saves about {said['seconds_saved']} s)" if "seconds_saved" in said else ""
        lines.append(f"left out: {item.what}: {item.why}{saved}")
    return "\n".join(lines)
