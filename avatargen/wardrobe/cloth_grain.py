"""Where prints lie: metres along and across the cloth at points of the canonical space.

Cloth is taken to hang straight down the body and along its arms, so stripes run as they do in sewn clothes,
and no garment needs a chart of its own: a collar, a placket and the shirt beneath them agree. On the torso
`along` is the height, `across` the way around an ellipse as wide and as deep as the body is at that height,
from the middle of front or back. On an arm they are the way from the middle of the body and the way around
from the top. Left and right, before and behind are alike, so nothing jumps but at the armholes, where sleeves
are sewn on.

Letters: N points, H heights, A angles. Metres.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Float64
from scipy.ndimage import gaussian_filter1d

from avatargen.body.model import CanonicalBody

TORSO = ("pelvis", "spine1", "spine2", "spine3", "left_collar", "right_collar")
STEP = 0.01  # m between heights at which the torso is measured
SMOOTH = 2.0  # heights that are blended
ANGLES = 49  # of a quarter turn at which the ellipse's length is known
THINNEST = 0.01  # m, half the depth of a torso at least
ARMHOLE_TILT = 0.1  # m that the armhole goes inward for each metre up
UNDER_SLEEVE = 2.0  # m outward for each metre down: what hangs below the armpit is the torso's
ARMPIT = 0.068  # m under the shoulder
SLEEVE = 0.055  # m from an arm's axis to its cloth


@dataclass(frozen=True, kw_only=True, eq=False)
class Grain:
    """The body's measures that places on cloth are told by."""

    low: float  # the first height
    centre: Float64[np.ndarray, " H"]  # z of the torso's middle
    wide: Float64[np.ndarray, " H"]  # half of its width
    deep: Float64[np.ndarray, " H"]  # half of its depth
    arc: Float64[np.ndarray, "H A"]  # way around from the middle of the front
    shoulder: Float64[np.ndarray, "3"]  # the left one

    def places(self, points: Float[np.ndarray, "N 3"]) -> Float64[np.ndarray, "N 2"]:
        """Metres along and across the cloth at canonical points."""
        points = np.asarray(points, dtype=np.float64)
        found = self.on_torso(points)
        sleeve = self.on_sleeve(points)
        found[sleeve] = self.along_arm(points[sleeve])
        return found

    def on_sleeve(self, points: Float64[np.ndarray, "N 3"]) -> Bool[np.ndarray, " N"]:
        """Whether points lie beyond the armholes."""
        up = points[:, 1] - (self.shoulder[1] - ARMPIT)
        out = np.abs(points[:, 0]) - self.shoulder[0]
        return out > np.where(up > 0, -ARMHOLE_TILT, -UNDER_SLEEVE) * up

    def on_torso(self, points: Float64[np.ndarray, "N 3"]) -> Float64[np.ndarray, "N 2"]:
        place = ((points[:, 1] - self.low) / STEP).clip(0, len(self.centre) - 1.001)
        level, between = place.astype(np.int64), place % 1
        centre, wide, deep = (
            table[level] * (1 - between) + table[level + 1] * between
            for table in (self.centre, self.wide, self.deep)
        )
        angle = np.arctan2(np.abs(points[:, 0]) / wide, np.abs(points[:, 2] - centre) / deep)
        step = (angle * ((ANGLES - 1) / (np.pi / 2))).clip(0, ANGLES - 1.001)
        low, share = step.astype(np.int64), step % 1
        across = sum(
            row_share * (self.arc[row, low] * (1 - share) + self.arc[row, low + 1] * share)
            for row, row_share in ((level, 1 - between), (level + 1, between))
        )
        return np.stack([points[:, 1], np.asarray(across)], axis=1)

    def along_arm(self, points: Float64[np.ndarray, "N 3"]) -> Float64[np.ndarray, "N 2"]:
        around = np.abs(np.arctan2(points[:, 2] - self.shoulder[2], points[:, 1] - self.shoulder[1]))
        return np.stack([np.abs(points[:, 0]), SLEEVE * around], axis=1)


def grain_of(body: CanonicalBody) -> Grain:
    """The measures of a canonical body in the X-pose with SMPL's joint names."""
    names = body.joint_names
    torso = body.weights[:, [names.index(name) for name in TORSO]].sum(axis=1)
    on_torso = body.vertices[torso > 0.5].astype(np.float64)
    low = float(body.joints[names.index("left_hip"), 1])
    top = float(body.joints[names.index("neck"), 1])
    heights = np.arange(low, top, STEP)
    rows = [on_torso[np.abs(on_torso[:, 1] - height) < STEP] for height in heights]
    middle, wide, deep = (
        gaussian_filter1d(np.array(values), SMOOTH, mode="nearest")
        for values in zip(*(measures(row) for row in rows), strict=True)
    )
    return Grain(
        low=low,
        centre=middle,
        wide=wide,
        deep=deep,
        arc=quarter_arcs(wide, deep),
        shoulder=body.joints[names.index("left_shoulder")].astype(np.float64),
    )


def measures(section: Float64[np.ndarray, "n 3"]) -> tuple[float, float, float]:
    """Middle in depth, half the width and half the depth of the torso at one height."""
    back, front = section[:, 2].min(), section[:, 2].max()
    wide = max(float(np.abs(section[:, 0]).max()), THINNEST)
    return float((front + back) / 2), wide, max(float((front - back) / 2), THINNEST)


def quarter_arcs(
    wide: Float64[np.ndarray, " H"], deep: Float64[np.ndarray, " H"]
) -> Float64[np.ndarray, "H A"]:
    """Ways along ellipses, from the end of their depth (angle 0) toward that of their width."""
    middle = (np.arange(ANGLES - 1) + 0.5) * (np.pi / 2) / (ANGLES - 1)
    speed = np.hypot(wide[:, None] * np.cos(middle), deep[:, None] * np.sin(middle))
    arc = np.zeros((len(wide), ANGLES))
    arc[:, 1:] = np.cumsum(speed * (np.pi / 2) / (ANGLES - 1), axis=1)
    return arc
