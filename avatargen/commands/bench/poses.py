"""How well a skinned mesh follows the generator: in twenty fixed poses it is bent as an engine does, carried
back to the canonical space by the generator's own mapping (section 3.3), and compared with where it
came from; and how far its edges are pulled.

Letters: V vertices, J joints, P poses. Metres, radians.
"""

import time
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Float64

from assets.build_config import AvatarFields
from assets.mesh.surface import Surface, directed_edges, edge_lengths
from assets.skin.attach import Attachment
from assets.skin.rest import to_rest
from assets.skin.skin import Skin
from avatargen.body.model import PosedBody, pose, shape
from avatargen.body.skinning import skin as skin_points
from avatargen.generator.canonical import canonical_map

SHORTEST = 2e-3  # metres of an edge whose stretch is measured by its own length
# degrees about x, y, z by joint; joints a body does not have are skipped
TABLE: dict[str, dict[str, tuple[float, float, float]]] = {
    "t": {},
    "a": {"left_shoulder": (0, 0, -50), "right_shoulder": (0, 0, 50)},
    "arms up": {"left_shoulder": (0, 0, 80), "right_shoulder": (0, 0, -80)},
    "arms forward": {"left_shoulder": (0, -85, 0), "right_shoulder": (0, 85, 0)},
    "arms down": {"left_shoulder": (0, 0, -75), "right_shoulder": (0, 0, 75)},
    "step": {"left_hip": (-30, 0, 0), "right_hip": (25, 0, 0), "left_knee": (20, 0, 0)},
    "run": {
        "left_hip": (-70, 0, 0),
        "left_knee": (90, 0, 0),
        "right_hip": (20, 0, 0),
        "right_knee": (40, 0, 0),
        "left_elbow": (0, -90, 0),
        "right_elbow": (0, 90, 0),
    },
    "sit": {
        "left_hip": (-90, 0, 0),
        "right_hip": (-90, 0, 0),
        "left_knee": (90, 0, 0),
        "right_knee": (90, 0, 0),
    },
    "squat": {
        "left_hip": (-120, 0, 15),
        "right_hip": (-120, 0, -15),
        "left_knee": (140, 0, 0),
        "right_knee": (140, 0, 0),
    },
    "split": {"left_hip": (-80, 0, 0), "right_hip": (70, 0, 0)},
    "side split": {"left_hip": (0, 0, 75), "right_hip": (0, 0, -75)},
    "kick": {"right_hip": (-110, 0, 0), "spine1": (15, 0, 0)},
    "bow": {"spine1": (30, 0, 0), "spine2": (30, 0, 0), "spine3": (20, 0, 0), "neck": (20, 0, 0)},
    "lean back": {"spine1": (-20, 0, 0), "spine2": (-20, 0, 0), "neck": (-25, 0, 0)},
    "twist": {"spine1": (0, 25, 0), "spine2": (0, 25, 0), "spine3": (0, 25, 0), "head": (0, 40, 0)},
    "elbows": {"left_elbow": (0, -140, 0), "right_elbow": (0, 140, 0)},
    "wrists": {"left_wrist": (90, 0, 0), "right_wrist": (-90, 0, 0)},
    "head": {"neck": (20, 45, 0), "head": (10, 30, 15)},
    "shrug": {"left_collar": (0, 0, 25), "right_collar": (0, 0, -25), "left_shoulder": (0, 0, -60)},
    "toes": {"left_foot": (40, 0, 0), "right_foot": (-30, 0, 0), "left_ankle": (30, 0, 0)},
}


@dataclass(frozen=True, kw_only=True)
class PosedError:
    """Over all vertices and poses, millimetres; the mapping's microseconds a vertex; and how many times as
    long as in the canonical pose the edges become in their worst pose."""

    mean_mm: float
    median_mm: float
    p95_mm: float
    mapping_us: float
    stretch_p999: float
    stretch_max: float


def rotations(name: str, joint_names: tuple[str, ...]) -> Float64[np.ndarray, "J 3"]:
    """Axis-angle of a pose of the table for a skeleton."""
    angles = np.zeros((len(joint_names), 3))
    for joint, degrees in TABLE[name].items():
        if joint in joint_names:
            angles[joint_names.index(joint)] = np.radians(degrees)
    return angles


def posed_error(
    surface: Surface, skin: Skin, attachment: Attachment, avatar: AvatarFields, nearest: int = 1
) -> PosedError:
    """Distance between canonical vertices and their way there and back, over the table's poses."""
    body, T_pose = avatar.body, np.zeros((len(avatar.body.parents), 3))
    rest = to_rest(surface, skin, attachment, body, avatar.betas, T_pose, on_ground=False)
    weights = skin.dense(len(body.parents))
    shaped = shape(body.source, avatar.betas)
    errors, seconds = [], 0.0
    edges = directed_edges(surface.faces)
    longest = np.zeros(len(edges))
    for name in TABLE:
        posed = pose(body.source, shaped, rotations(name, body.joint_names))
        bent = skin_points(rest.vertices, weights, posed.T_posed_rest)
        longest = np.maximum(longest, edge_lengths(Surface(vertices=bent, faces=surface.faces), edges))
        started = time.perf_counter()
        back = carry_back(bent, posed, nearest)
        seconds += time.perf_counter() - started
        errors.append(1000 * np.linalg.norm(back - surface.vertices, axis=1))
    error = np.concatenate(errors)
    stretch = longest / np.maximum(edge_lengths(surface, edges), SHORTEST)
    return PosedError(
        mean_mm=float(error.mean()),
        median_mm=float(np.median(error)),
        p95_mm=float(np.quantile(error, 0.95)),
        mapping_us=1e6 * seconds / len(error),
        stretch_p999=float(np.quantile(stretch, 0.999)),
        stretch_max=float(stretch.max()),
    )


def carry_back(bent: Float[np.ndarray, "V 3"], posed: PosedBody, nearest: int) -> Float64[np.ndarray, "V 3"]:
    """Posed points to the canonical space, by the generator's mapping."""
    canonical, _ = canonical_map(posed)(torch.from_numpy(bent), nearest)
    return canonical.numpy().astype(np.float64)
