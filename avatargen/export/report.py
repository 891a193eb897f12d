"""What an export reports: sizes, seconds and errors of one avatar, for scripts to read."""

from dataclasses import dataclass, replace
from pathlib import Path

from assets.asset.asset import Asset, PlainAsset, Report
from assets.asset.levels import level_error
from assets.build_config import AvatarFields, BuildConfig
from avatargen.export.fingerprint import facts
from avatargen.export.fitting import Fit
from avatargen.export.left_out import savings
from avatargen.export.motions import motion_facts
from avatargen.export.people import Found
from avatargen.export.request import ExportRequest
from avatargen.motion.motion import Motion


@dataclass(frozen=True, kw_only=True)
class Made:
    """One avatar, ready to be encoded."""

    asset: PlainAsset
    report: Report
    settings: BuildConfig
    motions: tuple[Motion, ...]
    avatar: AvatarFields
    fit: Fit | None  # where settings were chosen
    found: Found | None = None  # in photographs


def make_report(
    request: ExportRequest,
    written: list[Path],
    made: Made,
    size: int,
    seconds: dict[str, float],
) -> dict[str, object]:
    """What was made, how long it took and how far the mesh is from the field, for scripts to read."""
    asset, config = made.asset, made.settings
    report = made.report
    return {
        "seed": request.seeds,
        "path": str(written[0]),
        "files": [str(file) for file in written],
        "version": asset.info.version,
        "weights_hash": asset.info.weights_hash,
        "licence": asset.info.licence,
        "height_m": asset.info.height_m and round(asset.info.height_m, 4),
        "attributes": dict(asset.info.facts) or None,
        "photo": made.found.facts() if made.found else None,
        "vertices": len(asset.vertices),
        "faces": len(asset.faces),
        "parts": part_facts(asset),
        "levels": level_facts(made),
        "bytes": size,
        "axes": request.encoding.axes,
        "seconds": {stage: round(value, 3) for stage, value in seconds.items()},
        "error_mm": report.error.facts(),
        "missed_mm": report.missed.facts() if report.missed else None,
        "left_out": savings(report.left_out, config, made.avatar),
        "fit": made.fit.facts(request, seconds["total"]) if made.fit else None,
        "animations": [motion_facts(motion) for motion in made.motions],
        "settings": facts(replace(request, build=config)),
    }


def part_facts(asset: PlainAsset) -> list[dict[str, object]]:
    """Sizes of each part; none of one mesh."""
    parts = asset.parts if isinstance(asset, Asset) else ()
    return [
        {
            "name": part.name,
            "vertices": part.vertices[1] - part.vertices[0],
            "faces": part.faces[1] - part.faces[0],
        }
        for part in parts
    ]


def level_facts(made: Made) -> list[dict[str, object]]:
    """Faces of each coarser level, and how far it is from the field."""
    asset, found = made.asset, []
    for level in asset.levels:
        error = level_error(asset, level, made.avatar.sdf)
        found.append({"faces": len(level), "error_mm": error.facts()})
    return found
