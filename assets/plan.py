"""What is to be built, decided before anything is computed: the stages that the wanted content needs, and
what that leaves out.

Contents build on one another: `mesh` (vertices and faces in a rest pose), `textured` (also colours) and
`rigged` (also a skeleton with weights).
"""

from dataclasses import dataclass
from typing import Literal

from avatargen.errors import InputError

Content = Literal["mesh", "textured", "rigged"]
Joints = Literal["all", "24", "moving"]
CONTENTS: tuple[Content, ...] = ("mesh", "textured", "rigged")
# of the work at the default settings; the progress line adds up those that are planned
STAGES = {
    "extract": 0.4,
    "clean": 0.08,
    "simplify": 0.15,
    "fit": 0.04,
    "skin": 0.02,
    "measure": 0.1,
    "rest": 0.02,
    "atlas": 0.05,
    "bake": 0.15,
    "normals": 0.5,
    "occlusion": 0.5,
}


@dataclass(frozen=True, kw_only=True)
class LeftOut:
    """Something that is not done or not stored, and why."""

    what: str
    why: str
    stages: tuple[str, ...] = ()  # that are not run


@dataclass(frozen=True, kw_only=True)
class Plan:
    """Stages in order, and what is left out."""

    stages: tuple[str, ...]
    left_out: tuple[LeftOut, ...]

    def share(self, done: int) -> float:
        """Of the planned work, that lies behind when so many stages are done."""
        total = sum(STAGES[stage] for stage in self.stages)
        return sum(STAGES[stage] for stage in self.stages[:done]) / total


def make_plan(
    content: Content, faces: int | None, joints: Joints, normal_map: bool, ambient_occlusion: bool
) -> Plan:
    """The stages that content needs; `faces` None keeps every face of the extracted surface.

    Raises:
        InputError: a texture on a surface that is not simplified, whose charts would take minutes; a normal
            map or ambient occlusion of a mesh without texture coordinates.
    """
    if content not in CONTENTS:
        raise InputError(f"content: found {content!r}, wanted one of {', '.join(CONTENTS)}")
    if faces is None and content != "mesh":
        raise InputError(
            f"found content {content} without a number of faces, whose charts would take minutes; give one"
        )
    if content == "mesh" and (normal_map or ambient_occlusion):
        what = "a normal map" if normal_map else "ambient occlusion"
        raise InputError(f"found {what} on content mesh, which has no texture coordinates; drop one")
    left_out = [
        LeftOut(what="deformation network", why="in the canonical pose it has nothing to correct"),
        LeftOut(what="volume rendering and upsampling", why="a file holds a surface, not a picture"),
    ]
    if faces is None:
        left_out.append(
            LeftOut(
                what="simplification",
                why="every face of the extracted surface is wanted",
                stages=("simplify", "fit"),
            )
        )
    if content == "mesh":
        why = "a mesh alone is wanted"
        left_out.append(LeftOut(what="texture coordinates", why=why, stages=("atlas",)))
        left_out.append(LeftOut(what="colours", why=why, stages=("bake",)))
    left_out += unwanted_maps(content, normal_map, ambient_occlusion)
    if content != "rigged":
        why = "nothing will move it; weights served to pose it and are not stored"
        left_out.append(LeftOut(what="skeleton and weights", why=why))
    elif joints == "24":
        left_out.append(LeftOut(what="fingers' joints", why="SMPL's 24 are wanted; hands move them all"))
    elif joints == "moving":
        left_out.append(LeftOut(what="idle joints", why="they move no vertex and carry no joint that does"))
    skipped = {stage for item in left_out for stage in item.stages}
    return Plan(stages=tuple(stage for stage in STAGES if stage not in skipped), left_out=tuple(left_out))


def unwanted_maps(content: Content, normal_map: bool, ambient_occlusion: bool) -> list[LeftOut]:
    """The maps beside the base colour that are not made, and why."""
    alone = "a mesh alone is wanted" if content == "mesh" else None
    found = []
    if not normal_map:
        why = alone or "it shows only up close and was not wanted"
        found.append(LeftOut(what="normal map", why=why, stages=("normals",)))
    if not ambient_occlusion:
        why = alone or "many viewers shade hollows by themselves, and it was not wanted"
        found.append(LeftOut(what="ambient occlusion", why=why, stages=("occlusion",)))
    return found
