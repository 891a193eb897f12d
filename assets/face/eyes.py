"""Eyeballs: closed balls of their own behind the lids, and the sockets that close the skin behind them.

Places are those of the person's own face, as large and upright as the canonical one. Letters: S the skin's
welded vertices, N of a lid's margin, M of the ring around a ball, B of a ball, E of both eyes. Metres.
"""

import itertools
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64
from scipy.spatial.transform import Rotation

from assets.face.falloff import bell
from assets.face.opened import OpenFace

RADIUS = 0.0166  # m of a ball
AHEAD = 1e-4  # m that lids lie before it
TOUCHING = 3.0  # percent of a margin that may lie deeper: corners' folds
STEPS, LEANING = 8, 0.02  # of fitting a ball, and how much its middle is held behind the pupil
BULGE, CORNEA = 0.02, np.radians(22.0)  # of the radius that the cornea stands out, and how wide it is
BEHIND = 1.5e-4  # m between the ball and the rims of the lids
WITHIN = 0.95  # of the radius, seen from the front: rims end before
LATITUDES = np.radians([7.0, 14, 22, 32, 44, 58, 76, 96, 120, 148])  # of a ball's rings, from the pupil
AROUND = 20  # vertices of a ring
LINED = (1.05, np.radians(112.0), np.radians(150.0))  # of the radius; where the socket's last rings lie
SOCKET, LEFT, RIGHT = 4, 5, 6  # kinds of vertices, after the mouth's


@dataclass(frozen=True, kw_only=True)
class Ball:
    """Where an eyeball is."""

    centre: Float64[np.ndarray, "3"]
    pupil: Float64[np.ndarray, "3"]  # the way it looks at rest, of length 1
    radius: float

    def surface(self, off: Float64[np.ndarray, "N 3"]) -> Float64[np.ndarray, " N"]:
        """Metres from the centre to the ball's surface, in directions that need not be of length 1."""
        length = np.maximum(np.linalg.norm(off, axis=1), 1e-12)
        angle = np.arccos(np.clip(off @ self.pupil / length, -1, 1))
        return self.radius * (1 + BULGE * bell(angle, CORNEA))

    def behind(self, margin: Float64[np.ndarray, "N 3"]) -> Float64[np.ndarray, "N 3"]:
        """Where a lid's margin ends on the ball: straight behind, so that from the front nothing of it
        shows."""
        off = margin[:, :2] - self.centre[:2]
        away = np.maximum(np.linalg.norm(off, axis=1), 1e-12)
        across = np.minimum(away, WITHIN * self.radius)
        depth = self.centre[2] + np.sqrt((self.radius + BEHIND) ** 2 - across**2)
        place = self.centre[:2] + off * (across / away)[:, None]
        return np.column_stack([place, np.minimum(depth, margin[:, 2] - BEHIND)])


@dataclass(frozen=True, kw_only=True)
class Eyes:
    """Both eyes' own vertices, after all others of the face, and faces among them and the lids' margins."""

    balls: tuple[Ball, Ball]  # left, right
    margins: tuple[Int64[np.ndarray, " _"], Int64[np.ndarray, " _"]]  # the skin's
    rings: tuple[slice, slice]  # of the eyes' own: where each margin ends on its ball
    spheres: tuple[slice, slice]
    places: Float64[np.ndarray, "E 3"]
    faces: Int64[np.ndarray, "F 3"]  # welded numbers
    kinds: Int64[np.ndarray, " E"]
    first: int

    def canonical(self, face: OpenFace) -> Float64[np.ndarray, "E 3"]:
        """Where they are in canonical space."""
        found = self.places.copy()
        for ball, ring, sphere, place in zip(
            self.balls, self.rings, self.spheres, face.units.balls[:, :3], strict=True
        ):
            found[ring.start : sphere.stop] += place - ball.centre
        return found


def make_eyes(face: OpenFace, own: Float64[np.ndarray, "S 3"]) -> Eyes:
    """Eyes that fit the lids of a person's own face."""
    first, sphere = len(face.places), unit_sphere()
    directions, sphere_faces = sphere
    balls, rings, spheres, places, faces, kinds, count = [], [], [], [], [], [], first
    for eye, margin in enumerate(face.margins):
        ball = fitted(face, own, eye)
        ring = ball.behind(own[margin])
        lining = socket_rings(ring, ball)
        back = ball.centre - np.array([0, 0, LINED[0] * ball.radius])
        turned = Rotation.align_vectors(ball.pupil, [0.0, 0, 1])[0].apply(directions)
        of_ball = ball.centre + turned * ball.surface(turned)[:, None]
        parts = [ring, *lining, back[None], of_ball]
        numbers = np.split(
            count + np.arange(sum(map(len, parts))), np.cumsum([len(part) for part in parts])[:-1]
        )
        faces += [
            banded(margin, numbers[0]),
            between(numbers[0], numbers[1], ring, lining[0], ball),
            *(banded(*pair) for pair in itertools.pairwise(numbers[1:-2])),
            fanned(numbers[-3], int(numbers[-2][0])),
            sphere_faces + numbers[-1][0],
        ]
        rings.append(slice(count - first, count - first + len(ring)))
        spheres.append(slice(int(numbers[-1][0]) - first, int(numbers[-1][-1]) + 1 - first))
        kinds += [
            np.full(int(numbers[-1][0] - numbers[0][0]), SOCKET),
            np.full(len(of_ball), (LEFT, RIGHT)[eye]),
        ]
        places += parts
        balls.append(ball)
        count = int(numbers[-1][-1]) + 1
    return Eyes(
        balls=(balls[0], balls[1]),
        margins=face.margins,
        rings=(rings[0], rings[1]),
        spheres=(spheres[0], spheres[1]),
        places=np.concatenate(places),
        faces=np.concatenate(faces),
        kinds=np.concatenate(kinds),
        first=first,
    )


def fitted(face: OpenFace, own: Float64[np.ndarray, "S 3"], eye: int) -> Ball:
    """The ball that lies close behind both lids, its pupil where the canonical one is seen from the front."""
    margin = own[face.margins[eye]]
    canonical = np.column_stack([face.mesh.points[face.margins[eye], :2], np.ones(len(margin))])
    pupil = np.append(face.units.balls[eye, :2], 1) @ np.linalg.lstsq(canonical, margin[:, :2], rcond=None)[0]
    centre = np.array([*pupil, margin[:, 2].mean() - RADIUS])
    for _ in range(STEPS):  # Gauss-Newton
        off = margin - centre
        length = np.linalg.norm(off, axis=1)
        known = np.concatenate([-off / length[:, None], LEANING * np.sqrt(len(off)) * np.eye(2, 3)])
        wrong = np.append(RADIUS + AHEAD - length, LEANING * np.sqrt(len(off)) * (pupil - centre[:2]))
        centre += np.linalg.lstsq(known, wrong, rcond=None)[0]
    across = np.linalg.norm(margin[:, :2] - centre[:2], axis=1)
    room = (RADIUS + AHEAD) ** 2 - across**2
    centre[2] = np.percentile(margin[room > 0, 2] - np.sqrt(room[room > 0]), TOUCHING)
    way = np.clip((pupil - centre[:2]) / RADIUS, -0.5, 0.5)
    return Ball(centre=centre, pupil=np.array([*way, np.sqrt(1 - way @ way)]), radius=RADIUS)


def unit_sphere() -> tuple[Float64[np.ndarray, "B 3"], Int64[np.ndarray, "F 3"]]:
    """A sphere whose rings lie close where the pupil is, +z; faces counter-clockwise from outside."""
    turn = 2 * np.pi * np.arange(AROUND) / AROUND
    ring = np.stack([np.cos(turn), np.sin(turn), np.zeros(AROUND)], axis=1)
    rings = [np.sin(a) * ring + [0, 0, np.cos(a)] for a in LATITUDES]
    front, back = AROUND * len(LATITUDES), AROUND * len(LATITUDES) + 1
    k = np.arange(AROUND)
    after = (k + 1) % AROUND
    faces = [np.stack([np.full(AROUND, front), k, after], axis=1)]
    for number in range(len(LATITUDES) - 1):
        here, below = number * AROUND, (number + 1) * AROUND
        faces.append(np.stack([here + k, below + k, below + after], axis=1))
        faces.append(np.stack([here + k, below + after, here + after], axis=1))
    last = front - AROUND
    faces.append(np.stack([last + k, np.full(AROUND, back), last + after], axis=1))
    return np.concatenate([*rings, [[0, 0, 1.0]], [[0, 0, -1.0]]]), np.concatenate(faces)


def socket_rings(ring: Float64[np.ndarray, "N 3"], ball: Ball) -> list[Float64[np.ndarray, "M 3"]]:
    """Rings around the ball from where the lids end on it to behind it, in the ring's direction."""
    angle = direction_of(ring, ball)
    sign, (wide, side, end) = np.sign(angle[-1] - angle[0]), LINED
    turn = angle[0] + sign * 2 * np.pi * np.arange(AROUND) / AROUND
    order = np.argsort(sign * angle)
    off = ring - ball.centre
    polar = np.arctan2(np.linalg.norm(off[:, :2], axis=1), off[:, 2])
    begin = np.interp(sign * turn, (sign * angle)[order], polar[order], period=2 * np.pi)
    flat = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    found = []
    for down in (
        begin + (side - begin) / 3,
        begin + 2 * (side - begin) / 3,
        np.full(AROUND, side),
        np.full(AROUND, end),
    ):
        way = np.column_stack([flat * np.sin(down)[:, None], np.cos(down)])
        found.append(ball.centre + wide * ball.radius * way)
    return found


def direction_of(ring: Float64[np.ndarray, "N 3"], ball: Ball) -> Float64[np.ndarray, " N"]:
    """Angles of a ring seen from the front, growing or falling."""
    off = ring[:, :2] - ball.centre[:2]
    return np.unwrap(np.arctan2(off[:, 1], off[:, 0]))


def banded(outer: Int64[np.ndarray, " N"], inner: Int64[np.ndarray, " N"]) -> Int64[np.ndarray, "F 3"]:
    """Faces from a border, in its own faces' direction, to a ring of as many vertices."""
    a, b, c, d = outer, np.roll(outer, -1), inner, np.roll(inner, -1)
    return np.concatenate([np.stack([b, a, c], axis=1), np.stack([b, c, d], axis=1)])


def between(
    outer: Int64[np.ndarray, " N"],
    inner: Int64[np.ndarray, " M"],
    at_outer: Float64[np.ndarray, "N 3"],
    at_inner: Float64[np.ndarray, "M 3"],
    ball: Ball,
) -> Int64[np.ndarray, "F 3"]:
    """Faces from one ring to another of another count, by their angles."""
    ways = [np.abs(angle - angle[0]) for angle in (direction_of(at, ball) for at in (at_outer, at_inner))]
    ways = [np.append(np.maximum.accumulate(way), 2 * np.pi) for way in ways]
    i, j, faces = 0, 0, []
    N, M = len(outer), len(inner)
    while i < N or j < M:
        if j == M or (i < N and ways[0][i + 1] <= ways[1][j + 1]):
            faces.append((outer[(i + 1) % N], outer[i % N], inner[j % M]))
            i += 1
        else:
            faces.append((outer[i % N], inner[j % M], inner[(j + 1) % M]))
            j += 1
    return np.array(faces)


def fanned(ring: Int64[np.ndarray, " M"], middle: int) -> Int64[np.ndarray, "F 3"]:
    """Faces from a border to one vertex."""
    return np.stack([np.roll(ring, -1), ring, np.full(len(ring), middle)], axis=1)
