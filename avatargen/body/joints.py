"""Names of SMPL's joints, and of the hands' joints that SMPL-H and SMPL-X add.

`left` is the person's left, +x. A body or motion whose file names no joints has those of its count.
"""

from collections.abc import Collection

SMPL_BODY_NAMES = (
    "pelvis",
    "left_hip",
    "right_hip",
    "spine1",
    "left_knee",
    "right_knee",
    "spine2",
    "left_ankle",
    "right_ankle",
    "spine3",
    "left_foot",
    "right_foot",
    "neck",
    "left_collar",
    "right_collar",
    "head",
    "left_shoulder",
    "right_shoulder",
    "left_elbow",
    "right_elbow",
    "left_wrist",
    "right_wrist",
)
FINGERS = ("index", "middle", "pinky", "ring", "thumb")
FINGER_NAMES = tuple(
    f"{side}_{finger}{link}" for side in ("left", "right") for finger in FINGERS for link in (1, 2, 3)
)
SMPL_JOINT_NAMES = (*SMPL_BODY_NAMES, "left_hand", "right_hand")
SMPLH_JOINT_NAMES = (*SMPL_BODY_NAMES, *FINGER_NAMES)
SMPLX_JOINT_NAMES = (*SMPL_BODY_NAMES, "jaw", "left_eye", "right_eye", *FINGER_NAMES)
JOINT_NAMES = {
    len(names): names for names in (SMPL_BODY_NAMES, SMPL_JOINT_NAMES, SMPLH_JOINT_NAMES, SMPLX_JOINT_NAMES)
}


def mirrored_name(name: str) -> str:
    """The joint on the other side, or the joint itself on the middle."""
    if name.startswith("left_"):
        return "right_" + name.removeprefix("left_")
    if name.startswith("right_"):
        return "left_" + name.removeprefix("right_")
    return name


def driving_name(name: str, names: Collection[str]) -> str | None:
    """Which of a pose's or motion's joints turns a skeleton's joint: the one of its name; where only one of
    the two has fingers, the middle one turns the hand, and the hand turns four fingers at their first links.
    """
    candidates = [name]
    if name.endswith("_hand"):
        candidates.append(name.removesuffix("hand") + "middle1")
    side, _, part = name.partition("_")
    if part in (f"{finger}1" for finger in FINGERS if finger != "thumb"):
        candidates.append(f"{side}_hand")
    return next((each for each in candidates if each in names), None)
