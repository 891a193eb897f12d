"""Stress of skinning: extreme poses and shapes of the default body, transforms that cannot be inverted."""

import numpy as np
import torch
from jaxtyping import Float64

from assets.mesh.surface import Surface, volume
from avatargen.body.model import pose, shape
from avatargen.body.pose import axis_angle_to_matrix
from avatargen.body.skinning import invert_blend, skin, unskin
from avatargen.commands.stress.case import Case, require
from avatargen.commands.stress.figure import default_body
from avatargen.errors import InputError
from avatargen.generator.canonical import canonical_map

REACH = 3.0  # metres from the pelvis that no vertex may pass


def turned(degrees: dict[str, tuple[int, int, int]]) -> Float64[np.ndarray, "J 3"]:
    """Axis-angle of some joints, degrees, the others at rest."""
    names = default_body().joint_names
    rotations = np.zeros((len(names), 3))
    for name, angles in degrees.items():
        rotations[names.index(name)] = np.radians(angles)
    return rotations


def survives(rotations: Float64[np.ndarray, "J 3"], betas: float = 0.0) -> str:
    """Posed vertices stay near, bones keep their lengths, the way back is finite and right for most."""
    body = default_body()
    shaped = shape(body, np.full(body.shapedirs.shape[2], betas))
    posed = pose(body, shaped, rotations)
    away = np.linalg.norm(posed.vertices - posed.joints[0], axis=1).max()
    require(np.isfinite(posed.vertices).all() and away < REACH, f"a vertex is {away:.2f} m from the pelvis")
    child, parent = np.arange(1, len(body.parents)), body.parents[1:]
    bones = [np.linalg.norm(j[child] - j[parent], axis=1) for j in (posed.joints, shaped.joints)]
    stretch = np.abs(bones[0] - bones[1]).max()
    require(stretch < 1e-9, f"a bone changed its length by {stretch:.1e} m")
    back, _ = canonical_map(posed)(torch.from_numpy(posed.vertices), 1)
    require(torch.isfinite(back).all(), "the canonical mapping gives NaN")
    straight = unskin(posed.vertices, body.weights, posed.T_posed_rest)
    off = np.linalg.norm(straight - shaped.vertices - posed.offsets, axis=1)
    require(np.isfinite(straight).all(), "inverse skinning gives NaN")
    exact = (off < 1e-6).mean()
    require(exact > 0.9, f"only {100 * exact:.0f} % of vertices come back")
    return f"finite, bones keep their length, {100 * exact:.1f} % of vertices come back within 1 µm"


def random_joints() -> str:
    rng = np.random.default_rng(0)
    worst = 100.0
    for _ in range(10):
        axis = rng.normal(size=(len(default_body().joint_names), 3))
        axis /= np.linalg.norm(axis, axis=1, keepdims=True)
        said = survives(axis * rng.uniform(-np.pi, np.pi, size=(len(axis), 1)))
        worst = min(worst, float(said.split("length, ")[1].split(" %")[0]))
    return f"ten draws: finite, at least {worst} % of vertices come back within 1 µm"


def shapes(beta: float) -> str:
    body = default_body()
    shaped = shape(body, np.full(body.shapedirs.shape[2], beta))
    litres = 1000 * volume(Surface(vertices=shaped.vertices, faces=body.faces))
    require(10 < litres < 500, f"the body holds {litres:.0f} litres")
    return f"{litres:.0f} litres, {survives(turned({}), beta)}"


def singular() -> str:
    """The mean of two opposite rotations has no inverse."""
    transforms = np.tile(np.eye(4), (2, 1, 1))
    transforms[1, :3, :3] = axis_angle_to_matrix(np.array([np.pi, 0.0, 0.0]))
    weights = np.linspace(0, 1, 201)[:, None] * [1, -1] + [0, 1]
    inverse = invert_blend(weights, transforms)
    largest = np.linalg.norm(inverse[:, :3, :3], ord=2, axis=(1, 2)).max()
    require(np.isfinite(inverse).all() and largest < 1e3, f"the inverse stretches by {largest:.1e}")
    points = np.random.default_rng(0).normal(size=(201, 3))
    off = np.abs(unskin(skin(points, weights, transforms), weights, transforms) - points).max(axis=1)
    exact = (off < 1e-9).mean()
    require(exact > 0.98, f"only {100 * exact:.0f} % come back")
    return f"inverse finite, stretches by at most {largest:.0f}; {100 * exact:.1f} % of points come back"


def bad_numbers() -> str:
    rotations = turned({})
    rotations[3, 1] = np.nan
    return survives(rotations)


def cases() -> list[Case]:
    """Poses, shapes, and one that has to fail."""
    poses: dict[str, dict[str, tuple[int, int, int]]] = {
        "elbows and knees at +180 degrees": dict.fromkeys(
            ("left_elbow", "right_elbow", "left_knee", "right_knee"), (180, 0, 0)
        ),
        "all joints at -180 degrees": dict.fromkeys(default_body().joint_names, (0, -180, 0)),
        "twisted wrists": {"left_wrist": (175, 0, 0), "right_wrist": (-175, 0, 0)},
        "folded knees, heels in the thighs": {
            **dict.fromkeys(("left_hip", "right_hip"), (-120, 0, 0)),
            **dict.fromkeys(("left_knee", "right_knee"), (160, 0, 0)),
        },
        "arms through the trunk": {"left_shoulder": (0, -150, 0), "right_shoulder": (0, 150, 0)},
    }
    found = [
        Case(
            name=name,
            expected="finite both ways, bones keep their length",
            check=lambda degrees=degrees: survives(turned(degrees)),
        )
        for name, degrees in poses.items()
    ]
    found += [
        Case(name="all joints random", expected="finite both ways, ten draws", check=random_joints),
        Case(name="betas +5", expected="a body of positive volume", check=lambda: shapes(5.0)),
        Case(name="betas -5", expected="a body of positive volume", check=lambda: shapes(-5.0)),
        Case(
            name="blended transform without inverse",
            expected="detected: the heaviest joint's is taken, never NaN",
            check=singular,
        ),
        Case(
            name="NaN in a pose",
            expected="InputError: ... finite ...",
            check=bad_numbers,
            error=(InputError, "finite"),
        ),
    ]
    return found
