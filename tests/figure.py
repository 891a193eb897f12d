"""A rigged person built in code: the capsule figure with SMPL's joints, in the T-pose, on the ground."""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from assets.asset.asset import Asset, AssetInfo
from assets.asset.rig import Animation, Morph, Skeleton
from assets.mesh.surface import Surface, vertex_normals
from assets.skin.skin import limit_influences
from tests.bodies import SMPL_JOINTS, capsule_body
from tests.tube import checker, mapped


def figure(spacing: float = 0.06, size: int = 64) -> Asset:
    """A few hundred vertices; its texture is laid on from the front, with a normal map."""
    body = capsule_body(spacing)
    vertices = body.v_template.astype(np.float64)
    lift = np.array([0.0, -vertices[:, 1].min(), 0.0])
    T_world_joint = np.tile(np.eye(4), (len(body.parents), 1, 1))
    T_world_joint[:, :3, 3] = SMPL_JOINTS + lift
    low, high = vertices[:, :2].min(axis=0), vertices[:, :2].max(axis=0)
    skin = limit_influences(body.weights)
    plain = Asset(
        vertices=(vertices + lift).astype(np.float32),
        normals=vertex_normals(Surface(vertices=vertices, faces=body.faces)).astype(np.float32),
        faces=body.faces.copy(),
        info=AssetInfo(seed=3, weights_hash="0" * 64, version="0.1.0", licence="CC0-1.0"),
        uv=((vertices[:, :2] - low) / (high - low) * [1, -1] + [0, 1]).clip(0, 1).astype(np.float32),
        texture=checker(size),
        joints=skin.joints,
        weights=skin.weights,
        skeleton=Skeleton(joint_names=body.joint_names, parents=body.parents, T_world_joint=T_world_joint),
    )
    return mapped(plain)


def in_motion(asset: Asset, frames: int = 4) -> Asset:
    """The asset with two random clips at 30 frames a second and a morph that stretches it upwards."""
    rng = np.random.default_rng(0)
    joint_count, times = len(asset.skeleton.parents), np.arange(frames) / 30
    clips = []
    for name in ("mesh", "walk it"):
        angles = rng.uniform(-0.3, 0.3, (frames * joint_count, 3))
        turns = Rotation.from_rotvec(angles).as_quat(canonical=True)
        root = asset.skeleton.joints[0] + rng.uniform(-0.1, 0.1, (frames, 3))
        clips.append(
            Animation(name=name, times=times, rotations=turns.reshape(frames, joint_count, 4), root=root)
        )
    up = (asset.vertices * [0, 0.1, 0]).astype(np.float32)
    morph = Morph(name="taller", vertices=up, joints=asset.skeleton.joints * [0, 0.1, 0])
    return replace(asset, animations=tuple(clips), morphs=(morph,))


def without_weight_on(asset: Asset, *idle: int) -> Asset:
    """The asset with the weights of these joints on others."""
    weights = np.where(np.isin(asset.joints, idle), 0, asset.weights)
    weights[:, 0] += 1e-3
    weights = (weights / weights.sum(axis=1, keepdims=True)).astype(np.float32)
    return replace(asset, joints=np.where(np.isin(asset.joints, idle), 0, asset.joints), weights=weights)
