"""Weights of cloth that hangs free of the legs, as skirts and long coats do: such that on raised thighs it
lies in front and does not sag behind.

Linear blend skinning turns cloth as stiffly as the thigh that it is given to: where it stands d off the hips'
line it stands as far over a thigh that is raised by a right angle, like a tub. Of its weight a share on the
pelvis, which stays upright, brings it down, and one on the knee, whose shin stays upright when somebody sits,
brings it up. So both are solved for there: a vertex h below the hips, d before their line, with shares p on
the pelvis, k on the knee and the rest on the thigh, of length L, comes to lie over that line by

    (1 - p - k) d - p h + k (L - h),

which is to be the thigh's own surface. Below the knees the shins have more and more of it. Which leg it is,
and what joints above these have, stays as it was; so does what lies close to the body.

Letters: V vertices, J joints, B vertices of the body. Metres; everything in the T-pose, where legs are
straight.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64
from scipy.ndimage import gaussian_filter1d
from scipy.sparse import diags_array

from assets.mesh.surface import Surface
from assets.skin.attach import edge_graph
from assets.skin.skin import INFLUENCES, NEGLIGIBLE, Skin, limit_influences
from avatargen.body.model import CanonicalBody, ShapedBody, pose_canonically, shape
from avatargen.body.skinning import unskin
from avatargen.mesh.closest import ClosestPoints
from avatargen.smoothstep import smoothstep

TRUNK = ("pelvis", "spine1")
HIPS, KNEES, ANKLES = (
    tuple(f"{side}_{joint}" for side in ("left", "right")) for joint in ("hip", "knee", "ankle")
)
NEAR, FREE = 0.015, 0.045  # m off the body: cloth that follows it, and the way on to where it hangs free
FROM, FULLY = 0.02, 0.13  # m below the hips from which cloth hangs, and the way on to where it does so fully
CLEAR = 0.012  # m off the thigh that cloth comes to lie
SHIN, SHIN_OVER = -0.06, 0.16  # m below the knees from which cloth goes with shins, and the way to the most
MOST_SHIN = 0.8  # share that a shin has at most: a foot lifted behind does not carry a dress along
LEG = 0.5  # weight of a leg's joints from which a vertex of the body is a leg's
LEVELS, SLAB = 40, 0.02  # heights at which legs are measured, and m above and below each
LEVEL = 1.5  # of these heights over which they are smoothed
SOME = 0.1  # weight of legs from which a vertex may hang
ROUNDS, SMOOTHING = 4, 0.5  # of smoothing, and the share of the neighbours' mean in each
SHORTEST = 0.05  # m that divisors are at least


@dataclass(frozen=True, kw_only=True)
class Legs:
    """Straight legs, seen from the side: at some heights z of the line through the joints, and of the front
    and the back of the legs."""

    hips: float  # height
    thigh: float  # length
    heights: Float64[np.ndarray, " n"]  # downward
    line: Float64[np.ndarray, " n"]
    front: Float64[np.ndarray, " n"]
    back: Float64[np.ndarray, " n"]

    def at(self, heights: Float64[np.ndarray, " V"]) -> tuple[Float64[np.ndarray, " V"], ...]:
        """z of line, front and back."""
        return tuple(np.interp(-heights, -self.heights, each) for each in (self.line, self.front, self.back))


def hang(skin: Skin, surface: Surface, body: CanonicalBody) -> Skin:
    """The weights with which a canonical surface moves from the T-pose on, of those that lead there; the same
    for bodies of all shapes. One without SMPL's names for the legs' joints leaves all as it is."""
    names = body.joint_names
    straight = shape(body.source, np.zeros(body.source.shapedirs.shape[2]))
    legs = measure_legs(straight, names) if set(TRUNK + HIPS + KNEES + ANKLES) <= set(names) else None
    if legs is None:
        return skin
    weights = skin.dense(len(names))
    vertices = unskin(surface.vertices, weights, pose_canonically(body.source).T_posed_rest)
    trunk, hips, knees = ([names.index(name) for name in group] for group in (TRUNK, HIPS, KNEES))
    free = hanging(vertices, weights[:, hips + knees].sum(axis=1), straight, legs)
    if not free.any():
        return skin
    own = trunk + hips + knees
    pelvis, shin = shares(vertices, legs)
    total = weights[:, own].sum(axis=1)
    left_right = weights[:, hips] + weights[:, knees]
    left_right /= np.maximum(left_right.sum(axis=1, keepdims=True), 1e-6)
    wanted = weights.copy()
    wanted[:, own] = 0
    wanted[:, trunk[0]] = total * pelvis
    wanted[:, hips] = (total * (1 - pelvis - shin))[:, None] * left_right
    wanted[:, knees] = (total * shin)[:, None] * left_right
    weights = weights + free[:, None] * (wanted - weights)
    graph = edge_graph(Surface(vertices=vertices, faces=surface.faces))
    mean = diags_array(1 / np.maximum(graph.sum(axis=1), 1e-12)) @ graph
    for _ in range(ROUNDS):
        weights = weights + SMOOTHING * free[:, None] * (mean @ weights - weights)
    changed, found = free > 0, limit_influences(on_one_knee(weights, knees))
    return Skin(
        joints=np.where(changed[:, None], found.joints, skin.joints),
        weights=np.where(changed[:, None], found.weights, skin.weights),
    )


def on_one_knee(weights: Float64[np.ndarray, "V J"], knees: list[int]) -> Float64[np.ndarray, "V J"]:
    """Where more joints than a vertex has room for share it, the knees' weight on the heavier one: dropped,
    the lighter one's would go to all others, and cloth on somebody seated would jump."""
    rows = np.flatnonzero((weights > NEGLIGIBLE).sum(axis=1) > INFLUENCES)
    of_knees = weights[rows[:, None], knees]
    heavier = of_knees.argmax(axis=1)
    found = weights.copy()
    found[rows[:, None], knees] = of_knees.sum(axis=1, keepdims=True) * np.eye(len(knees))[heavier]
    return found


def shares(
    vertices: Float64[np.ndarray, "V 3"], legs: Legs
) -> tuple[Float64[np.ndarray, " V"], Float64[np.ndarray, " V"]]:
    """Of pelvis and knees in what hangs freely, 0..1 and together at most 1."""
    line, front, back = legs.at(vertices[:, 1])
    below, before = legs.hips - vertices[:, 1], vertices[:, 2] - line
    behind = np.maximum(back - CLEAR - vertices[:, 2], 0)
    lift = np.maximum(legs.thigh - np.clip(below, 0, legs.thigh) - before, SHORTEST)
    long = MOST_SHIN * smoothstep((below - legs.thigh - SHIN) / SHIN_OVER)
    shin = np.minimum(np.maximum(behind / lift, long), MOST_SHIN)
    over = (1 - shin) * before + shin * (legs.thigh - below) - (front + CLEAR - line)
    pelvis = np.clip(over / np.maximum(before + below, SHORTEST), 0, 1 - shin)
    return np.where(vertices[:, 2] > front + CLEAR, pelvis, 0.0), shin


def hanging(
    vertices: Float64[np.ndarray, "V 3"], of_legs: Float64[np.ndarray, " V"], body: ShapedBody, legs: Legs
) -> Float64[np.ndarray, " V"]:
    """How freely each vertex hangs, 0..1: below the hips, off the body, and moved by the legs."""
    found = smoothstep((legs.hips - vertices[:, 1] - FROM) / FULLY) * smoothstep(
        (of_legs / SOME).astype(np.float64)
    )
    may = np.flatnonzero(found)
    squared, _, _ = ClosestPoints(body.vertices, body.body.faces).query(vertices[may])
    found[may] *= smoothstep(((np.sqrt(squared) - NEAR) / FREE).astype(np.float64))
    return found


def measure_legs(body: ShapedBody, names: tuple[str, ...]) -> Legs | None:
    """Where a body's straight legs are; None where its joints move none."""
    hips, knees, ankles = (
        body.joints[[names.index(name) for name in group]].mean(axis=0) for group in (HIPS, KNEES, ANKLES)
    )
    joints = [names.index(name) for name in HIPS + KNEES]
    leg: Bool[np.ndarray, " B"] = body.body.weights[:, joints].sum(axis=1) > LEG
    places, found = body.vertices[leg], []
    for height in np.linspace(hips[1], ankles[1], LEVELS):
        z = places[np.abs(places[:, 1] - height) < SLAB, 2]
        if len(z):
            found.append((height, z.min(), z.max()))
    if not found:
        return None
    levels: Float64[np.ndarray, "n 3"] = np.asarray(found, dtype=np.float64)
    heights, back, front = np.asarray(gaussian_filter1d(levels, LEVEL, axis=0, mode="nearest")).T
    down = [-hips[1], -knees[1], -ankles[1]]
    return Legs(
        hips=float(hips[1]),
        thigh=float(hips[1] - knees[1]),
        heights=heights,
        line=np.asarray(np.interp(-heights, down, [hips[2], knees[2], ankles[2]])),
        front=front,
        back=back,
    )
