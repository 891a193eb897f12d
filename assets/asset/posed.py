"""An asset in another pose: its mesh skinned with its own weights, its skeleton moved along.

Rotations are in world axes, so they do not depend on how the skeleton's own joint axes are laid.
Letters: W vertices, J joints.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Float, Float32, Float64, Int64

from assets.asset.asset import Asset
from assets.asset.rig import Morph
from assets.texture.normal_map import NormalMap
from avatargen.body.pose import axis_angle_to_matrix
from avatargen.errors import InputError


def world_rotations(
    rotations: Float[np.ndarray, "J 3"], parents: Int64[np.ndarray, " J"]
) -> Float64[np.ndarray, "J 3 3"]:
    """World rotations of the joints for axis-angle rotations against each one's parent, as in SMPL."""
    world = axis_angle_to_matrix(rotations)
    for joint, parent in enumerate(parents):
        if parent >= 0:
            world[joint] = world[parent] @ world[joint]
    return world


def posed(asset: Asset, rotations: Float[np.ndarray, "J 3"], on_ground: bool = True) -> Asset:
    """The asset in a pose given as SMPL does, against the T-pose: it then rests in that pose.

    `on_ground` puts the lowest vertex at y = 0. Animations and morphs of the body, which belong to the old
    rest, are left out; a face's shapes turn along.

    Raises:
        InputError: rotations of another count than the joints, or not finite.
    """
    skeleton, count = asset.skeleton, len(asset.skeleton.parents)
    if rotations.shape != (count, 3) or not np.isfinite(rotations).all():
        raise InputError(f"pose: rotations have shape {rotations.shape}; finite [{count}, 3] are needed")
    from_t = from_rest = world_rotations(rotations, skeleton.parents)
    if skeleton.rest_rotations is not None:
        from_rest = from_t @ skeleton.rest_rotations.transpose(0, 2, 1)
    places = skeleton.joints.copy()
    for joint, parent in enumerate(skeleton.parents):
        if parent >= 0:
            places[joint] = places[parent] + from_rest[parent] @ (
                skeleton.joints[joint] - skeleton.joints[parent]
            )
    shares = asset.weights.astype(np.float64)
    blended = np.einsum("wk,wkab->wab", shares, from_rest[asset.joints])
    moves = places - np.einsum("jab,jb->ja", from_rest, skeleton.joints)
    vertices = np.einsum("wab,wb->wa", blended, asset.vertices) + np.einsum(
        "wk,wkd->wd", shares, moves[asset.joints]
    )
    lift = np.array([0.0, -vertices[:, 1].min() if on_ground else 0.0, 0.0])
    normals = turned(asset.normals, blended)
    T_world_joint = skeleton.T_world_joint.copy()  # the axes stay: a rest pose is baked
    T_world_joint[:, :3, 3] = places + lift
    return replace(
        asset,
        vertices=(vertices + lift).astype(np.float32),
        normals=normals,
        normal_map=asset.normal_map and turned_map(asset.normal_map, blended),
        skeleton=replace(skeleton, T_world_joint=T_world_joint, rest_rotations=from_t),
        animations=(),
        morphs=tuple(turned_shape(morph, blended) for morph in asset.morphs if morph.normals is not None),
    )


def turned_shape(shape: Morph, blended: Float64[np.ndarray, "W 3 3"]) -> Morph:
    """A face's shape, which moves no joint, as skinning turns it."""
    vertices, normals = (
        np.einsum("wab,wb->wa", blended, way.astype(np.float64)).astype(np.float32)
        for way in (shape.vertices, shape.normals)
        if way is not None
    )
    return replace(shape, vertices=vertices, normals=normals)


def turned(
    directions: Float32[np.ndarray, "W 3"], blended: Float64[np.ndarray, "W 3 3"]
) -> Float32[np.ndarray, "W 3"]:
    """Unit directions, turned as a viewer's skinning does."""
    found = np.einsum("wab,wb->wa", blended, directions.astype(np.float64))
    found /= np.maximum(np.linalg.norm(found, axis=1, keepdims=True), 1e-9)
    return found.astype(np.float32)


def turned_map(normal_map: NormalMap, blended: Float64[np.ndarray, "W 3 3"]) -> NormalMap:
    """The map with its tangents turned."""
    tangents = normal_map.tangents.copy()
    tangents[:, :3] = turned(tangents[:, :3], blended)
    return replace(normal_map, tangents=tangents)
