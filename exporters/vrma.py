"""A rig's animations as VRM Animation 1.0: a .glb of the joints alone, known as a person's bones and resting
in the T-pose, which programs for VRM play on any .vrm. Where they play but one animation, it is the first.

A face's shapes become expressions: VRM's presets as far as they go, which any person has, and for what is
left the custom ones that our .vrm files have. An expression is a node whose x is its weight. Letters: T
frames.
"""

import numpy as np
import pygltflib as gltf
from jaxtyping import Float64

from assets.asset.asset import Asset
from assets.asset.rig import Animation
from assets.face.names import EXPRESSIONS
from exporters import glb
from exporters.binary import Binary
from exporters.glb_motion import Clock, add_channel, animations

EXTENSION = "VRMC_vrm_animation"
LOOKING = ("leftEye", "rightEye")  # eyes have a way of their own there, and no joints
FAINT = 1e-4  # of a weight: below it an expression does not show


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
    played = expressions_of(asset)
    add_expressions(document, asset, played, binary)
    document.accessors, document.bufferViews = binary.accessors, binary.views
    document.buffers = [gltf.Buffer(byteLength=len(binary.data))]
    named = {bone: {"node": joint} for bone, joint in bones.items() if bone not in LOOKING}
    document.extensionsUsed = [EXTENSION]
    shown = {name: {"node": len(skeleton.parents) + number} for number, name in enumerate(shown_in(played))}
    presets = {name: node for name, node in shown.items() if name in EXPRESSIONS}
    customs = {name: node for name, node in shown.items() if name not in EXPRESSIONS}
    kinds = {kind: nodes for kind, nodes in (("preset", presets), ("custom", customs)) if nodes}
    document.extensions = {
        EXTENSION: {
            "specVersion": "1.0",
            "humanoid": {"humanBones": named},
            **({"expressions": kinds} if kinds else {}),
        }
    }
    return glb.pack(document, bytes(binary.data))


def expressions_of(asset: Asset) -> list[dict[str, Float64[np.ndarray, " T"]]]:
    """The weights of expressions in each animation."""
    names = [morph.name for morph in asset.morphs]
    return [as_expressions(names, animation) for animation in asset.animations]


def as_expressions(names: list[str], animation: Animation) -> dict[str, Float64[np.ndarray, " T"]]:
    """Weights of shapes as weights of expressions, which add up to the same: in each frame as much of each
    preset as its shapes have left, then what is left of the shapes. A gaze has a way of its own there."""
    if animation.weights is None:
        return {}
    left = {name: animation.weights[:, number].copy() for number, name in enumerate(names)}
    found = {}
    for preset, shapes in EXPRESSIONS.items():
        if shapes and not preset.startswith("look") and set(shapes) <= left.keys():
            found[preset] = np.min([left[shape] / share for shape, share in shapes.items()], axis=0).clip(
                0, 1
            )
            for shape, share in shapes.items():
                left[shape] -= share * found[preset]
    return {name: weights for name, weights in (found | left).items() if weights.max() > FAINT}


def shown_in(played: list[dict[str, Float64[np.ndarray, " T"]]]) -> list[str]:
    """Every expression that any animation shows."""
    return list(dict.fromkeys(name for each in played for name in each))


def add_expressions(
    document: gltf.GLTF2, asset: Asset, played: list[dict[str, Float64[np.ndarray, " T"]]], binary: Binary
) -> None:
    """A node for each expression, behind the joints, and its channel in each animation that shows it."""
    nodes = {name: len(document.nodes) + number for number, name in enumerate(shown_in(played))}
    document.nodes += [gltf.Node(name=name) for name in nodes]
    document.scenes[0].nodes = [*(document.scenes[0].nodes or ()), *nodes.values()]
    for encoded, animation, shown in zip(document.animations, asset.animations, played, strict=True):
        clock = Clock(times=animation.times, binary=binary)
        for name, weights in shown.items():
            places = np.zeros((len(weights), 3))
            places[:, 0] = weights
            add_channel(encoded, clock.add_sampler(encoded, places), nodes[name], "translation")
