"""A rigged tube built in code: the smallest asset that has everything an avatar has."""

from dataclasses import replace

import numpy as np

from assets.asset.asset import Asset, AssetInfo, Skeleton
from assets.mesh.surface import Surface
from assets.texture.normal_map import NormalMap
from assets.texture.tangents import find_tangents

RADIUS, LENGTH = 0.1, 1.0


def rotation_z(angle: float) -> np.ndarray:
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])


def chain(joint_count: int, tilt: float = 0.0) -> Skeleton:
    """Joints evenly along +y from the origin, each turned by `tilt` radians about z against its parent."""
    T_world_joint = np.tile(np.eye(4), (joint_count, 1, 1))
    for joint in range(joint_count):
        T_world_joint[joint, :3, :3] = rotation_z(tilt * (joint + 1))
        T_world_joint[joint, 1, 3] = LENGTH * joint / joint_count
    names = ("pelvis", "spine1", *(f"spine{i}" for i in range(2, joint_count)))[:joint_count]
    return Skeleton(joint_names=names, parents=np.arange(joint_count) - 1, T_world_joint=T_world_joint)


def checker(size: int) -> np.ndarray:
    """A texture whose corners differ and whose texels are known: red grows right, green grows down."""
    ramp = np.linspace(0, 255, size).astype(np.uint8)
    red, green = np.meshgrid(ramp, ramp)
    blue = ((np.indices((size, size)) // 8).sum(axis=0) % 2 * 255).astype(np.uint8)
    return np.stack([red, green, blue], axis=-1)


def mapped(asset: Asset, size: int = 32) -> Asset:
    """The asset with a normal map of round studs, dark in between."""
    place = (np.arange(size) + 0.5) % 8 / 4 - 1
    x, y = np.meshgrid(place, -place)
    stud = np.stack([x, y, np.sqrt(np.maximum(1 - x**2 - y**2, 0.2))], axis=-1)
    stud /= np.linalg.norm(stud, axis=-1, keepdims=True)
    surface = Surface(vertices=asset.vertices.astype(np.float64), faces=asset.faces)
    tangents = find_tangents(surface, asset.normals.astype(np.float64), asset.uv.astype(np.float64))
    texels = np.rint(127.5 * (stud + 1)).astype(np.uint8)
    return replace(asset, normal_map=NormalMap(texels=texels, tangents=tangents), occlusion=texels[..., 2])


def tube(rings: int = 12, sides: int = 16, joint_count: int = 2, size: int = 64, tilt: float = 0.0) -> Asset:
    """A closed tube along +y whose side has a uv seam: `sides + 1` columns, the last on top of the first.

    The caps are fans around a middle vertex. Weights blend between the two nearest joints.
    """
    u, v = np.meshgrid(np.linspace(0, 1, sides + 1), np.linspace(0, 1, rings))
    angle = 2 * np.pi * (u % 1)
    outward = np.stack([np.cos(angle), np.zeros_like(angle), -np.sin(angle)], axis=-1)
    side = RADIUS * outward + np.stack([np.zeros_like(v), LENGTH * v, np.zeros_like(v)], axis=-1)
    vertices = np.concatenate([side.reshape(-1, 3), [[0, 0, 0], [0, LENGTH, 0]]])
    normals = np.concatenate([outward.reshape(-1, 3), [[0, -1, 0], [0, 1, 0]]])
    uv = np.concatenate([np.stack([u, v], axis=-1).reshape(-1, 2), [[0.5, 0], [0.5, 1]]])
    joints, weights = blend(vertices[:, 1] / LENGTH * joint_count - 0.5, joint_count)
    return Asset(
        vertices=vertices.astype(np.float32),
        normals=normals.astype(np.float32),
        uv=uv.astype(np.float32),
        faces=tube_faces(rings, sides),
        joints=joints,
        weights=weights,
        texture=checker(size),
        skeleton=chain(joint_count, tilt),
        info=AssetInfo(seed=3, weights_hash="0" * 64, version="0.1.0", licence="CC0-1.0", betas=(0.5, -1.25)),
    )


def welded(asset: Asset) -> Asset:
    """The asset knowing which of its vertices stand in one place."""
    _, number = np.unique(asset.vertices.round(6), axis=0, return_inverse=True)
    return replace(asset, welded=number.reshape(-1).astype(np.int64))


def tube_faces(rings: int, sides: int) -> np.ndarray:
    row, column = np.meshgrid(np.arange(rings - 1), np.arange(sides), indexing="ij")
    corner = (row * (sides + 1) + column).ravel()
    above = corner + sides + 1
    around = np.arange(sides)
    top, bottom, last = rings * (sides + 1) + 1, rings * (sides + 1), (rings - 1) * (sides + 1)
    return np.concatenate(
        [
            np.stack([corner, corner + 1, above + 1], axis=1),
            np.stack([corner, above + 1, above], axis=1),
            np.stack([around + 1, around, np.full(sides, bottom)], axis=1),
            np.stack([last + around, last + around + 1, np.full(sides, top)], axis=1),
        ]
    )


def blend(position: np.ndarray, joint_count: int) -> tuple[np.ndarray, np.ndarray]:
    """Two influences per vertex, heaviest first, for a place along the chain in joints; the rest empty."""
    position = np.clip(position, 0, joint_count - 1)
    lower = np.minimum(np.floor(position).astype(np.int64), max(joint_count - 2, 0))
    upper_weight = position - lower
    pair = np.stack([lower, np.minimum(lower + 1, joint_count - 1)], axis=1)
    share = np.stack([1 - upper_weight, upper_weight], axis=1)
    order = np.argsort(-share, axis=1, kind="stable")
    pair, share = np.take_along_axis(pair, order, axis=1), np.take_along_axis(share, order, axis=1)
    joints = np.pad(np.where(share > 0, pair, 0), ((0, 0), (0, 2)))
    return joints, np.pad(share, ((0, 0), (0, 2))).astype(np.float32)
