"""A rig's animations as VRM Animation 1.0: a .glb of the joints alone, known as a person's bones and resting
in the T-pose, which programs for VRM play on any .vrm. Where they play but one animation, it is the first.
"""

import pygltflib as gltf

from assets.asset.asset import Asset
from exporters import glb
from exporters.binary import Binary
from exporters.glb_motion import animations

EXTENSION = "VRMC_vrm_animation"
LOOKING = ("leftEye", "rightEye")  # eyes have a way of their own there, and no joints


def encode(asset: Asset, bones: dict[str, int]) -> bytes:
    """The bytes of a .vrma file for an asset with animations; `bones` are its joints by VRM's names."""
    binary, skeleton = Binary(), asset.skeleton
    document = gltf.GLTF2(
        asset=glb.file_info(asset.info),
        scene=0,
        scenes=[
            gltf.Scene(name="avatar", nodes=[j for j, parent in enumerate(skeleton.parents) if parent < 0])
        ],
        nodes=glb.joint_nodes(skeleton),
        animations=animations(asset, binary),
    )
    document.accessors, document.bufferViews = binary.accessors, binary.views
    document.buffers = [gltf.Buffer(byteLength=len(binary.data))]
    named = {bone: {"node": joint} for bone, joint in bones.items() if bone not in LOOKING}
    document.extensionsUsed = [EXTENSION]
    document.extensions = {EXTENSION: {"specVersion": "1.0", "humanoid": {"humanBones": named}}}
    return glb.pack(document, bytes(binary.data))
