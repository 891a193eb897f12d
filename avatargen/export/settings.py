"""A scene's settings for the geometry, as far as a format holds what it asks for."""

from dataclasses import replace
from typing import Any

from assets.build_config import BuildConfig
from assets.content import CONTENTS
from assets.scenes import find_scene
from avatargen.errors import InputError
from avatargen.export.request import require_map
from exporters import find_format

DEFAULT_FACES = 20_000  # of a scene that keeps all, where charts are wanted after all
MAPS = {"normal_map": "normal", "ambient_occlusion": "occlusion"}  # field: what a format calls it


def settings_for(scene_name: str, format_name: str, **given: Any) -> BuildConfig:
    """The fields of `BuildConfig` that are given, over the scene's. What the format does not hold is left out
    where nobody asked for it, and the rest pose is the one that it must have. A map of 0 texels is none.

    Raises:
        InputError: an unknown scene or format, a value out of range, or a map that what is made cannot hold.
    """
    scene, wanted = find_scene(scene_name), find_format(f"avatar.{format_name}")
    content = given.get("content") or min(scene.content, wanted.content, key=CONTENTS.index)
    if content != "rigged":
        for name, left in (("joints", scene.joints), ("bones", "along"), ("face", scene.face)):
            if given.get(name, left) != left:
                raise InputError(
                    f"found --{name} {given[name]}, but what is made holds no skeleton ({content}); leave "
                    "it out, or choose glb, vrm or usdz and a scene that moves"
                )
    held = () if content == "mesh" else wanted.maps
    for name, kind in MAPS.items():
        require_map(f"--{name.replace('_', '-')}", given.get(name), kind in held)
    chosen = {
        "content": content,
        "faces": scene.faces if content == "mesh" else scene.faces or DEFAULT_FACES,
        "normal_map": scene.normal_map if "normal" in held else None,
        "face": scene.face if content == "rigged" else "none",
    }
    if wanted.rest_pose is not None:
        chosen["pose"] = wanted.rest_pose
    none = {name: None for name in MAPS if given.get(name) == 0}
    return replace(BuildConfig.for_scene(scene_name), **chosen | given | none)
