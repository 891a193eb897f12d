"""What `avatar-export --report` writes: sizes, seconds and errors of one avatar, for scripts to read."""

from argparse import Namespace
from dataclasses import dataclass
from pathlib import Path

from assets import BuildConfig, PlainAsset
from assets.asset.asset import Report
from assets.asset.levels import level_error
from avatargen.avatar import Avatar
from avatargen.commands.export.fitting import Fit, savings, wish_of
from avatargen.commands.export.motions import motion_facts
from avatargen.motion.motion import Motion


@dataclass(frozen=True, kw_only=True)
class Made:
    """One avatar, ready to be encoded."""

    asset: PlainAsset
    report: Report
    settings: BuildConfig
    motions: tuple[Motion, ...]
    avatar: Avatar
    fit: Fit | None  # where settings were chosen


def make_report(
    given: Namespace,
    written: list[Path],
    made: Made,
    size: int,
    seconds: dict[str, float],
) -> dict[str, object]:
    """What was made, how long it took and how far the mesh is from the field, for scripts to read."""
    asset, config = made.asset, made.settings
    report, pose = made.report, config.pose
    return {
        "seed": given.seed,
        "path": str(written[0]),
        "files": [str(file) for file in written],
        "version": asset.info.version,
        "weights_hash": asset.info.weights_hash,
        "licence": asset.info.licence,
        "vertices": len(asset.vertices),
        "faces": len(asset.faces),
        "levels": level_facts(made),
        "bytes": size,
        "seconds": {stage: round(value, 3) for stage, value in seconds.items()},
        "error_mm": report.error.facts(),
        "missed_mm": report.missed.facts() if report.missed else None,
        "left_out": savings(report.left_out, config, made.avatar),
        "fit": made.fit.facts(wish_of(given), seconds["total"]) if made.fit else None,
        "animations": [motion_facts(motion) for motion in made.motions],
        "settings": {
            "scene": given.scene,
            "resolution": config.resolution,
            "faces": config.faces,
            "texture": config.texture,
            "normal_map": config.normal_map,
            "ambient_occlusion": config.ambient_occlusion,
            "content": config.content,
            "texture_format": given.texture_format,
            "compress": given.compress,
            "pose": pose if isinstance(pose, str) else str(given.pose),
            "body": str(given.body) if given.body else "default",
            "weights": str(given.weights) if given.weights else "default",
            "device": given.device,
        },
    }


def level_facts(made: Made) -> list[dict[str, object]]:
    """Faces of each coarser level, and how far it is from the field."""
    asset, facts = made.asset, []
    for level in asset.levels:
        error = level_error(asset, level, made.avatar.sdf)
        facts.append({"faces": len(level), "error_mm": error.facts()})
    return facts
