"""A rigged asset as VRM 1.0: a .glb whose joints are known as a person's bones, and who may use it for what.

VRM wants a person at rest in the T-pose, facing +z, soles at y = 0, with fifteen bones at least. A .vrm holds
no animations: they go into NAME.vrma beside it.
"""

from dataclasses import replace

import numpy as np
import pygltflib as gltf

from assets.asset.asset import Asset, AssetInfo, PlainAsset
from assets.asset.names import NAME_PRESETS, VRM_HUMAN_BONES
from assets.asset.rig import Skeleton
from assets.asset.root_bone import on_hips
from assets.asset.twist import HALF
from assets.face.names import ARKIT, EXPRESSIONS, VISEMES
from avatargen.errors import InputError
from exporters import glb, vrm_springs, vrma
from exporters.encoding import PLAIN, Encoding
from exporters.file import File

REST_POSE = "t"
LICENCE_URL = "https://vrm.dev/licenses/1.0/"
OPEN_LICENCES = {  # that let anyone do anything, and where they stand
    "Apache-2.0": "https://www.apache.org/licenses/LICENSE-2.0",
    "CC0-1.0": "https://creativecommons.org/publicdomain/zero/1.0/",
    "MIT": "https://opensource.org/license/mit",
}
SIDED = ("UpperArm", "LowerArm", "Hand", "UpperLeg", "LowerLeg", "Foot")
REQUIRED_BONES = ("hips", "spine", "head", *(side + bone for side in ("left", "right") for bone in SIDED))
GAZE = {  # degrees that an eye turns for what is aside, above or below
    "HorizontalInner": 12.0,
    "HorizontalOuter": 14.0,
    "VerticalDown": 10.0,
    "VerticalUp": 10.0,
}
LARGEST_TURN = 0.1  # radians a joint may be off the T-pose
ROLLING = "VRMC_node_constraint"
FOREARM_TWISTS = {
    table.get(f"{side}_elbow_twist", f"{side}_elbow_twist"): side
    for table in NAME_PRESETS.values()
    for side in ("left", "right")
}
ALONG = 0.9999  # cosine within which a frame's y axis lies along its bone
LARGEST_GAP = 0.02  # metres between the soles and the ground


def encode_files(asset: PlainAsset, names: tuple[str, ...], encoding: Encoding) -> tuple[File, ...]:
    """NAME.vrm, and NAME.vrma where there are animations. Raises the errors of `encode`."""
    name, motion_name = names
    files = (File(name, encode(asset, encoding)),)
    if not isinstance(asset, Asset) or not asset.animations:
        return files
    moving = on_hips(asset) if asset.skeleton.armature else asset
    return (*files, File(motion_name, vrma.encode(moving, human_bones(asset.skeleton.joint_names))))


def encode(asset: PlainAsset, encoding: Encoding = PLAIN) -> bytes:
    """The bytes of a .vrm file.

    Raises:
        InputError: the asset has no skeleton or not the bones, pose or place that VRM wants.
    """
    if not isinstance(asset, Asset):
        raise InputError("vrm: the asset has no skeleton, which VRM is about; build a rigged one")
    bones = human_bones(asset.skeleton.joint_names)
    require_t_pose(asset.skeleton, bones)
    gap = float(asset.vertices[:, 1].min())
    if abs(gap) > LARGEST_GAP:
        raise InputError(f"vrm: the soles are at y = {gap:.2f} m, wanted 0; build with on_ground=True")
    document, data = glb.describe(replace(asset, animations=(), levels=()), encoding)
    mesh_nodes = [i for i, node in enumerate(document.nodes) if node.mesh is not None]
    document.extensionsUsed = ["VRMC_vrm", *([ROLLING] if add_rolls(document, asset, bones) else [])]
    document.extensions = {
        "VRMC_vrm": {
            "specVersion": "1.0",
            "meta": meta(asset.info),
            "humanoid": {"humanBones": {bone: {"node": joint} for bone, joint in bones.items()}},
            **expressions(asset, mesh_nodes),
            **look_at(asset, bones),
            "firstPerson": {"meshAnnotations": [{"node": node, "type": "auto"} for node in mesh_nodes]},
        }
    }
    if asset.springs:
        document.extensionsUsed.append(vrm_springs.EXTENSION)
        document.extensions[vrm_springs.EXTENSION] = vrm_springs.spring_bones(asset)
    return glb.pack(document, data)


def add_rolls(document: gltf.GLTF2, asset: Asset, bones: dict[str, int]) -> bool:
    """Let programs roll the forearms' twist bones by half of their hands; whether there are any.

    An upper arm's would have to turn back, which no constraint does: those move with their bones.
    """
    skeleton, found = asset.skeleton, False
    for joint, name in enumerate(skeleton.joint_names):
        side = FOREARM_TWISTS.get(name)
        if side is None:
            continue
        hand, elbow = bones[f"{side}Hand"], skeleton.parents[joint]
        way = skeleton.joints[hand] - skeleton.joints[elbow]
        if skeleton.T_world_joint[joint, :3, 1] @ way < ALONG * np.linalg.norm(way):
            continue  # its frame has no axis to roll about
        roll = {"source": hand, "rollAxis": "Y", "weight": HALF}
        document.nodes[joint].extensions = {ROLLING: {"specVersion": "1.0", "constraint": {"roll": roll}}}
        found = True
    return found


def expressions(asset: Asset, nodes: list[int]) -> dict[str, object]:
    """VRM's presets as sums of the asset's shapes, and each shape under its own name; nothing of an asset
    without a face that moves."""
    index = {morph.name: number for number, morph in enumerate(asset.morphs)}
    if not set(ARKIT | VISEMES) <= set(index):
        return {}

    def expression(shapes: dict[str, float]) -> dict[str, object]:
        binds = [
            {"node": node, "index": index[name], "weight": weight}
            for node in nodes
            for name, weight in shapes.items()
        ]
        return {"morphTargetBinds": binds} if binds else {}

    presets = {name: expression(shapes) for name, shapes in EXPRESSIONS.items()}
    alone = {name: expression({name: 1.0}) for name in (*ARKIT, *VISEMES)}
    return {"expressions": {"preset": presets, "custom": alone}}


def look_at(asset: Asset, bones: dict[str, int]) -> dict[str, object]:
    """How far eyes turn that follow something; nothing of an asset whose eyes have no bones."""
    if not {"leftEye", "rightEye", "head"} <= set(bones):
        return {}
    eyes, head = [bones["leftEye"], bones["rightEye"]], bones["head"]
    turned = asset.skeleton.T_world_joint[head, :3, :3]
    middle = asset.skeleton.joints[eyes].mean(axis=0) - asset.skeleton.joints[head]
    maps = {
        f"rangeMap{way}": {"inputMaxValue": 90.0, "outputScale": degrees} for way, degrees in GAZE.items()
    }
    return {"lookAt": {"type": "bone", "offsetFromHeadBone": (middle @ turned).tolist(), **maps}}


def human_bones(joint_names: tuple[str, ...]) -> dict[str, int]:
    """Joint by VRM's name of its bone; joints may have the names of any preset.

    Raises:
        InputError: a bone that VRM requires is missing.
    """
    bone_of_name = {
        table.get(joint, joint): bone
        for table in NAME_PRESETS.values()
        for joint, bone in VRM_HUMAN_BONES.items()
    }
    bones = {bone_of_name[name]: index for index, name in enumerate(joint_names) if name in bone_of_name}
    missing = [bone for bone in REQUIRED_BONES if bone not in bones]
    if missing:
        raise InputError(
            f"vrm: no joint is known as {', '.join(missing)}; use a body whose joints have SMPL's names"
        )
    return bones


def require_t_pose(skeleton: Skeleton, bones: dict[str, int]) -> None:
    """Raises InputError where a bone rests turned against the T-pose."""
    if skeleton.rest_rotations is None:
        return
    cosine = (np.trace(skeleton.rest_rotations[list(bones.values())], axis1=1, axis2=2) - 1) / 2
    worst = float(np.arccos(np.clip(cosine, -1, 1)).max())
    if worst > LARGEST_TURN:
        raise InputError(
            f"vrm: a joint rests {np.degrees(worst):.0f} degrees off the T-pose, which VRM wants; "
            "build with pose='t' (--pose t)"
        )


def meta(info: AssetInfo) -> dict[str, object]:
    """Name, author and permissions: all of them under an open licence, else VRM's strictest."""
    facts: dict[str, object] = {
        "name": f"avatar {info.seed}",
        "version": info.version,
        "authors": ["avatargen"],
        "copyrightInformation": info.licence,
        "licenseUrl": LICENCE_URL,
    }
    if info.licence not in OPEN_LICENCES:
        return facts
    return facts | {
        "avatarPermission": "everyone",
        "commercialUsage": "corporation",
        "creditNotation": "unnecessary",
        "allowRedistribution": True,
        "modification": "allowModificationRedistribution",
        "otherLicenseUrl": OPEN_LICENCES[info.licence],
    }
