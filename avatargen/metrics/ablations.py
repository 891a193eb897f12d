"""Table 2 of the paper as runs: every choice trained for the same pictures, and measured alike."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from avatargen.body.model import Body
from avatargen.data.dataset import Pictures
from avatargen.generator.picture import CanonicalSurface
from avatargen.metrics.evaluate import EvalConfig, Report, evaluate
from avatargen.metrics.features import random_features
from avatargen.training.adversarial import train
from avatargen.training.adversarial_config import AdversarialConfig
from avatargen.training.avatar_model import AvatarModel, avatar_model

if TYPE_CHECKING:
    from accelerate import Accelerator


@dataclass(frozen=True, kw_only=True)
class Row:
    """One choice: which it is, and what came of it."""

    name: str
    report: Report


def choices(base: AdversarialConfig) -> dict[str, AdversarialConfig]:
    """The rows of the table; the first is what the paper settles on."""

    def geometry(**change: str) -> AdversarialConfig:
        return replace(base, geometry=replace(base.geometry, **change))

    def render(**change: int) -> AdversarialConfig:
        return replace(base, render=replace(base.render, **change))

    return {
        "as the paper": base,
        "density": geometry(representation="density"),
        "residual deformation only": geometry(deformation="residual"),
        "inverse skinning only": geometry(deformation="inverse_skinning"),
        **{f"K = {nearest}": render(nearest=nearest) for nearest in (2, 3, 4)},
        **{f"{samples} ray steps": render(samples=samples) for samples in (12, 24, 36, 48)},
        "observed body prior": geometry(prior="observed"),
        "no body prior": geometry(prior="none", distance="raw"),
        "raw distance": geometry(distance="raw"),
        "without SMPL loss": replace(base, losses=replace(base.losses, smpl=0.0)),
    }


def run_ablations(
    base: AdversarialConfig,
    data: Pictures,
    held_out: Pictures,
    body: Body,
    out: Path,
    accelerator: "Accelerator",
    report: Callable[[str], None],
) -> list[Row]:
    """Train every choice in a folder of its own under `out` (which resumes), and measure it."""
    surface, rows = CanonicalSurface(body), []
    for name, config in choices(base).items():
        report(name)
        folder = out / name.replace(" ", "_").replace("=", "")
        average = train(
            config, avatar_model(config, body), data, body, folder, accelerator, lambda line: None
        )
        assert isinstance(average, AvatarModel)
        features = ("frechet distance", random_features)
        few = EvalConfig(pictures=40, samples=None)
        measured = evaluate(average.networks, surface, held_out, data, features, few)
        rows.append(Row(name=name, report=measured))
    return rows


def table(rows: list[Row]) -> str:
    """Markdown: a line a choice; a dash where no picture allowed to measure."""
    metrics = list(dict.fromkeys(name for row in rows for name in row.report.numbers))
    lines = ["| choice | " + " | ".join(metrics) + " |", "|---" * (len(metrics) + 1) + "|"]
    for row in rows:
        cells = [f"{n.value:.3g}" if (n := row.report.numbers.get(name)) else "-" for name in metrics]
        lines.append(f"| {row.name} | " + " | ".join(cells) + " |")
    return "\n".join(lines)
