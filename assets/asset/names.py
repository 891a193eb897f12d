"""Names of joints that other programs expect, for a skeleton whose joints have SMPL's names.

`unity` are Unity's human bones, which VRM's are in camel case; `mixamo` those of Mixamo's rigs; `unreal`
those of Unreal's mannequins; `rpm` Mixamo's without their prefix, as Ready Player Me's avatars have them.
SMPL's `left_hand` sits at the middle finger's knuckle and moves all fingers, so it has that bone's name. A
joint that a table does not have keeps its own name.
"""

from dataclasses import replace

from assets.asset.asset import Asset
from avatargen.body.joints import FINGERS
from avatargen.errors import InputError

LINKS = ("Proximal", "Intermediate", "Distal")
THUMB_LINKS_OF_VRM = ("Metacarpal", "Proximal", "Distal")
FINGER_OF_UNITY = {"pinky": "Little"}  # other fingers as in SMPL-H
MIDDLE = {  # SMPL: (Unity, Mixamo, Unreal)
    "pelvis": ("Hips", "Hips", "pelvis"),
    "spine1": ("Spine", "Spine", "spine_01"),
    "spine2": ("Chest", "Spine1", "spine_02"),
    "spine3": ("UpperChest", "Spine2", "spine_03"),
    "neck": ("Neck", "Neck", "neck_01"),
    "head": ("Head", "Head", "head"),
    "jaw": ("Jaw", "Jaw", "jaw"),
}
SIDED = {
    "hip": ("UpperLeg", "UpLeg", "thigh"),
    "knee": ("LowerLeg", "Leg", "calf"),
    "ankle": ("Foot", "Foot", "foot"),
    "foot": ("Toes", "ToeBase", "ball"),
    "collar": ("Shoulder", "Shoulder", "clavicle"),
    "shoulder": ("UpperArm", "Arm", "upperarm"),
    "elbow": ("LowerArm", "ForeArm", "lowerarm"),
    "wrist": ("Hand", "Hand", "hand"),
    "hand": ("MiddleProximal", "HandMiddle1", "middle_01"),
    "eye": ("Eye", "Eye", "eye"),
    **{
        f"{finger}{link}": (
            FINGER_OF_UNITY.get(finger, finger.capitalize()) + LINKS[link - 1],
            f"Hand{finger.capitalize()}{link}",
            f"{finger}_{link:02d}",
        )
        for finger in FINGERS
        for link in (1, 2, 3)
    },
}

TWISTS = {  # bones that share a roll
    "shoulder_twist": ("UpperArmTwist", "ArmTwist", "upperarm_twist_01"),
    "elbow_twist": ("LowerArmTwist", "ForeArmTwist", "lowerarm_twist_01"),
}

ARM_AND_LEG = ("hip", "knee", "ankle", "foot", "shoulder", "elbow", "wrist")
# what programs for people need of a skeleton (the human bones that VRM and Unity require), and the toes, on
# which the built-in clips roll
PERSON_JOINTS = (
    "pelvis",
    "spine1",
    "head",
    *(f"{s}_{part}" for s in ("left", "right") for part in ARM_AND_LEG),
)


def preset_tables() -> dict[str, dict[str, str]]:
    """New name by SMPL's, for every preset."""
    unity, mixamo, unreal = ({joint: names[i] for joint, names in MIDDLE.items()} for i in range(3))
    for side in ("left", "right"):
        for joint, (unity_name, mixamo_name, unreal_name) in (SIDED | TWISTS).items():
            unity[f"{side}_{joint}"] = side.capitalize() + unity_name
            mixamo[f"{side}_{joint}"] = side.capitalize() + mixamo_name
            unreal[f"{side}_{joint}"] = f"{unreal_name}_{side[0]}"
    mixamo["head_end"] = "HeadTop_End"
    for side in ("left", "right"):
        mixamo[f"{side}_foot_end"] = f"{side.capitalize()}Toe_End"
        mixamo |= {f"{side}_{f}3_end": f"{side.capitalize()}Hand{f.capitalize()}4" for f in FINGERS}
    prefixed = {joint: f"mixamorig:{name}" for joint, name in mixamo.items()}
    return {"smpl": {}, "mixamo": prefixed, "unity": unity, "unreal": unreal, "rpm": mixamo}


NAME_PRESETS = preset_tables()


def vrm_human_bones() -> dict[str, str]:
    """VRM 1.0's human bone by SMPL's joint: Unity's in camel case, but for the links of the thumb."""
    unity = NAME_PRESETS["unity"].items()
    bones = {j: name[0].lower() + name[1:] for j, name in unity if not j.endswith("_twist")}
    for side in ("left", "right"):
        for link, word in enumerate(THUMB_LINKS_OF_VRM, start=1):
            bones[f"{side}_thumb{link}"] = f"{side}Thumb{word}"
    return bones


VRM_HUMAN_BONES = vrm_human_bones()


def rename_joints(asset: Asset, preset: str) -> Asset:
    """The asset with its joints named as the preset's programs expect.

    Raises:
        InputError: no preset has that name, or two joints would get the same name.
    """
    if preset not in NAME_PRESETS:
        raise InputError(f"names: no preset is called {preset!r}; use one of {', '.join(NAME_PRESETS)}")
    table = NAME_PRESETS[preset]
    names = tuple(table.get(name, name) for name in asset.skeleton.joint_names)
    if len(set(names)) < len(names):
        raise InputError(f"names: {preset} would name two joints alike; keep --names smpl for this body")
    return replace(asset, skeleton=replace(asset.skeleton, joint_names=names))
