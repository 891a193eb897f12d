"""How much an asset holds, and what making it left out.

Contents build on one another: `mesh` (vertices and faces in a rest pose), `textured` (also colours) and
`rigged` (also a skeleton with weights).
"""

from dataclasses import dataclass
from typing import Literal

Content = Literal["mesh", "textured", "rigged"]
Joints = Literal["all", "24", "moving"]
Face = Literal["none", "shapes"]
FACES: tuple[Face, ...] = ("none", "shapes")
MOVING_FACE: Face = "shapes"
CONTENTS: tuple[Content, ...] = ("mesh", "textured", "rigged")


@dataclass(frozen=True, kw_only=True)
class LeftOut:
    """Something that is not done or not stored, and why."""

    what: str
    why: str
    stages: tuple[str, ...] = ()  # that are not run
