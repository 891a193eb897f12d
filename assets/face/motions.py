"""Motions of a face that no unit has: the jaw to the side, cheeks, lips that roll and meet, a tongue, eyes
and lids; as displacements of an open face in canonical space.

Letters: V welded vertices. Metres; the person's left is +x.
"""

from collections.abc import Callable

import numpy as np
from jaxtyping import Bool, Float64, Int64
from scipy.spatial.transform import Rotation

from assets.face.curves import FRONT
from assets.face.eyes import Eyes
from assets.face.falloff import bell
from assets.face.names import JAW_OPEN
from assets.face.opened import OpenFace
from assets.face.soften import towards_neighbours
from avatargen.smoothstep import smoothstep

JAW = 0.035  # m that the chin goes when the mouth opens
CHEEK, CHEEKBONE = np.array([0.043, 0.655]), np.array([0.036, 0.69])
GAZE = np.radians([26.0, 20.0])  # that an eye turns to the side, and up or down
CLEAR = 5e-4  # m that lids keep before an eyeball
NEAR_EYE = 0.012  # m around a margin that may run into the ball
LID = 0.012  # m of lid that goes with its margin
MEET = 0.2  # of the way between the lids' margins at which they meet, from below; half way at the corners
SOFTENED = 12  # rounds of smoothing a motion of lips or lids
AROUND_LIPS = 0.02  # m where it is smoothed
KNOTS, BENDS = 17, 4  # of the line along which the lids meet, and its degree: no lid is smooth at rest


class Motions:
    """Every unit and every made motion of one face by its name."""

    def __init__(self, face: OpenFace, eyes: Eyes, own: Float64[np.ndarray, "K 3"]) -> None:
        """`own` are the places of the person's own face but for the eyes', as large and upright as the
        canonical one."""
        self.face, self.eyes = face, eyes
        self.at = np.concatenate([face.places, eyes.canonical(face)])
        self.own = np.concatenate([own, eyes.places])
        self.skin = len(face.mesh.points)
        kinds = np.concatenate(
            [np.zeros(len(face.inside.source) - len(face.units.inner), int), face.units.kinds]
        )
        self.beside = [  # each eye
            np.flatnonzero(face.curves.outside(face.mesh.points, eye) < NEAR_EYE) for eye in (0, 1)
        ]
        # -1 skin, then as in the units, then as the eyes'
        self.kind = np.concatenate([np.full(self.skin, -1), kinds, eyes.kinds])
        self.front = smoothstep(self.at[:, 2], FRONT - 0.02, FRONT + 0.01) * (self.kind < 0)
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
            "press": lambda: self.meeting(0.45 * self.unit("mouth-compression")),
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
            self.made[f"blink-{side}"] = lambda eye=eye: self.blink(eye)

    def named(self, name: str) -> Float64[np.ndarray, "V 3"]:
        """A unit's or a made motion's displacements, canonical."""
        return self.made[name]() if name in self.made else self.unit(name)

    def unit(self, name: str) -> Float64[np.ndarray, "V 3"]:
        """A unit's displacements, which move no eye."""
        return np.concatenate([self.face.unit(name), np.zeros((len(self.eyes.places), 3))])

    def jaw(self) -> Float64[np.ndarray, " V"]:
        """How much of the jaw's motion a vertex has."""
        return np.clip(np.linalg.norm(self.unit("mouth-open"), axis=1) / JAW, 0, 1)

    def near_lips(self, width: float, over: float = 0.0) -> Float64[np.ndarray, " V"]:
        across = np.maximum(np.abs(self.at[:, 0]) - 0.015, 0)
        fade = smoothstep(self.at[:, 2], 0.09, 0.12)
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
        share = bell(self.lips, 0.0075) * smoothstep(self.at[:, 2], 0.12, 0.135) * (self.kind <= 0)
        back = np.full(len(share), -0.004)
        return share[:, None] * np.stack([np.zeros(len(share)), -0.5 * self.over, back], axis=1)

    def tongue(self, low: float, high: float) -> Float64[np.ndarray, " V"]:
        return smoothstep(self.at[:, 2], low, high) * (self.kind == 3)

    def meeting(self, moved: Float64[np.ndarray, "V 3"]) -> Float64[np.ndarray, "V 3"]:
        """A motion, and what makes the rims of the lips meet after it."""
        face = self.face
        gap = moved[face.upper] - moved[face.lower]
        x = self.at[face.upper, 0]
        at = np.stack([np.interp(self.at[:, 0], x, gap[:, k]) for k in range(3)], axis=1)
        fade = smoothstep(self.at[:, 2], 0.11, 0.135) * (self.kind <= 0)
        share = np.where(self.upper_side(), -0.35 * bell(self.lips, 0.010), 0.65 * bell(self.lips, 0.018))
        found = moved + (share * fade)[:, None] * at
        middle = 0.65 * moved[face.upper] + 0.35 * moved[face.lower]
        found[face.upper] = found[face.lower] = middle
        near = (self.lips[: self.skin] < AROUND_LIPS) & (self.at[: self.skin, 2] > FRONT)
        found[: self.skin] = self.softened(found[: self.skin], near, np.append(face.upper, face.lower))
        return found

    def softened(
        self,
        moved: Float64[np.ndarray, "S C"],
        near: Bool[np.ndarray, " S"],
        fixed: Int64[np.ndarray, " N"],
    ) -> Float64[np.ndarray, "S C"]:
        """What the skin's vertices move by, made smooth somewhere but for some of them."""
        share = near.astype(np.float64)
        share[fixed] = 0
        step = towards_neighbours(self.face.mesh, share)
        for _ in range(SOFTENED):
            moved = step @ moved
        return moved

    def close(self) -> Float64[np.ndarray, "V 3"]:
        """What makes the lips of an open jaw meet."""
        opened = JAW_OPEN * self.unit("mouth-open")
        return self.meeting(opened) - opened

    def upper_side(self) -> Bool[np.ndarray, " V"]:
        return np.concatenate([self.face.above, self.over[self.skin :] > 0])

    def look(self, eye: int, way: Float64[np.ndarray, "2"]) -> Float64[np.ndarray, "V 3"]:
        """An eyeball turned about its middle."""
        sphere, turn = self.of_eyes(self.eyes.spheres[eye]), GAZE * way
        off = self.own[sphere] - self.eyes.balls[eye].centre
        moved = np.zeros_like(self.at)
        moved[sphere] = Rotation.from_rotvec([-turn[1], turn[0], 0]).apply(off) - off
        return moved

    def of_eyes(self, part: slice) -> slice:
        """A part of the eyes' own vertices among all."""
        return slice(self.eyes.first + part.start, self.eyes.first + part.stop)

    def margins(self, eye: int) -> tuple[Int64[np.ndarray, " U"], Int64[np.ndarray, " L"]]:
        """The vertices on the margin of the upper and of the lower lid, along it from the least x on the
        person's own face to the most; these corners are the upper one's."""
        rim = self.eyes.margins[eye]
        first, last = (int(place(self.own[rim, 0])) for place in (np.argmin, np.argmax))
        rim, way = np.roll(rim, -first), (last - first) % len(rim)
        arcs = rim[: way + 1], np.append(rim[way:], rim[0])[::-1]
        upper, lower = sorted(arcs, key=lambda arc: -self.own[arc, 1].mean())
        return upper, lower[1:-1]

    def blink(self, eye: int) -> Float64[np.ndarray, "V 3"]:
        """Both lids drawn over the eye until their margins meet, the corners where they are."""
        at, own = self.at[: self.skin], self.own[: self.skin]
        # lids move up and down, so those that are to meet have the same x on the person's own face
        x = own[:, 0]
        upper, lower = (rim[np.argsort(x[rim])] for rim in self.margins(eye))

        def along(rim: Int64[np.ndarray, " N"], values: np.ndarray, where: np.ndarray) -> np.ndarray:
            return np.stack(
                [np.interp(where, x[rim], values[rim, k]) for k in range(values.shape[1])], axis=1
            )

        ends = max(x[rim[0]] for rim in (upper, lower)), min(x[rim[-1]] for rim in (upper, lower))
        knots, way = np.linspace(*ends, KNOTS), np.linspace(-1, 1, KNOTS)
        share = (MEET + (0.5 - MEET) * way**4)[:, None]
        line = share * along(upper, own, knots) + (1 - share) * along(lower, own, knots)
        for k in (1, 2):
            line[:, k] = np.polyval(np.polyfit(way, line[:, k], BENDS), way)
        line[:, 2] = np.maximum(line[:, 2], self.before(eye, line))
        meet = np.stack([np.interp(x, knots, line[:, k]) for k in (1, 2)], axis=1)
        goal = meet - own[:, 1:]
        fade = 1 - smoothstep(self.face.curves.outside(at, eye), 0.0, LID)
        over = own[:, 1] > meet[:, 0]
        rims = [along(rim, goal, x) for rim in (upper, lower)]
        moved = fade[:, None] * np.where(over[:, None], *rims)
        rim = np.concatenate([upper, lower])
        moved[rim] = goal[rim]
        found = np.zeros_like(self.at)  # beyond the corners goals are others
        found[: self.skin, 1:] = self.softened(moved, np.asarray(fade > 0), rim)
        return found

    def before(self, eye: int, places: Float64[np.ndarray, "N 3"]) -> Float64[np.ndarray, " N"]:
        """How far forward, z, an eyeball lets lids be at places seen from the front."""
        ball = self.eyes.balls[eye]
        off = places[:, :2] - ball.centre[:2]
        away = np.minimum(np.linalg.norm(off, axis=1), ball.radius)
        bulge = ball.surface(np.column_stack([off, np.sqrt(ball.radius**2 - away**2)])) + CLEAR
        return ball.centre[2] + np.sqrt(np.maximum(bulge**2 - (off**2).sum(axis=1), 0))

    def settled(self, moved: Float64[np.ndarray, "V 3"]) -> Float64[np.ndarray, "V 3"]:
        """A shape whose lids slide over the eyeballs, and whose sockets end where lids do."""
        found = moved.copy()
        for eye, ball in enumerate(self.eyes.balls):
            near = self.beside[eye]
            vertex = near[np.any(moved[near], axis=1)]
            before, after = (at[vertex] - ball.centre for at in (self.own, self.own + moved))
            reach = [np.linalg.norm(off, axis=1) for off in (before, after)]
            least = np.minimum(ball.surface(after) + CLEAR, np.maximum(reach[0], reach[1]))
            push = np.maximum(least - reach[1], 0) / np.maximum(reach[1], 1e-9)
            found[vertex] += push[:, None] * after
            margin, ring = self.eyes.margins[eye], self.of_eyes(self.eyes.rings[eye])
            found[ring] = ball.behind((self.own + found)[margin]) - self.own[ring]
            found[ring] *= np.any(found[margin], axis=1, keepdims=True)
        return found
