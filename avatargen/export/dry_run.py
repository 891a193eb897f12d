"""What an export would do, in words."""

from assets.choose import candidates, curves_for
from assets.pipeline import plan_for
from avatargen.export.fingerprint import fingerprint
from avatargen.export.left_out import saving
from avatargen.export.request import ExportRequest

TOLD = {"content", "resolution", "faces", "texture", "normal_map", "ambient_occlusion", "joints", "format"}


def describe(request: ExportRequest) -> str:
    """The plan: settings, stages, what is left out; seconds are those of the machine that the bench ran on.

    Raises:
        InputError: the budget has no room for anything.
    """
    assert isinstance(request.seeds, int)  # many have no dry run
    curves, config = curves_for(None), request.build
    lines = [f"{request.path_of(request.seeds).name}: {config.content}"]
    if request.chosen:
        tries = candidates(config, curves, tolerance_mm=request.tolerance_mm, budget_s=request.budget_s)
        config, choice = next(tries)
        lines.append(f"chosen: about {choice.seconds:.1f} s, {choice.p99_mm:.2f} mm p99")
    faces = "all" if config.faces is None else f"{config.faces:,}"
    texture = "none" if config.content == "mesh" else str(config.texture)
    lines.append(
        f"resolution {config.resolution}, faces {faces}, texture {texture}, "
        f"normal map {config.normal_map or 'none'}, "
        f"ambient occlusion {config.ambient_occlusion or 'none'}, joints {config.joints}"
    )
    others = set_otherwise(request)
    if others:
        lines.append("set otherwise than by default: " + ", ".join(others))
    plan = plan_for(config)
    lines.append("stages: " + ", ".join(plan.names))
    for item in plan.left_out:
        said = saving(item, config, curves)
        saved = f" (saves about {said['seconds_saved']:.1f} s)" if "seconds_saved" in said else ""
        lines.append(f"left out: {item.what}: {item.why}{saved}")
    return "\n".join(lines)


def set_otherwise(request: ExportRequest) -> list[str]:
    """Every other setting that changes bytes and is not at its default."""
    usual, found = fingerprint(ExportRequest(seeds=0)), fingerprint(request)
    return [f"{name} {found[name]}" for name in found if name not in TOLD and found[name] != usual[name]]
