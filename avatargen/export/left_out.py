"""What leaving things out saved, by the measured curves."""

from collections.abc import Sequence

from assets.build_config import AvatarFields, BuildConfig
from assets.choose import Curves, curves_for
from assets.content import LeftOut


def savings(
    left_out: Sequence[LeftOut], config: BuildConfig, avatar: AvatarFields
) -> list[dict[str, object]]:
    """What was left out, for the report, in seconds of this machine."""
    curves = curves_for(avatar)
    return [saving(item, config, curves) for item in left_out]


def saving(item: LeftOut, config: BuildConfig, curves: Curves) -> dict[str, object]:
    """What leaving a part out saved; nothing is said where nothing was measured."""
    said: dict[str, object] = {"what": item.what, "why": item.why}
    stages = [*item.stages, "encode"] if "bake" in item.stages else item.stages
    if stages:
        faces = config.faces or curves.most_faces
        seconds = (curves.stage_seconds(stage, config.resolution, faces, config.texture) for stage in stages)
        said["seconds_saved"] = round(sum(seconds), 3)
    if "bake" in item.stages:
        said["bytes_saved"] = curves.texture_bytes(config.texture)
    return said
