"""Several motions at once: a body's and a face's, or several of a face. Letters: T frames, N moments."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float64

from avatargen.motion.motion import Motion, between, turned_between

FPS = 60.0


def together(name: str, motions: Sequence[Motion]) -> Motion:
    """One motion of all, of which one at most moves the body.

    The body's goes round as often as the longest of the face's needs, its way going on from where it was; a
    face's is repeated as often as it fits in, and is at rest then. Weights of one shape add up, to 1 at most.
    """
    bodies = [motion for motion in motions if motion.joint_names]
    faces = [motion for motion in motions if motion.weights is not None]
    longest = max(motion.seconds for motion in faces)
    body = bodies[0] if bodies else faces[0]
    seconds = body.seconds * max(1, round_up(longest / body.seconds)) if bodies else longest
    times = np.linspace(0.0, seconds, max(2, round(seconds * FPS) + 1))
    rounds, moments = around(times, body.seconds)
    way = body.translation[-1] - body.translation[0]
    shapes = tuple(dict.fromkeys(shape for motion in faces for shape in motion.shapes))
    weights = np.zeros((len(times), len(shapes)))
    for face in faces:
        weights[:, [shapes.index(shape) for shape in face.shapes]] += repeated(face, times)
    return replace(
        body,
        name=name,
        times=times,
        rotations=turned_between(body, moments),
        translation=between(body, body.translation, moments) + rounds[:, None] * way,
        shapes=shapes,
        weights=np.clip(weights, 0.0, 1.0),
    )


def around(
    times: Float64[np.ndarray, " N"], seconds: float
) -> tuple[Float64[np.ndarray, " N"], Float64[np.ndarray, " N"]]:
    """Rounds of so many seconds that lie behind, and the moment within the one that goes on. The last time
    ends a round and begins none."""
    rounds = np.floor(np.minimum(times, times[-1] - 1e-6) / seconds + 1e-9)
    return rounds, np.clip(times - rounds * seconds, 0.0, seconds)


def repeated(face: Motion, times: Float64[np.ndarray, " N"]) -> Float64[np.ndarray, "N K"]:
    """The weights of a face's motion as often as it is whole before the last time, then at rest."""
    assert face.weights is not None  # of a face
    rounds, moments = around(times, face.seconds)
    count = max(1, int(times[-1] / face.seconds + 1e-6))
    return np.where((rounds < count)[:, None], between(face, face.weights, moments), 0.0)


def round_up(number: float) -> int:
    """The next whole number, of one that is hardly more than a whole one that one."""
    return int(np.ceil(number - 1e-6))
