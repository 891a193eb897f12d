"""What a camera sees of triangles: the nearest one at each pixel, and the place on it.

Letters: F faces, H W pixels, C numbers a corner.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Float64, Int64

from avatargen.compiled import compiled
from avatargen.photo.camera import Pinhole

FLAT = 1e-9  # square pixels, at or under which a face is not seen


@dataclass(frozen=True, kw_only=True)
class Seen:
    """For each pixel the face (-1 for none), the place on it, and metres away (inf for none)."""

    face: Int64[np.ndarray, "H W"]
    barycentric: Float64[np.ndarray, "H W 3"]
    away: Float64[np.ndarray, "H W"]

    @property
    def mask(self) -> Bool[np.ndarray, "H W"]:
        return self.face >= 0

    def read(self, corners: Float[np.ndarray, "F 3 C"]) -> Float64[np.ndarray, "H W C"]:
        """Numbers of the faces' corners at each pixel; 0 where nothing is seen."""
        found, at = np.zeros((*self.face.shape, corners.shape[2])), self.mask
        found[at] = np.einsum("pk,pkc->pc", self.barycentric[at], corners[self.face[at]].astype(np.float64))
        return found


def look_at(vertices: Float[np.ndarray, "V 3"], faces: Int64[np.ndarray, "F 3"], camera: Pinhole) -> Seen:
    """The surface in the camera's space, as the camera sees it, from outside alone."""
    places, away = camera.see(vertices)
    shape = (camera.height, camera.width)
    face, barycentric = np.full(shape, -1, np.int64), np.zeros((*shape, 3))
    nearness = np.zeros(shape)
    draw(places[faces], 1 / away[faces], face, barycentric, nearness)
    with np.errstate(divide="ignore"):
        return Seen(face=face, barycentric=barycentric, away=1 / nearness)


@compiled
def draw(triangles, near, face, barycentric, nearness):
    """Fill in the nearest of `triangles` [F 3 2], pixels, whose corners are `near` [F 3], 1 over metres.

    `face` [H W], `barycentric` [H W 3] and `nearness` [H W] hold what was drawn before; places are right in
    perspective.
    """
    height, width = face.shape
    for t in range(len(triangles)):
        ax, ay = triangles[t, 0, 0], triangles[t, 0, 1]
        ux, uy = triangles[t, 1, 0] - ax, triangles[t, 1, 1] - ay
        vx, vy = triangles[t, 2, 0] - ax, triangles[t, 2, 1] - ay
        area = ux * vy - uy * vx
        if area > -FLAT:  # seen from inside: y grows downward here
            continue
        low_x = max(int(np.ceil(min(ax, ax + ux, ax + vx) - 0.5)), 0)
        high_x = min(int(np.floor(max(ax, ax + ux, ax + vx) - 0.5)), width - 1)
        low_y = max(int(np.ceil(min(ay, ay + uy, ay + vy) - 0.5)), 0)
        high_y = min(int(np.floor(max(ay, ay + uy, ay + vy) - 0.5)), height - 1)
        for row in range(low_y, high_y + 1):
            for column in range(low_x, high_x + 1):
                x, y = column + 0.5 - ax, row + 0.5 - ay
                b, c = (x * vy - y * vx) / area, (ux * y - uy * x) / area
                a = 1 - b - c
                if a < -1e-9 or b < -1e-9 or c < -1e-9:
                    continue
                here = a * near[t, 0] + b * near[t, 1] + c * near[t, 2]
                if here > nearness[row, column]:
                    nearness[row, column], face[row, column] = here, t
                    barycentric[row, column, 0] = a * near[t, 0] / here
                    barycentric[row, column, 1] = b * near[t, 1] / here
                    barycentric[row, column, 2] = c * near[t, 2] / here
