"""A motion: joint rotations over time, for any body that has joints of those names, and weights of a face's
shapes, for any face that has shapes of those names.

Conventions are a pose's: every rotation is relative to the joint's parent and zero in the T-pose; metres, y
up, the person faces +z at rest, the person's left is +x. Letters: T frames, J joints, K shapes. Quaternions
x y z w.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Float64
from scipy.spatial.transform import Rotation

from avatargen.body.joints import mirrored_name
from avatargen.errors import InputError

MIRROR_QUATERNION = np.array([1.0, -1.0, -1.0, 1.0])  # of a rotation seen in a mirror across x = 0
MIRROR_POINT = np.array([-1.0, 1.0, 1.0])
LONGEST = 100_000  # frames that a retimed motion may have


@dataclass(frozen=True, kw_only=True)
class Motion:
    """Rotations by joint and the pelvis' way, and weights by shape. One of a face alone has no joints, one of
    a body alone no shapes. Raises InputError where times do not increase from 0, or a weight is not in 0..1.
    """

    name: str
    joint_names: tuple[str, ...]
    times: Float64[np.ndarray, " T"]  # seconds
    rotations: Float64[np.ndarray, "T J 4"]
    translation: Float64[np.ndarray, "T 3"]  # of the pelvis from its place in the T-pose, metres
    leg: float | None = None  # metres from hip to knee to ankle of who moved; None: who is to move
    bad_frames: tuple[int, ...] = ()  # of the file: they held no motion and were filled from their neighbours
    shapes: tuple[str, ...] = ()
    weights: Float64[np.ndarray, "T K"] | None = None  # of the shapes, 0..1

    def __post_init__(self) -> None:
        if len(self.times) == 0 or self.times[0] != 0 or not (np.diff(self.times) > 0).all():
            raise InputError(f"motion {self.name}: its times do not increase from 0, or it has no frame")
        if not np.isfinite(self.rotations).all() or not np.isfinite(self.translation).all():
            raise InputError(f"motion {self.name}: it holds NaN or infinity")
        shape = (0, 0) if self.weights is None else self.weights.shape
        if shape != (len(self.times) if self.shapes else 0, len(self.shapes)):
            raise InputError(
                f"motion {self.name}: {len(self.shapes)} shapes have weights {shape}, not one a frame"
            )
        if self.weights is not None and not ((self.weights >= 0) & (self.weights <= 1)).all():
            raise InputError(f"motion {self.name}: a shape's weight is not within 0 and 1")

    @property
    def seconds(self) -> float:
        return float(self.times[-1])


def continuous(quaternions: Float[np.ndarray, "T J 4"]) -> Float64[np.ndarray, "T J 4"]:
    """The same rotations with signs such that neighbours in time lie in one half of the sphere."""
    along = np.einsum("tjk,tjk->tj", quaternions[1:], quaternions[:-1])
    first = np.where(quaternions[:1, :, 3] < 0, -1.0, 1.0)
    signs = np.cumprod(np.concatenate([first, np.where(along < 0, -1.0, 1.0)]), axis=0)
    return quaternions.astype(np.float64) * signs[:, :, None]


def mirrored(motion: Motion) -> Motion:
    """The motion as a mirror shows it: left and right change places."""
    place = {name: index for index, name in enumerate(motion.joint_names)}
    # a joint whose twin is missing has nothing to take its motion from, and stays on its own side
    order = [place.get(mirrored_name(name), place[name]) for name in motion.joint_names]
    return replace(
        motion,
        rotations=motion.rotations[:, order] * MIRROR_QUATERNION,
        translation=motion.translation * MIRROR_POINT,
        shapes=tuple(map(mirrored_shape, motion.shapes)),
    )


def mirrored_shape(name: str) -> str:
    """The face's shape on the other side, or the shape itself where it has no side."""
    for side, other in (("Left", "Right"), ("Right", "Left")):
        if name.endswith(side):
            return name.removesuffix(side) + other
    return name


def in_place(motion: Motion) -> Motion:
    """The motion without its way over the ground: the pelvis moves up and down alone."""
    return replace(motion, translation=motion.translation * [0.0, 1.0, 0.0])


def retimed(motion: Motion, fps: float, speed: float = 1.0) -> Motion:
    """Sampled anew at `fps` frames a second, played `speed` times as fast; the last frame is kept.

    Between frames rotations turn at constant speed along the shorter way.

    Raises:
        InputError: the rate or speed is not positive, or there would be more than LONGEST frames.
    """
    if not (0 < fps < np.inf and 0 < speed < np.inf):
        raise InputError(f"motion: {fps:g} frames a second at speed {speed:g}; both must be above 0")
    frames = motion.seconds / speed * fps
    if frames > LONGEST:
        raise InputError(f"motion {motion.name}: {frames:.0f} frames at {fps:g} a second; at most {LONGEST}")
    count = int(frames + 1e-6)
    times = np.arange(count + 1) / fps
    if motion.seconds / speed - times[-1] > 1e-3 / fps:
        times = np.append(times, motion.seconds / speed)
    return sampled(motion, np.minimum(times * speed, motion.seconds), times)


def sampled(motion: Motion, moments: Float64[np.ndarray, " N"], times: Float64[np.ndarray, " N"]) -> Motion:
    """A frame for each of these moments within the motion, shown at `times`."""
    way = between(motion, motion.translation, moments)
    weights = None if motion.weights is None else between(motion, motion.weights, moments)
    return replace(
        motion, times=times, rotations=turned_between(motion, moments), translation=way, weights=weights
    )


def between(
    motion: Motion, values: Float64[np.ndarray, "T C"], moments: Float64[np.ndarray, " N"]
) -> Float64[np.ndarray, "N C"]:
    """Each column at any moments, on straight lines between the motion's frames."""
    return np.stack([np.interp(moments, motion.times, column) for column in values.T], axis=1)


def turned_between(motion: Motion, times: Float64[np.ndarray, " N"]) -> Float64[np.ndarray, "N J 4"]:
    """The rotations at any times within the motion."""
    last = len(motion.times) - 1
    before = np.clip(np.searchsorted(motion.times, times, side="right") - 1, 0, last)
    after = np.minimum(before + 1, last)
    gap = motion.times[after] - motion.times[before]
    share = np.where(gap > 0, (times - motion.times[before]) / np.where(gap > 0, gap, 1), 0.0)
    J = len(motion.joint_names)
    if J == 0:
        return np.zeros((len(times), 0, 4))
    start = Rotation.from_quat(motion.rotations[before].reshape(-1, 4))
    end = Rotation.from_quat(motion.rotations[after].reshape(-1, 4))
    turn = (start.inv() * end).as_rotvec() * np.repeat(share, J)[:, None]
    return continuous((start * Rotation.from_rotvec(turn)).as_quat().reshape(-1, J, 4))
