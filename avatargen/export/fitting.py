"""A tolerance or a budget: build with settings that measured curves choose, and say how it went."""

from dataclasses import dataclass

from assets.asset.asset import PlainAsset
from assets.build_config import AvatarFields, BuildConfig
from assets.choose import Choice, candidates, curves_for
from assets.pipeline import Progress, build_content
from avatargen.export.request import ExportRequest


@dataclass(frozen=True, kw_only=True)
class Fit:
    """The asset that settings from the curves gave, and what was expected of them."""

    asset: PlainAsset
    settings: BuildConfig
    tries: int
    choice: Choice  # the one that was kept
    predicted_seconds: float  # of the process, when the first try began

    def facts(self, request: ExportRequest, seconds: float) -> dict[str, object]:
        """Asked for, predicted and achieved, for the report."""
        assert self.asset.report is not None  # only assets that were not built have none
        return {
            "asked": {"tolerance_mm": request.tolerance_mm, "budget_s": request.budget_s},
            "tries": self.tries,
            "predicted": {"p99_mm": self.choice.p99_mm, "seconds": round(self.predicted_seconds, 3)},
            "achieved": {"p99_mm": self.asset.report.error.p99_mm, "seconds": round(seconds, 3)},
        }


def build_fitted(
    avatar: AvatarFields, config: BuildConfig, request: ExportRequest, elapsed: float, progress: Progress
) -> Fit:
    """Build with settings from the curves; where a tolerance is missed, again with finer ones.

    `elapsed` seconds of the budget are spent. Raises the errors of `build_content`, and InputError where the
    budget has no room for anything.
    """
    tolerance, budget = request.tolerance_mm, request.budget_s
    found, predicted = None, 0.0
    tries = candidates(
        config,
        curves_for(avatar),
        tolerance_mm=tolerance,
        budget_s=None if budget is None else budget - elapsed,
    )
    for count, (settings, choice) in enumerate(tries, 1):
        predicted = predicted or elapsed + choice.seconds
        asset = build_content(avatar, settings, progress)
        found = Fit(asset=asset, settings=settings, tries=count, choice=choice, predicted_seconds=predicted)
        assert asset.report is not None  # only assets that were not built have none
        if tolerance is None or asset.report.error.p99_mm <= tolerance:
            break
    assert found is not None  # there always is a first candidate
    return found
