"""What each scene needs of an asset. Standard library alone, as a command names the scenes before torch
loads; `BuildConfig.for_scene` turns one into settings.
"""

from dataclasses import dataclass

from assets.content import Content, Face, Joints
from avatargen.errors import InputError

DEFAULT = "game"


@dataclass(frozen=True, kw_only=True)
class Scene:
    """A use, its file format, and settings that fit it; what is not needed is left out."""

    purpose: str
    format: str = "glb"
    content: Content = "rigged"
    resolution: int = 512
    faces: int | None = 20_000  # None: every face of the extracted surface
    texture: int = 1024
    normal_map: int | None = None  # texels along a side
    joints: Joints = "all"
    face: Face = "none"
    for_slicers: bool = False  # what names no unit is in millimetres, z up


SCENES = {
    "hero": Scene(purpose="seen close, moving", resolution=768, faces=40_000, texture=2048, normal_map=1024),
    "game": Scene(purpose="the default: one of a few, moving"),
    "crowd": Scene(
        purpose="one of hundreds, far away", resolution=256, faces=2_000, texture=256, joints="24"
    ),
    "print": Scene(
        purpose="a statue for a 3D printer",
        format="stl",
        content="mesh",
        resolution=384,
        faces=None,
        for_slicers=True,
    ),
    "ar": Scene(purpose="a phone's viewer", format="usdz", faces=15_000),
    "still": Scene(
        purpose="a picture: seen close, never moving",
        content="textured",
        faces=40_000,
        texture=2048,
        normal_map=1024,
    ),
}


def find_scene(name: str) -> Scene:
    """The scene of that name. Raises InputError where there is none."""
    if name not in SCENES:
        raise InputError(f"found scene {name!r}, wanted one of {', '.join(SCENES)}")
    return SCENES[name]
