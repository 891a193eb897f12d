"""Where the landmark network's 33 points lie on the body: each moves with a joint, at an offset from it."""

from dataclasses import dataclass

from avatargen.photo.seeing.pose import NAMES

HEAD = ("nose", *(name for name in NAMES if "eye" in name or "ear" in name or "mouth" in name))


@dataclass(frozen=True, kw_only=True)
class Anchor:
    """A landmark at `joint` plus an offset, metres, that turns with `frame`."""

    name: str
    joint: str
    frame: str
    offset: tuple[float, float, float]


def joint_of(name: str) -> tuple[str, str]:
    """The joint of a landmark, and the joint that turns its offset."""
    if name in HEAD:
        return "head", "head"
    side, part = name.split("_")
    joint, frame = {
        "shoulder": ("shoulder", "collar"),
        "elbow": ("elbow", "shoulder"),
        "wrist": ("wrist", "elbow"),
        "pinky": ("wrist", "wrist"),
        "index": ("wrist", "wrist"),
        "thumb": ("wrist", "wrist"),
        "hip": ("hip", "pelvis"),
        "knee": ("knee", "hip"),
        "ankle": ("ankle", "knee"),
        "heel": ("ankle", "ankle"),
        "foot": ("ankle", "ankle"),
    }[part]
    return f"{side}_{joint}", frame if frame == "pelvis" else f"{side}_{frame}"


# of the left side, the right one mirrored; by least squares over rendered people whose pose is known
OFFSETS = {
    "nose": (0.000, 0.035, 0.117),
    "left_eye_inner": (0.019, 0.065, 0.103),
    "left_eye_middle": (0.031, 0.065, 0.101),
    "left_eye_outer": (0.043, 0.065, 0.099),
    "left_ear": (0.061, 0.054, 0.059),
    "mouth_left": (0.022, 0.001, 0.096),
    "left_shoulder": (-0.008, 0.022, 0.013),
    "left_elbow": (-0.020, -0.010, 0.003),
    "left_wrist": (0.010, -0.009, 0.007),
    "left_pinky": (0.089, 0.000, 0.003),
    "left_index": (0.091, -0.008, 0.016),
    "left_thumb": (0.060, -0.023, 0.017),
    "left_hip": (-0.018, -0.025, 0.045),
    "left_knee": (-0.012, -0.019, 0.016),
    "left_ankle": (-0.004, 0.022, 0.020),
    "left_heel": (-0.016, -0.036, -0.004),
    "left_foot": (-0.007, -0.056, 0.163),
}


def offset_of(name: str) -> tuple[float, float, float]:
    """Metres from the joint."""
    if name in OFFSETS:
        return OFFSETS[name]
    x, y, z = OFFSETS[name.replace("right", "left")]
    return (-x, y, z)


ANCHORS = tuple(
    Anchor(name=name, joint=joint_of(name)[0], frame=joint_of(name)[1], offset=offset_of(name))
    for name in NAMES
)
