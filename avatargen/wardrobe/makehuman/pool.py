"""Points near a garment for learning it: distances, colours, way to an edge, places on the cloth and on the
body, all computed once. Colours are the artist's own.
"""

from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np
from jaxtyping import Bool, Float32, Float64, Int64

from avatargen.body.distance import BodyDistance, BodyHit
from avatargen.errors import InputError
from avatargen.wardrobe.makehuman.load import FittedGarment
from avatargen.wardrobe.makehuman.pattern import pattern_places
from avatargen.wardrobe.makehuman.solid import Solid
from avatargen.wardrobe.makehuman.strands import Strands

NEAR, AROUND, WIDE = 0.0015, 0.010, 0.035  # m from the cloth, of three kinds of points
SHARES = (0.35, 0.2, 0.2, 0.2, 0.05)  # of these, of points at its openings, and in a box around it
DEEP = 0.03  # m that points at an opening lie inward of its edge at most
BOX = 0.10  # m around a garment
AIR = 0.003  # m before the cloth that are free where it is seen
STEP = 5e-4  # m, of a distance's slope

Own = Callable[[np.ndarray], np.ndarray]  # colours [N 4] of texture coordinates [N 2]


@dataclass(frozen=True, kw_only=True)
class PointPool:
    """N canonical points with what a garment is there. Of hair, `color` is the shade of its strands."""

    points: Float32[np.ndarray, "N 3"]  # m
    distance: Float32[np.ndarray, " N"]  # m, negative inside
    color: Float32[np.ndarray, "N 4"]  # sRGB 0..1 of the nearest texel, and how far a dye takes
    sewn: Float32[np.ndarray, "N 3"]  # m: way to an edge; place along and across the cloth
    body: Float32[np.ndarray, " N"]  # m, distance to the body
    face: Int64[np.ndarray, " N"]  # of the body, with the closest point
    barycentric: Float32[np.ndarray, "N 3"]  # of that point

    def __post_init__(self) -> None:
        if not all(np.isfinite(getattr(self, each.name)).all() for each in fields(self)):
            raise InputError("wardrobe: a garment's pool holds NaN or infinity; check its files")


def drawn_on(
    vertices: np.ndarray, faces: np.ndarray, count: int, rng: np.random.Generator
) -> tuple[Int64[np.ndarray, " N"], Float64[np.ndarray, "N 3"]]:
    """Faces and weights of random points on triangles, evenly over their area."""
    corners = vertices[faces].astype(np.float64)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    face = rng.choice(len(area), size=count, p=area / area.sum())
    return face.astype(np.int64), rng.dirichlet((1.0, 1.0, 1.0), size=count)


def on_faces(
    vertices: np.ndarray, faces: np.ndarray, count: int, rng: np.random.Generator
) -> Float64[np.ndarray, "N 3"]:
    """Random points on triangles, evenly over their area."""
    face, weights = drawn_on(vertices, faces, count, rng)
    return np.einsum("nk,nka->na", weights, vertices[faces].astype(np.float64)[face])


def surface_colors(
    garment: FittedGarment, own: Own, body: BodyDistance, count: int, seed: int = 0
) -> tuple[Float32[np.ndarray, "N 4"], BodyHit]:
    """Colours at points on a garment's surface, as far as it is seen, with the closest points on the body."""
    rng = np.random.default_rng(seed)
    if garment.kind == "hair":
        hair = Strands(garment=garment, body=body)
        points = hair_surface(hair, count, rng)
        color = np.repeat(hair.shade(points.astype(np.float32))[:, None], 4, axis=1)
    else:
        face, weights = drawn_on(garment.vertices, garment.faces, count, rng)
        seen = in_the_open(Solid(garment=garment), face, weights)
        face, weights = face[seen], weights[seen]
        points = np.einsum("nk,nka->na", weights, garment.vertices.astype(np.float64)[garment.faces[face]])
        color = own(np.einsum("nk,nka->na", weights, garment.uv[face]))
    return color.astype(np.float32), body.query(points.astype(np.float32))


def in_box(cloud: np.ndarray, count: int, rng: np.random.Generator) -> Float64[np.ndarray, "N 3"]:
    """Random points in the box around a cloud and BOX further."""
    return rng.uniform(cloud.min(axis=0) - BOX, cloud.max(axis=0) + BOX, size=(count, 3))


def counts(whole: int) -> list[int]:
    """How many points of each kind."""
    return [round(share * whole) for share in SHARES]


def near_cloth(solid: Solid, count: int, rng: np.random.Generator) -> Float32[np.ndarray, "N 3"]:
    """Points about a garment of cloth."""
    garment = solid.garment
    near, around, wide, at_openings, apart = counts(count)
    parts = [at_edges(solid, at_openings, rng), in_box(garment.vertices, apart, rng)]
    for number, spread in ((near, NEAR), (around, AROUND), (wide, WIDE)):
        on_cloth = on_faces(garment.vertices, garment.faces, number, rng)
        parts.append(on_cloth + rng.normal(size=(number, 3)) * spread / np.sqrt(3))
    return np.concatenate(parts).astype(np.float32)


def at_edges(solid: Solid, count: int, rng: np.random.Generator) -> Float64[np.ndarray, "N 3"]:
    """Points about the lids of the openings, near their edges, evenly along these; none where there are
    none."""
    vertices = solid.garment.vertices.astype(np.float64)
    if not solid.loops:
        return np.zeros((0, 3))
    start = np.concatenate([vertices[loop] for loop in solid.loops])
    end = np.concatenate([vertices[np.roll(loop, -1)] for loop in solid.loops])
    centre = np.concatenate([np.tile(vertices[loop].mean(axis=0), (len(loop), 1)) for loop in solid.loops])
    length = np.linalg.norm(end - start, axis=1)
    edge = rng.choice(len(length), size=count, p=length / length.sum())
    on_edge = start[edge] + (end - start)[edge] * rng.random((count, 1))
    inward = centre[edge] - on_edge
    inward /= np.maximum(np.linalg.norm(inward, axis=1, keepdims=True), 1e-9)
    spread = np.where(rng.random((count, 1)) < 0.5, NEAR, AROUND / 2) / np.sqrt(3)
    return on_edge + inward * rng.uniform(0, DEEP, (count, 1)) + rng.normal(size=(count, 3)) * spread


def near_hair(hair: Strands, count: int, rng: np.random.Generator) -> Float32[np.ndarray, "N 3"]:
    """Points about the surface of hair's volume."""
    near, around, wide, at_openings, apart = counts(count)
    total = near + around + wide + at_openings
    points = hair_surface(hair, total, rng)
    spread = np.repeat([NEAR, AROUND, WIDE], [near, around + at_openings, wide])
    points = points + rng.normal(size=(total, 3)) * spread[:, None] / np.sqrt(3)
    return np.concatenate([points, in_box(hair.samples[0], apart, rng)]).astype(np.float32)


def hair_surface(hair: Strands, total: int, rng: np.random.Generator) -> Float64[np.ndarray, "N 3"]:
    """Points on the surface of hair's volume, by steps of its distance."""
    samples, _ = hair.samples
    points = samples[rng.integers(len(samples), size=total)] + rng.normal(size=(total, 3)) * 0.004
    for _ in range(3):
        slope = np.stack(
            [hair.distance(points + step) - hair.distance(points - step) for step in np.eye(3) * STEP]
        )
        slope = slope.T / (2 * STEP)
        length = np.maximum(np.linalg.norm(slope, axis=1, keepdims=True), 0.3)
        points = points - hair.distance(points)[:, None] * slope / length**2
    return points


def in_the_open(
    solid: Solid, face: Int64[np.ndarray, " N"], weights: Float64[np.ndarray, "N 3"]
) -> Bool[np.ndarray, " N"]:
    """Whether there is air before a point of the cloth: not on what lies under another piece of it."""
    corners = solid.garment.vertices.astype(np.float64)[solid.garment.faces[face]]
    out = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    out /= np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-12)
    before = np.einsum("nk,nka->na", weights, corners) + AIR * out
    return np.asarray(solid.hit(before.astype(np.float32), reach=1.0).distance > 0.6 * AIR)


def make_pool(
    garment: FittedGarment,
    own: Own,
    body: BodyDistance,
    count: int,
    seed: int = 0,
) -> PointPool:
    """Points near a garment, with what it is there, and their places on the body. `own` gives its colours at
    texture coordinates."""
    rng = np.random.default_rng(seed)
    if garment.kind == "hair":
        hair = Strands(garment=garment, body=body)
        points = near_hair(hair, count, rng)
        distance, color = hair.distance(points), np.repeat(hair.shade(points)[:, None], 4, axis=1)
        sewn = np.tile(np.array([1.0, 0, 0], np.float32), (len(points), 1))
    else:
        solid = Solid(garment=garment)
        points = near_cloth(solid, count, rng)
        hit = solid.hit(points, reach=1.0)
        uv = np.einsum("nk,nka->na", hit.barycentric, garment.uv[hit.face])
        distance = hit.distance
        color = own(uv).astype(np.float32)
        place = np.einsum("nk,nka->na", hit.barycentric, pattern_places(garment)[hit.face])
        sewn = np.column_stack([hit.rim, place]).astype(np.float32)
    on_body = body.query(points)
    return PointPool(
        points=points,
        distance=distance,
        color=color,
        sewn=sewn,
        body=on_body.distance,
        face=on_body.face,
        barycentric=on_body.barycentric,
    )
