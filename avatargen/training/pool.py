"""The pool of canonical points the warm start draws from: near the body, densest on the head, and where
skirts and hair hang.
"""

import io
from dataclasses import fields
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from avatargen.atomic import write_atomically
from avatargen.body.arrays import read_npz
from avatargen.body.model import CanonicalBody
from avatargen.errors import InputError
from avatargen.generator.config import body_hash
from avatargen.wardrobe import MARKS
from avatargen.wardrobe.chart import Chart, Places

CHANNELS = {
    "p": (3,),
    "body": (),
    "closed": (),
    "shod": (),
    "leg": (3,),
    "eye": (),
    "corners": (3,),
    "barycentric": (3,),
}  # of `Places`, and what each holds for a place
NUMBERS = 16  # of a place
ROOM = 1000  # numbers, for the headers of a pool's file
HEAD_DENSITY = 6.0  # points per area on the head over those elsewhere
# boxes (low, high, metres) where cloth or hair hangs off the body, and their shares of the pool
HANGING = (
    ((-0.62, -0.86, -0.32), (0.62, 0.20, 0.34), 0.16),
    ((-0.16, 0.20, -0.20), (0.16, 0.88, 0.20), 0.08),
    ((-1.00, -1.05, -0.36), (1.00, 0.95, 0.40), 0.02),
)


def near_body(body: CanonicalBody, count: int, rng: np.random.Generator) -> Float[np.ndarray, "N 3"]:
    """Points scattered along the normals of random surface points: most within a centimetre, some to five."""
    corners = body.vertices[body.faces].astype(np.float64)
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(cross, axis=1)
    head = body.weights[body.faces, body.joint_names.index("head")].mean(1)
    chance = area * (1 + (HEAD_DENSITY - 1) * head)
    face = rng.choice(len(area), size=count, p=chance / chance.sum())
    barycentric = rng.dirichlet((1, 1, 1), size=count)
    offset = np.where(
        rng.random(count) < 0.7, rng.normal(0.004, 0.009, count), rng.uniform(-0.02, 0.055, count)
    )
    normal = cross[face] / np.maximum(area[face, None], 1e-20)
    return (corners[face] * barycentric[:, :, None]).sum(1) + offset[:, None] * normal


def pool_points(body: CanonicalBody, count: int, seed: int) -> Float[np.ndarray, "N 3"]:
    """Points of the pool, metres; those deep inside the body are of no use and left out by `make_pool`."""
    rng = np.random.default_rng(seed)
    parts = [rng.uniform(low, high, size=(int(count * share), 3)) for low, high, share in HANGING]
    parts.append(near_body(body, count - sum(map(len, parts)), rng))
    return np.concatenate(parts).astype(np.float32)


def hangs(points: Float[Tensor, "N 3"]) -> Bool[Tensor, " N"]:
    """Whether a point lies in the box that skirts and coats reach."""
    low, high, _ = HANGING[0]
    return ((points > torch.tensor(low)) & (points < torch.tensor(high))).all(dim=1)


def make_pool(body: CanonicalBody, count: int, seed: int, deepest: float = 0.025) -> Places:
    """Places of the pool: all channels, computed once."""
    places = Chart(body, MARKS).places(pool_points(body, count, seed))
    return places[places.body > -deepest]


def cached_pool(path: Path, body: CanonicalBody, count: int, seed: int) -> Places:
    """The pool of `count` points from its file, or made and written there.

    Raises:
        InputError: the file is damaged, or holds a pool of another size, seed or body.
    """
    names = tuple(f.name for f in fields(Places))
    made_from = f"{count} points, seed {seed}, body {body_hash(body)}"
    if path.exists():
        arrays = read_npz(path, (*names, "made_from"), what="pool", most=count * NUMBERS + ROOM)
        found = str(arrays.pop("made_from", "it does not say what"))
        if found != made_from:
            raise InputError(f"pool: {path} is of {found}, wanted {made_from}; remove it to make another")
        shapes = {name: arrays[name].shape[1:] for name in names if name in arrays}
        if shapes != CHANNELS or len({len(array) for array in arrays.values()}) > 1:
            raise InputError(f"pool: {path} lacks a channel of its points; remove it, and it is made anew")
        return Places(**{name: torch.from_numpy(array) for name, array in arrays.items()})
    pool = make_pool(body, count, seed)
    stream = io.BytesIO()
    arrays = {name: getattr(pool, name).numpy() for name in names}
    np.savez(stream, made_from=np.array(made_from), **arrays)
    write_atomically(path, stream.getvalue())
    return pool
