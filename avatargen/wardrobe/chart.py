"""Places around the body: what the wardrobe needs to know of a canonical point, computed once per point and
shared by all people.

The canonical body is the same for every person, so a fixed pool of points with these channels is an endless
supply of training points.
"""

from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

from avatargen.body.distance import BodyDistance
from avatargen.body.model import CanonicalBody

CLOSING = 0.04  # m: cloth bridges hollows narrower than twice this
SOLE = 0.022  # m below the foot
HIP_SPREAD = 0.4  # rad, of the X-pose
FACE_LIFT = 0.0097  # m, of shoulders and face over where the measures were taken


def tailor(p: Float[Tensor, "*n 3"]) -> tuple[Tensor, Tensor, Tensor]:
    """x, y, z in the frame the wardrobe's measures were taken in: shoulders at 0.468 m, eyes at
    0.7114 m, hips unmoved.
    """
    x, y, z = p.unbind(-1)
    return x, y - FACE_LIFT * ((y - 0.15) / 0.3).clamp(0, 1), z


@dataclass(frozen=True, kw_only=True)
class Places:
    """Points with their static channels. Leading shape is [B N] or [N]."""

    p: Float[Tensor, "*n 3"]  # canonical position, m
    body: Float[Tensor, "*n"]  # signed distance to the body, m
    closed: Float[Tensor, "*n"]  # signed distance to the body's morphological closing, m
    shod: Float[Tensor, "*n"]  # the same closing, swept downward by the sole, m
    leg: Float[
        Tensor, "*n 3"
    ]  # position in the left leg's own T-pose frame, mirrored for the right one, from the hip, m
    eye: Float[Tensor, "*n"]  # 1 on the eyeballs, 0 elsewhere
    corners: Int[Tensor, "*n 3"]  # the body vertices of the closest face
    barycentric: Float[Tensor, "*n 3"]  # of the closest point in it

    def __getitem__(self, index: Tensor | tuple[Tensor, ...] | None) -> "Places":
        return Places(**{f.name: getattr(self, f.name)[index] for f in fields(self)})

    def for_people(self, count: int) -> "Places":
        """[1 N] places repeated for every person, without copying."""
        return Places(
            **{f.name: (c := getattr(self, f.name)).expand(count, *c.shape[1:]) for f in fields(self)}
        )


def dilated_surface(body: BodyDistance, bounds: Float[np.ndarray, "2 3"], spacing: float) -> BodyDistance:
    """Distance to the surface CLOSING outside the body, as a mesh of about `spacing` metres."""
    import skimage.measure

    axes = [np.arange(bounds[0, i] - 0.08, bounds[1, i] + 0.08 + spacing, spacing) for i in range(3)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    distance = body.query(grid.reshape(-1, 3).astype(np.float32)).distance.reshape(grid.shape[:3])
    vertices, faces, _, _ = skimage.measure.marching_cubes(distance, CLOSING, spacing=(spacing,) * 3)
    return BodyDistance((vertices + [a[0] for a in axes]).astype(np.float32), faces.astype(np.int64))


class Chart:
    """Computes `Places` for any canonical points."""

    def __init__(self, body: CanonicalBody, marks: Path, spacing: float = 0.008) -> None:
        self.body = body
        self.distance = body.distance
        self.dilated = dilated_surface(
            self.distance, np.stack([body.vertices.min(0), body.vertices.max(0)]), spacing
        )
        with np.load(marks, allow_pickle=False) as file:
            self.eye_vertices = file["eye_vertices"].astype(np.float32)
        self.left_hip = body.joints[body.joint_names.index("left_hip")]

    def closing(self, points: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, " N"]:
        """Signed distance to the body's closing by a ball of CLOSING, m."""
        return self.dilated.query(points).distance + CLOSING

    def leg_frame(self, points: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, "N 3"]:
        """Points as the left leg's T-pose sees them; the right side is mirrored."""
        c, s = np.cos(HIP_SPREAD), np.sin(HIP_SPREAD)
        q = np.stack([np.abs(points[:, 0]), points[:, 1], points[:, 2]], axis=1) - self.left_hip
        return np.stack([c * q[:, 0] + s * q[:, 1], -s * q[:, 0] + c * q[:, 1], q[:, 2]], axis=1).astype(
            np.float32
        )

    def places(self, points: Float[np.ndarray, "N 3"]) -> Places:
        """All channels of the given canonical points, metres."""
        points = np.ascontiguousarray(points, dtype=np.float32)
        hit = self.distance.query(points)
        corners = self.body.faces[hit.face]
        leg = self.leg_frame(points)
        closed = self.closing(points)
        shod = closed.copy()
        feet = np.flatnonzero((leg[:, 1] < -0.75) & (points[:, 1] < -0.5))
        side = np.sign(points[feet, :1])
        up = np.concatenate(
            [-side * np.sin(HIP_SPREAD), np.full_like(side, np.cos(HIP_SPREAD)), 0 * side], axis=1
        )
        for fraction in (0.5, 1.0):
            shod[feet] = np.minimum(
                shod[feet], self.closing(points[feet] + fraction * SOLE * up.astype(np.float32))
            )
        channels = {
            "p": points,
            "body": hit.distance,
            "closed": closed,
            "shod": shod,
            "leg": leg,
            "eye": (self.eye_vertices[corners] * hit.barycentric).sum(1),
            "corners": corners,
            "barycentric": hit.barycentric,
        }
        return Places(
            **{name: torch.from_numpy(np.ascontiguousarray(value)) for name, value in channels.items()}
        )
