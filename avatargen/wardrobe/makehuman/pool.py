"""Points near a garment for training, made once and kept in a folder.

A network that learns a garment asks the same points many thousand times, on a GPU that has no trees. So their
distances, colours and places on the body are computed once. Colours are the artist's own.
"""

import hashlib
import io
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from jaxtyping import Float32, Int64

from avatargen.atomic import write_atomically
from avatargen.body.arrays import read_npz
from avatargen.body.distance import BodyDistance
from avatargen.errors import InputError
from avatargen.wardrobe.makehuman.load import FittedGarment
from avatargen.wardrobe.makehuman.pattern import padded, used_texels
from avatargen.wardrobe.makehuman.solid import Solid
from avatargen.wardrobe.makehuman.strands import Strands
from avatargen.wardrobe.makehuman.texture import texels

SPREAD = (0.002, 0.010)  # m: half of the points lie about so near to the cloth, the others so far


@dataclass(frozen=True, kw_only=True)
class PointPool:
    """N canonical points with what a garment is there. Of hair, `color` is the shade of its strands."""

    points: Float32[np.ndarray, "N 3"]  # m
    distance: Float32[np.ndarray, " N"]  # m, negative inside
    color: Float32[np.ndarray, "N 3"]  # sRGB 0..1, of the nearest texel
    face: Int64[np.ndarray, " N"]  # of the body, with the closest point
    barycentric: Float32[np.ndarray, "N 3"]  # of that point

    def __post_init__(self) -> None:
        if not all(np.isfinite(getattr(self, each.name)).all() for each in fields(self)):
            raise InputError("wardrobe: a pool holds NaN or infinity; delete its file, it is made again")


def near_garment(garment: FittedGarment, count: int, seed: int) -> Float32[np.ndarray, "N 3"]:
    """Random points about a garment, evenly over its area."""
    rng = np.random.default_rng(seed)
    corners = garment.vertices[garment.faces].astype(np.float64)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    face = rng.choice(len(area), size=count, p=area / area.sum())
    share = rng.dirichlet((1.0, 1.0, 1.0), size=count)
    away = rng.normal(size=(count, 3)) * np.where(rng.random((count, 1)) < 0.5, *SPREAD)
    return (np.einsum("nk,nka->na", share, corners[face]) + away).astype(np.float32)


def make_pool(garment: FittedGarment, body: BodyDistance, count: int, seed: int = 0) -> PointPool:
    """Points near a garment, with its distance and colour and their places on the body."""
    points = near_garment(garment, count, seed)
    if garment.kind == "hair":
        hair = Strands(garment=garment, body=body)
        distance, color = hair.distance(points), np.repeat(hair.shade(points)[:, None], 3, axis=1)
    else:
        hit = Solid(garment=garment).hit(points, reach=1.0)
        uv = np.einsum("nk,nka->na", hit.barycentric, garment.uv[hit.face])
        distance = hit.distance
        color = texels(padded(garment.texture, used_texels(garment)), uv)[:, :3].astype(np.float32)
    place = body.query(points)
    return PointPool(
        points=points, distance=distance, color=color, face=place.face, barycentric=place.barycentric
    )


def load_pool(garment: FittedGarment, body: BodyDistance, count: int, folder: Path) -> PointPool:
    """The pool of a garment from a folder, where it is made if it is not there.

    Raises:
        InputError: a file there is damaged, or the folder cannot be written.
    """
    digest = hashlib.sha256(garment.vertices.tobytes() + garment.texture.tobytes()).hexdigest()[:12]
    path = folder / f"{garment.name}_{count}_{digest}.npz"
    names = tuple(each.name for each in fields(PointPool))
    if not path.is_file():
        pool = make_pool(garment, body, count)
        buffer = io.BytesIO()
        np.savez(buffer, allow_pickle=False, **{name: getattr(pool, name) for name in names})
        folder.mkdir(parents=True, exist_ok=True)
        write_atomically(path, buffer.getvalue())
        return pool
    found = read_npz(path, names, "wardrobe pool")
    if missing := [name for name in names if name not in found]:
        raise InputError(f"wardrobe pool: {path} lacks {', '.join(missing)}; delete it, it is made again")
    return PointPool(**found)
