"""What a generator of dressed people has to wear, as meshes: a closed surface of each garment and hair.

A mesh stands in the canonical space and moves with the body beneath: to a shape and a pose as the body's
nearest point does. Letters: N vertices, V those of the body, F faces, J joints, b betas.
"""

from dataclasses import dataclass
from typing import Any

import igl
import numpy as np
from jaxtyping import Float32, Float64, Int64

from avatargen.body.model import CanonicalBody, forward_kinematics, from_rest_joints, pose_canonically, shape
from avatargen.body.pose import axis_angle_to_matrix
from avatargen.body.skinning import skin, unskin
from avatargen.dressed_avatar import DressedSampler
from avatargen.photo.figure import Cloud, Figure, tensor
from avatargen.photo.problem import Fit
from avatargen.wardrobe.colour_names import lab

CELL = 0.012  # m
MARGIN = 2  # cells about a garment
SHADE = np.array([0.47, 0.47, 0.47])  # sRGB of hair that is as bright as usual


@dataclass(frozen=True, kw_only=True, eq=False)
class Piece:
    """A garment, hair or the bare body. `color` is the artist's, CIELAB."""

    name: str
    kind: str
    vertices: Float32[np.ndarray, "N 3"]
    faces: Int64[np.ndarray, "F 3"]
    color: Float64[np.ndarray, "N 3"]


def body_piece(body: CanonicalBody) -> Piece:
    """The bare body, of one colour."""
    color = np.zeros((len(body.vertices), 3))
    return Piece(name="body", kind="skin", vertices=body.vertices, faces=body.faces, color=color)


def piece_of(sampler: DressedSampler, name: str) -> Piece:
    """A garment or hair by name."""
    ready = sampler.ready(name)
    volume, config = ready.volume, ready.config
    low = volume.low - MARGIN * CELL
    size = np.array(volume.index.shape) * 4 * volume.cell + 2 * MARGIN * CELL
    counts = np.ceil(size / CELL).astype(np.int64) + 1
    x, y, z = (low[axis] + CELL * np.arange(counts[axis]) for axis in range(3))
    # igl numbers nodes with x fastest
    grid = np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1).transpose(2, 1, 0, 3).reshape(-1, 3)
    distance, _ = volume.read(grid.astype(np.float32))
    columns, rows, layers = (int(count) for count in counts)
    cubes: Any = igl.marching_cubes  # whose types leave the level out
    vertices, faces = cubes(distance.astype(np.float64), grid, columns, rows, layers, 0.0)[:2]
    vertices = vertices.astype(np.float32)
    own = volume.colors(vertices)[:, :3]
    rgb = own if own.shape[1] == 3 else own * SHADE
    return Piece(
        name=name,
        kind=config.kind,
        vertices=vertices - sampler.offset,
        faces=outward(vertices, faces.astype(np.int64)),
        color=lab(rgb.clip(0, 1)),
    )


def outward(
    vertices: Float32[np.ndarray, "N 3"], faces: Int64[np.ndarray, "F 3"]
) -> Int64[np.ndarray, "F 3"]:
    """The faces, seen from outside counter-clockwise: a positive volume."""
    a, b, c = (vertices[faces[:, corner]].astype(np.float64) for corner in range(3))
    return faces if np.einsum("nd,nd->", a, np.cross(b, c)) > 0 else faces[:, ::-1]


class Dresser:
    """Moves pieces into a fitted body's shape and pose, in the camera's space."""

    def __init__(self, body: CanonicalBody) -> None:
        self.body = body
        self.T_canonical = pose_canonically(body.source).T_posed_rest

    def bind(self, points: Float32[np.ndarray, "N 3"], figure: Figure) -> Cloud:
        """Canonical points, as they move with a figure of the same body."""
        source, corners, bary, at_t = self.body.source, *self.at_rest(points)
        weights = np.einsum("nk,nkj->nj", bary, figure.body.weights[corners])
        directions = source.shapedirs[:, :, : figure.betas].astype(np.float64)
        return Cloud(
            points=tensor(at_t),
            directions=tensor(np.einsum("nk,nkdb->ndb", bary, directions[corners])),
            weights=tensor(weights),
        )

    def at_rest(
        self, points: Float32[np.ndarray, "N 3"]
    ) -> tuple[Int64[np.ndarray, "N 3"], Float64[np.ndarray, "N 3"], Float64[np.ndarray, "N 3"]]:
        """The nearest face of the body, the place on it, and the points in the T-pose at betas 0."""
        hit = self.body.distance.query(points.astype(np.float32))
        corners, barycentric = self.body.faces[hit.face], hit.barycentric.astype(np.float64)
        weights = np.einsum("nk,nkj->nj", barycentric, self.body.weights[corners])
        return corners, barycentric, unskin(points.astype(np.float64), weights, self.T_canonical)

    def move(self, points: Float32[np.ndarray, "N 3"], fit: Fit) -> Float64[np.ndarray, "N 3"]:
        """Canonical points, where they are on the person."""
        body, source = self.body, self.body.source
        corners, barycentric, at_t = self.at_rest(points)
        weights = np.einsum("nk,nkj->nj", barycentric, body.weights[corners])
        shaped = shape(source, fit.betas)
        grown = shaped.vertices - source.v_template
        at_t = at_t + np.einsum("nk,nkd->nd", barycentric, grown[corners])
        T_world = forward_kinematics(shaped.joints, axis_angle_to_matrix(fit.rotations), body.parents)
        T_world[:, :3, 3] += fit.move
        return skin(at_t, weights, from_rest_joints(T_world, shaped.joints))
