"""What each scene needs of an avatar. Standard library alone, as arguments are checked before torch loads."""

from dataclasses import dataclass
from typing import Literal

DEFAULT = "game"


@dataclass(frozen=True, kw_only=True)
class Scene:
    """A use, its file format, and settings that fit it; what is not needed is left out."""

    purpose: str
    format: str = "glb"
    content: Literal["mesh", "textured", "rigged"] = "rigged"
    resolution: int = 512
    faces: int | None = 20_000  # None: every face of the extracted surface
    texture: int = 1024
    normal_map: int | None = None  # texels along a side
    joints: Literal["all", "24", "moving"] = "all"


SCENES = {
    "hero": Scene(purpose="seen close, moving", resolution=768, faces=40_000, texture=2048, normal_map=1024),
    "game": Scene(purpose="the default: one of a few, moving"),
    "crowd": Scene(
        purpose="one of hundreds, far away", resolution=256, faces=2_000, texture=256, joints="24"
    ),
    "print": Scene(
        purpose="a statue for a 3D printer", format="stl", content="mesh", resolution=384, faces=None
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
