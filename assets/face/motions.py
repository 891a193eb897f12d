"""Motions of a face that no unit has: the jaw to the side, cheeks, lips that roll and meet, a tongue, eyes
and lids; as displacements of an open face in canonical space.

Letters: V welded vertices. Metres; the person's left is +x.
"""

from collections.abc import Callable

import numpy as np
from jaxtyping import Bool, Float64, Int64

from assets.face.curves import FRONT
from assets.face.falloff import bell, smooth
from assets.face.names import JAW_OPEN
from assets.face.opened import OpenFace

JAW = 0.035  # m that the chin goes when the mouth opens
CHEEK, CHEEKBONE = np.array([0.043, 0.655]), np.array([0.036, 0.69])
GAZE = np.array([0.0036, 0.0024])  # m that an iris goes to the side, and up or down
BEHIND_LIDS = 0.003  # m that an eye draws back behind closed lids
LID = 0.006  # m of lid that goes with its margin
UPPER_SHARE = 0.2  # of the way between the lids' margins at which they meet, from below

KNOTS = 9  # of the line along which the lids meet: fewer than vertices, so that both follow it closely


class Motions:
    """Every unit and every made motion of one face by its name."""

    def __init__(self, face: OpenFace, own: Float64[np.ndarray, "V 3"]) -> None:
        """`own` are the places of the person's own face, as large and upright as the canonical one."""
        self.face, self.at, self.own = face, face.places, own
        self.skin = len(face.mesh.points)
        kinds = np.concatenate(
            [np.zeros(len(face.inside.source) - len(face.units.inner), int), face.units.kinds]
        )
        self.kind = np.concatenate([np.full(self.skin, -1), kinds])  # -1 skin, then as in the units
        self.front = smooth(self.at[:, 2], FRONT - 0.02, FRONT + 0.01) * (self.kind < 0)
        self.over = face.curves.above_lips(self.at)
        self.lips = np.hypot(
            self.over, np.maximum(np.abs(self.at[:, 0]) - face.curves.lips[-1, 0], 0)
        )  # distance to their line
        self.made: dict[str, Callable[[], Float64[np.ndarray, "V 3"]]] = {
            "jaw-forward": lambda: self.meeting(self.jaw()[:, None] * [0, 0, 0.006]),
            "jaw-left": lambda: self.meeting(self.jaw()[:, None] * [0.008, 0, 0]),
            "mouth-left": lambda: self.near_lips(0.024)[:, None] * [0.009, 0, 0],
            "roll": self.roll,
            "shrug-lower": lambda: self.near_lips(0.016, -0.008)[:, None] * [0, 0.0045, 0.002],
            "shrug-upper": lambda: self.near_lips(0.013, 0.006)[:, None] * [0, 0.0035, 0.002],
            "cheek": lambda: self.spot(CHEEKBONE, 0.014)[:, None] * [0, 0.004, 0.002],
            "puff": self.puff,
            "tongue-out": lambda: self.tongue(0.06, 0.115)[:, None] * [0, -0.003, 0.036],
            "tongue-up": lambda: self.tongue(0.085, 0.125)[:, None] * [0, 0.007, 0],
            "press": lambda: self.meeting(0.45 * face.unit("mouth-compression")),
            "close": self.close,
        }
        for eye, side in enumerate(("left", "right")):
            outward = 1 if side == "left" else -1
            for name, way in (
                ("out", (outward, 0)),
                ("in", (-outward, 0)),
                ("up", (0, 1)),
                ("down", (0, -1)),
            ):
                self.made[f"look-{side}-{name}"] = lambda eye=eye, way=way: self.look(
                    eye, np.array(way, np.float64)
                )
            self.made[f"blink-{side}"] = lambda eye=eye, side=side: self.blink(eye, side)

    def named(self, name: str) -> Float64[np.ndarray, "V 3"]:
        """A unit's or a made motion's displacements, canonical."""
        return self.made[name]() if name in self.made else self.face.unit(name)

    def jaw(self) -> Float64[np.ndarray, " V"]:
        """How much of the jaw's motion a vertex has."""
        return np.clip(np.linalg.norm(self.face.unit("mouth-open"), axis=1) / JAW, 0, 1)

    def near_lips(self, width: float, over: float = 0.0) -> Float64[np.ndarray, " V"]:
        across = np.maximum(np.abs(self.at[:, 0]) - 0.015, 0)
        fade = smooth(self.at[:, 2], 0.09, 0.12)
        return bell(np.hypot(self.over - over, across), width) * fade * (self.kind < 1)

    def spot(self, centre: Float64[np.ndarray, "2"], width: float) -> Float64[np.ndarray, " V"]:
        """A place on each cheek."""
        off = np.stack([np.abs(self.at[:, 0]), self.at[:, 1]], axis=1) - centre
        return bell(np.linalg.norm(off, axis=1), width) * self.front

    def puff(self) -> Float64[np.ndarray, "V 3"]:
        share = self.spot(CHEEK, 0.017)
        return share[:, None] * np.stack(
            [0.007 * np.sign(self.at[:, 0]), np.zeros(len(share)), np.full(len(share), 0.005)], axis=1
        )

    def roll(self) -> Float64[np.ndarray, "V 3"]:
        share = bell(self.lips, 0.0075) * smooth(self.at[:, 2], 0.12, 0.135) * (self.kind <= 0)
        back = np.full(len(share), -0.004)
        return share[:, None] * np.stack([np.zeros(len(share)), -0.5 * self.over, back], axis=1)

    def tongue(self, low: float, high: float) -> Float64[np.ndarray, " V"]:
        return smooth(self.at[:, 2], low, high) * (self.kind == 3)

    def meeting(self, moved: Float64[np.ndarray, "V 3"]) -> Float64[np.ndarray, "V 3"]:
        """A motion, and what makes the rims of the lips meet after it."""
        face = self.face
        gap = moved[face.upper] - moved[face.lower]
        x = self.at[face.upper, 0]
        at = np.stack([np.interp(self.at[:, 0], x, gap[:, k]) for k in range(3)], axis=1)
        fade = smooth(self.at[:, 2], 0.11, 0.135) * (self.kind <= 0)
        share = np.where(self.upper_side(), -0.35 * bell(self.lips, 0.010), 0.65 * bell(self.lips, 0.018))
        found = moved + (share * fade)[:, None] * at
        middle = 0.65 * moved[face.upper] + 0.35 * moved[face.lower]
        found[face.upper] = found[face.lower] = middle
        return found

    def close(self) -> Float64[np.ndarray, "V 3"]:
        """What makes the lips of an open jaw meet."""
        opened = JAW_OPEN * self.face.unit("mouth-open")
        return self.meeting(opened) - opened

    def upper_side(self) -> Bool[np.ndarray, " V"]:
        return np.concatenate([self.face.above, self.over[self.skin :] > 0])

    def inside_eye(self, eye: int) -> tuple[Int64[np.ndarray, " N"], Float64[np.ndarray, " N"]]:
        """Vertices of the skin on an eye, its margin left out, and how far within each lies."""
        off = self.face.curves.outside(self.at[: self.skin], eye)
        vertex = np.flatnonzero((off < -3e-4) & (self.at[: self.skin, 2] > FRONT))
        return vertex, -off[vertex]

    def look(self, eye: int, way: Float64[np.ndarray, "2"]) -> Float64[np.ndarray, "V 3"]:
        """An eye's picture slid over its ball: the most in the middle, nothing at the lids."""
        vertex, within = self.inside_eye(eye)
        centre, radius = self.face.units.balls[eye, :3], self.face.units.balls[eye, 3]
        step = smooth(within, 0.0, 0.003)[:, None] * (GAZE * way)
        off = self.at[vertex, :2] - centre[:2]
        depth = [np.sqrt(np.maximum(radius**2 - (o**2).sum(axis=1), 1e-5)) for o in (off, off + step)]
        moved = np.zeros_like(self.at)
        moved[vertex, :2], moved[vertex, 2] = step, depth[1] - depth[0]
        return moved

    def margins(self, eye: int) -> tuple[Int64[np.ndarray, " U"], Int64[np.ndarray, " L"]]:
        """The skin's vertices on the margin of the upper and of the lower lid, by x."""
        skin = self.at[: self.skin]
        rim = np.flatnonzero((np.abs(self.face.curves.outside(skin, eye)) < 3e-4) & (skin[:, 2] > FRONT))
        loop = self.face.curves.lids[eye]
        ends = loop[[loop[:, 0].argmin(), loop[:, 0].argmax()]]
        over = skin[rim, 1] > np.interp(skin[rim, 0], ends[:, 0], ends[:, 1])
        upper, lower = rim[over], rim[~over]
        return upper[np.argsort(skin[upper, 0])], lower[np.argsort(skin[lower, 0])]

    def blink(self, eye: int, side: str) -> Float64[np.ndarray, "V 3"]:
        """The unit that closes the lids, so that their margins meet and the eye lies behind them."""
        moved, at, own = self.face.unit(f"eye-{side}-closure"), self.at, self.own
        upper, lower = self.margins(eye)

        def along(rim: Int64[np.ndarray, " N"], values: np.ndarray, x: np.ndarray) -> np.ndarray:
            return np.stack([np.interp(x, at[rim, 0], values[rim, k]) for k in range(3)], axis=1)

        x = at[:, 0]
        knots = np.linspace(at[lower[0], 0], at[lower[-1], 0], KNOTS)
        line = UPPER_SHARE * along(upper, own, knots) + (1 - UPPER_SHARE) * along(lower, own, knots)
        meet = np.stack([np.interp(x, knots, line[:, k]) for k in range(3)], axis=1)
        rim = np.concatenate([upper, lower])
        centre, radius = self.face.units.balls[eye, :3], self.face.units.balls[eye, 3]
        centre = centre + (own[rim] - at[rim]).mean(axis=0)
        ball = centre[2] + np.sqrt(np.maximum(radius**2 - ((meet[:, :2] - centre[:2]) ** 2).sum(axis=1), 0))
        meet[:, 2] = np.maximum(meet[:, 2], np.minimum(ball, meet[:, 2] + 0.004))
        goal = meet - own
        off = self.face.curves.outside(at[: self.skin], eye)
        over = own[: self.skin, 1] > meet[: self.skin, 1]
        rims = [along(rim, goal - moved, x)[: self.skin] for rim in (upper, lower)]
        near = (bell(np.maximum(off, 0), LID) * (at[: self.skin, 2] > FRONT))[:, None]
        found = moved.copy()
        found[: self.skin] += near * np.where(over[:, None], rims[0], rims[1])
        found[rim] = goal[rim]
        inside, within = self.inside_eye(eye)
        found[inside] = goal[inside] - smooth(within, 0.0, 0.002)[:, None] * [0, 0, BEHIND_LIDS]
        return found
