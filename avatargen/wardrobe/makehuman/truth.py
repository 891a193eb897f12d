"""What learning asks of a garment, or of hair: how far points are from it, where its surface is seen and what
colour it has there. Colours are the artist's own.

Letters: N points. Metres; negative inside.
"""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float32, Float64, Int64

from avatargen.wardrobe.makehuman.person import ArtistGarment
from avatargen.wardrobe.makehuman.strands import Strands

NEAR, AROUND = 0.0015, 0.010  # m from the surface, of two kinds of points
AIR = 0.003  # m before the cloth that are free where it is seen
STEP = 5e-4  # m, of a distance's slope
APART = 1.0  # m: nothing has an edge nearer than this


@runtime_checkable
class Truth(Protocol):
    """A garment that can be learned."""

    @property
    def box(self) -> Float64[np.ndarray, "2 3"]:
        """Its corners, m."""
        ...

    def ask(
        self, points: Float32[np.ndarray, "N 3"]
    ) -> tuple[Float32[np.ndarray, " N"], Float32[np.ndarray, " N"]]:
        """Signed distance, and way along the cloth to an edge, m."""
        ...

    def seen(
        self, count: int, rng: np.random.Generator
    ) -> tuple[Float32[np.ndarray, "N 3"], Float64[np.ndarray, "N C"]]:
        """At most `count` points of the surface, as far as it is seen, and their colours: sRGB and how far a
        dye takes, or shades of hair."""
        ...

    def surface(self, count: int, rng: np.random.Generator) -> Float64[np.ndarray, "N 3"]:
        """Points of the surface."""
        ...


@dataclass(frozen=True, kw_only=True, eq=False)
class ClothTruth:
    """Of cloth."""

    made: ArtistGarment

    @property
    def box(self) -> Float64[np.ndarray, "2 3"]:
        vertices = self.made.solid.garment.vertices.astype(np.float64)
        return np.stack([vertices.min(axis=0), vertices.max(axis=0)])

    def ask(
        self, points: Float32[np.ndarray, "N 3"]
    ) -> tuple[Float32[np.ndarray, " N"], Float32[np.ndarray, " N"]]:
        hit = self.made.solid.hit(points, reach=1.0)
        return hit.distance, hit.rim

    def seen(
        self, count: int, rng: np.random.Generator
    ) -> tuple[Float32[np.ndarray, "N 3"], Float64[np.ndarray, "N C"]]:
        garment = self.made.solid.garment
        face, weights = drawn_on(garment.vertices, garment.faces, count, rng)
        seen = self.in_the_open(face, weights)
        face, weights = face[seen], weights[seen]
        points = np.einsum("nk,nka->na", weights, garment.vertices[garment.faces[face]])
        color = self.made.own(np.einsum("nk,nka->na", weights, garment.uv[face]))
        return points.astype(np.float32), color if (color[:, 3] < 1).any() else color[:, :3]

    def in_the_open(
        self, face: Int64[np.ndarray, " N"], weights: Float64[np.ndarray, "N 3"]
    ) -> Bool[np.ndarray, " N"]:
        """Whether there is air before a point of the cloth: not on what lies under another piece of it."""
        garment = self.made.solid.garment
        corners = garment.vertices.astype(np.float64)[garment.faces[face]]
        out = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        out /= np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-12)
        before = np.einsum("nk,nka->na", weights, corners) + AIR * out
        return self.ask(before.astype(np.float32))[0] > 0.6 * AIR

    def surface(self, count: int, rng: np.random.Generator) -> Float64[np.ndarray, "N 3"]:
        garment = self.made.solid.garment
        face, weights = drawn_on(garment.vertices, garment.faces, count, rng)
        return np.einsum("nk,nka->na", weights, garment.vertices.astype(np.float64)[garment.faces[face]])


@dataclass(frozen=True, kw_only=True, eq=False)
class HairTruth:
    """Of hair: it has no edges."""

    strands: Strands

    @property
    def box(self) -> Float64[np.ndarray, "2 3"]:
        points, _ = self.strands.samples
        return np.stack([points.min(axis=0), points.max(axis=0)])

    def ask(
        self, points: Float32[np.ndarray, "N 3"]
    ) -> tuple[Float32[np.ndarray, " N"], Float32[np.ndarray, " N"]]:
        return self.strands.distance(points), np.full(len(points), APART, np.float32)

    def seen(
        self, count: int, rng: np.random.Generator
    ) -> tuple[Float32[np.ndarray, "N 3"], Float64[np.ndarray, "N C"]]:
        points = self.surface(count, rng).astype(np.float32)
        return points, self.strands.shade(points)[:, None].astype(np.float64)

    def surface(self, count: int, rng: np.random.Generator) -> Float64[np.ndarray, "N 3"]:
        """By steps of the distance."""
        samples, _ = self.strands.samples
        points = samples[rng.integers(len(samples), size=count)] + rng.normal(size=(count, 3)) * 0.004
        ask = self.strands.distance
        for _ in range(3):
            slope = np.stack([ask(points + step) - ask(points - step) for step in np.eye(3) * STEP])
            slope = slope.T / (2 * STEP)
            length = np.maximum(np.linalg.norm(slope, axis=1, keepdims=True), 0.3)
            points = points - ask(points)[:, None] * slope / length**2
        return points


def drawn_on(
    vertices: np.ndarray, faces: np.ndarray, count: int, rng: np.random.Generator
) -> tuple[Int64[np.ndarray, " N"], Float64[np.ndarray, "N 3"]]:
    """Faces and weights of random points on triangles, evenly over their area."""
    corners = vertices[faces].astype(np.float64)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    face = rng.choice(len(area), size=count, p=area / area.sum())
    return face.astype(np.int64), rng.dirichlet((1.0, 1.0, 1.0), size=count)


def about(truth: Truth, count: int, rng: np.random.Generator) -> Float32[np.ndarray, "N 3"]:
    """Points about a garment's surface, half of them close to it."""
    points = truth.surface(count, rng)
    spread = np.where(np.arange(count) % 2 == 0, NEAR, AROUND)[:, None] / np.sqrt(3)
    return (points + rng.normal(size=(count, 3)) * spread).astype(np.float32)
