"""Animations and morph targets of an asset as glTF has them.

A joint's channel turns its node, the root's and the hips' also move them. Joints that no animation moves have
no channel, and frames within a run that stands still are left out: between two equal keys every viewer stays
where it is. An animation that moves the face has a channel for the weights of each mesh; one of a face alone
has no other, so that it can be played over one of the body. Letters: T frames, C columns, J joints.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import pygltflib as gltf
from jaxtyping import Bool, Float32, Float64
from scipy.spatial.transform import Rotation

from assets.asset.asset import Asset
from assets.asset.rig import Animation
from exporters.binary import Binary

STILL = 1e-6  # of a quaternion's or place's numbers: below it nothing moves


def animations(asset: Asset, binary: Binary, meshes: Sequence[int] = ()) -> list[gltf.Animation]:
    """One glTF animation each, keys joined by straight lines (glTF turns along the shorter way). `meshes` are
    the nodes of meshes that have the asset's morphs."""
    moved, turned = moving_parts(asset)
    made = []
    for animation in asset.animations:
        encoded, clock = gltf.Animation(name=animation.name), Clock(times=animation.times, binary=binary)
        if not of_face_alone(asset, animation):
            add_joints(encoded, animation, moved, turned, clock)
        if animation.weights is not None and meshes:
            sampler = clock.add_sampler(encoded, animation.weights, scalars=True)
            for node in meshes:
                add_channel(encoded, sampler, node, "weights")
        made.append(encoded)
    return made


def moving_parts(asset: Asset) -> tuple[list[int], list[int]]:
    """The joints that leave their place, and those that leave their rest turn, in any animation.

    All animations have channels for all of them: a viewer that changes from one to the next then leaves no
    joint where the last one had it.
    """
    rest = asset.skeleton.T_parent_joint
    quaternions = rest_quaternions(rest)
    turned = [
        joint
        for joint in range(len(rest))
        if not all(stays(each.rotations[:, joint], quaternions[joint]) for each in asset.animations)
    ]
    moved = [
        joint
        for joint in (asset.animations[0].ways if asset.animations else ())
        if not all(stays(each.ways[joint], rest[joint, :3, 3]) for each in asset.animations)
    ]
    return moved if moved or turned else [0], turned  # glTF wants a channel at least


def of_face_alone(asset: Asset, animation: Animation) -> bool:
    """Morphs have weights, and every joint is at rest."""
    if animation.weights is None:
        return False
    rest = asset.skeleton.T_parent_joint
    still = (stays(animation.rotations[:, j], turn) for j, turn in enumerate(rest_quaternions(rest)))
    ways = (stays(way, rest[joint, :3, 3]) for joint, way in animation.ways.items())
    return all(ways) and all(still)


def add_joints(
    encoded: gltf.Animation, animation: Animation, moved: list[int], turned: list[int], clock: "Clock"
) -> None:
    """A channel for the way of each joint in `moved`, and one for each joint in `turned`."""
    for joint in moved:
        add_channel(encoded, clock.add_sampler(encoded, animation.ways[joint]), joint, "translation")
    for joint in turned:
        add_channel(encoded, clock.add_sampler(encoded, animation.rotations[:, joint]), joint, "rotation")


def add_channel(encoded: gltf.Animation, sampler: int, node: int, path: str) -> None:
    target = gltf.AnimationChannelTarget(node=node, path=path)
    encoded.channels.append(gltf.AnimationChannel(sampler=sampler, target=target))


@dataclass
class Clock:
    """The times of one animation; samplers with the same keys share them."""

    times: Float64[np.ndarray, " T"]
    binary: Binary
    known: dict[bytes, int] = field(default_factory=dict)

    def add_sampler(
        self, encoded: gltf.Animation, wide: Float64[np.ndarray, "T C"], scalars: bool = False
    ) -> int:
        """The number of a sampler of these values; those of `scalars` stand one by one."""
        values = wide.astype(np.float32)
        kept = keys(values)
        times, shown = self.times[kept].astype(np.float32), values[kept]
        if times.tobytes() not in self.known:
            self.known[times.tobytes()] = self.binary.add_array(times, bounds=True)
        output = self.binary.add_array(shown.ravel() if scalars else shown)
        encoded.samplers.append(
            gltf.AnimationSampler(input=self.known[times.tobytes()], output=output, interpolation="LINEAR")
        )
        return len(encoded.samplers) - 1


def stays(values: Float64[np.ndarray, "T C"], at_rest: Float64[np.ndarray, " C"]) -> bool:
    """The channel never leaves what its node has at rest; a quaternion and its opposite turn alike."""
    same = np.abs(values - at_rest).max() <= STILL
    return bool(same or (len(at_rest) == 4 and np.abs(values + at_rest).max() <= STILL))


def keys(values: Float32[np.ndarray, "T C"]) -> Bool[np.ndarray, " T"]:
    """Frames that are needed: all but those within a run of equal values; at least the first."""
    kept = np.ones(len(values), dtype=bool)
    same = (values[1:] == values[:-1]).all(axis=1)
    kept[1:-1] = ~(same[1:] & same[:-1])
    return kept


def rest_quaternions(rest: Float64[np.ndarray, "J 4 4"]) -> Float64[np.ndarray, "J 4"]:
    """The rotation of each rigid transform as x y z w with w >= 0."""
    return Rotation.from_matrix(rest[:, :3, :3]).as_quat(canonical=True)


def morph_targets(asset: Asset, binary: Binary) -> list[gltf.Attributes]:
    """What each slider adds to the positions and, where it says, to the normals; viewers keep those of the
    unmorphed mesh otherwise. Sliders of a part of the mesh are stored by the vertices that they move."""
    return [
        gltf.Attributes(POSITION=binary.add_array(morph.vertices, gltf.ARRAY_BUFFER, bounds=True))
        if morph.normals is None
        else gltf.Attributes(
            POSITION=binary.add_sparse(morph.vertices, bounds=True), NORMAL=binary.add_sparse(morph.normals)
        )
        for morph in asset.morphs
    ]
