"""What finding people in photographs comes to, stage by stage: error against seconds, as a picture."""

import io
from collections.abc import Mapping
from typing import Any

from avatargen.metrics.photo_error import SECONDS

Stages = Mapping[str, Mapping[str, Mapping[str, float]]]  # stage, what was measured: mean and interval
PANELS = {  # what each panel shows, by the name of its axis
    "joints, mm": {"joints_mm": "pelvis on pelvis", "joints_aligned_mm": "Procrustes"},
    "clothed surface, mm": {"surface_mm": "pelvis on pelvis", "surface_aligned_mm": "Procrustes"},
    "silhouette, intersection over union": {"silhouette_iou": "seen view"},
    "PSNR, dB": {"psnr_seen_db": "seen view", "psnr_unseen_db": "four others"},
}


def draw(stages: Stages) -> bytes:
    """A PNG of four panels: means over people with their 95 % intervals."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 7), layout="constrained")
    for axes, (title, names) in zip(figure.subplots(2, 2).flat, PANELS.items(), strict=True):
        draw_panel(axes, title, names, stages)
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=100)
    return stream.getvalue()


def draw_panel(axes: Any, title: str, names: Mapping[str, str], stages: Stages) -> None:
    """Some numbers against the seconds until then; the stages are named along the first."""
    seconds = [columns[SECONDS]["value"] for columns in stages.values()]
    for order, (name, word) in enumerate(names.items()):
        told = [columns[name] for columns in stages.values()]
        ends = [(n["value"] - n["low"], n["high"] - n["value"]) for n in told]
        means = [n["value"] for n in told]
        axes.errorbar(seconds, means, list(zip(*ends, strict=True)), fmt="o-", capsize=3, label=word)
        for stage, x, y in zip(stages, seconds, means, strict=True) if order == 0 else ():
            axes.annotate(stage, (x, y), xytext=(4, 6), textcoords="offset points", fontsize=8)
    axes.set(xlabel="processor seconds", title=title)
    axes.margins(x=0.12)
    axes.grid(alpha=0.25)
    if len(names) > 1:
        axes.legend(fontsize=8)
