"""Bodies built in code: a closed capsule figure with SMPL's 24 joints, and SMPL-sized random ones."""

import functools

import igl
import numpy as np
from scipy.spatial import KDTree

from avatargen.body.joints import SMPL_JOINT_NAMES
from avatargen.body.model import Body

SMPL_PARENTS = np.array([-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19, 20, 21])
SMPL_JOINTS = np.array(
    """
    0 .9 0; .07 .85 0; -.07 .85 0; 0 1 0; .08 .48 0; -.08 .48 0; 0 1.12 0; .09 .09 0; -.09 .09 0; 0 1.2 0
    .1 .04 .1; -.1 .04 .1; 0 1.4 0; .06 1.34 0; -.06 1.34 0; 0 1.5 0; .17 1.36 0; -.17 1.36 0
    .42 1.36 0; -.42 1.36 0; .66 1.36 0; -.66 1.36 0; .74 1.36 0; -.74 1.36 0
""".replace(";", " ").split(),
    dtype=np.float64,
).reshape(24, 3)


def segment_distance(points: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Distance of each point to a segment."""
    axis = end - start
    along = np.clip((points - start) @ axis / max(axis @ axis, 1e-12), 0, 1)
    return np.linalg.norm(points - start - along[:, None] * axis, axis=1)


@functools.cache
def capsule_mesh(spacing: float = 0.03) -> tuple[np.ndarray, np.ndarray]:
    """A closed surface around the bones, by marching cubes at `spacing` metres."""
    low, high = SMPL_JOINTS.min(0) - 0.2, SMPL_JOINTS.max(0) + 0.2
    axes = [np.arange(low[d], high[d], spacing) for d in range(3)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    grid = np.ascontiguousarray(grid.transpose(2, 1, 0, 3)).reshape(-1, 3)  # x runs fastest
    radii = np.where(np.isin(np.arange(24), [0, 3, 6, 9, 15]), 0.11, 0.06)
    distance = np.min(
        [
            segment_distance(grid, SMPL_JOINTS[p], SMPL_JOINTS[j]) - radii[j]
            for j, p in enumerate(SMPL_PARENTS)
            if p >= 0
        ],
        axis=0,
    )
    vertices, faces, _ = igl.marching_cubes(distance, grid, *map(len, axes))
    return np.asarray(vertices), np.asarray(faces)


@functools.cache
def capsule_body(spacing: float = 0.03, pose_blend: bool = False) -> Body:
    """A capsule figure in the T-pose with smooth weights and ten smooth shape directions."""
    return body_on(*capsule_mesh(spacing), pose_blend=pose_blend)


def body_on(vertices: np.ndarray, faces: np.ndarray, pose_blend: bool) -> Body:
    """A body with SMPL's joints over any vertices."""
    rng = np.random.default_rng(7)
    nearness = np.exp(-(np.linalg.norm(vertices[:, None] - SMPL_JOINTS, axis=2) ** 2) / 0.02) + 1e-9
    weights = nearness / nearness.sum(axis=1, keepdims=True)
    regressor = np.zeros((24, len(vertices)))
    nearest = np.asarray(KDTree(vertices).query(SMPL_JOINTS, k=16)[1])
    np.put_along_axis(regressor, nearest, 1 / 16, axis=1)
    shapedirs = np.einsum("vi,ijb->vjb", np.sin(vertices * 3 + 1), rng.normal(size=(3, 3, 10))) * 0.01
    posedirs = rng.normal(size=(len(vertices), 3, 207)) * 1e-3
    return Body(
        v_template=vertices.astype(np.float32),
        faces=faces.astype(np.int64),
        weights=weights.astype(np.float32),
        parents=SMPL_PARENTS.astype(np.int64),
        joint_names=SMPL_JOINT_NAMES,
        J_regressor=regressor.astype(np.float32),
        shapedirs=shapedirs.astype(np.float32),
        posedirs=posedirs.astype(np.float32) if pose_blend else None,
    )


@functools.cache
def smpl_like_mesh() -> tuple[np.ndarray, np.ndarray]:
    """A closed mesh of exactly 6,890 vertices: the capsule figure with faces split at their centres."""
    vertices, faces = capsule_mesh()
    extra = 6890 - len(vertices)
    centers = vertices[faces[:extra]].mean(axis=1)
    new = len(vertices) + np.arange(extra)
    a, b, c = faces[:extra].T
    split = np.concatenate([np.stack(s, axis=1) for s in ((a, b, new), (b, c, new), (c, a, new))])
    return np.concatenate([vertices, centers]), np.concatenate([split, faces[extra:]])


def smpl_like_arrays(posedirs: bool = True) -> dict[str, np.ndarray]:
    """The arrays of an SMPL file by their keys and types, on a closed figure of 6,890 vertices."""
    body = smpl_like_body()
    table = np.stack([body.parents, np.arange(24)]) % 2**32
    arrays = {
        "v_template": body.v_template.astype(np.float64),
        "f": body.faces.astype(np.uint32),
        "weights": body.weights.astype(np.float64),
        "kintree_table": table.astype(np.int64),
        "J_regressor": body.J_regressor.astype(np.float64),
        "shapedirs": body.shapedirs.astype(np.float64),
    }
    if posedirs and body.posedirs is not None:
        arrays["posedirs"] = body.posedirs.astype(np.float64)
    return arrays


@functools.cache
def smpl_like_body() -> Body:
    return body_on(*smpl_like_mesh(), pose_blend=True)
