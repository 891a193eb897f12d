"""A person as layers worn one over another: distance and colour at canonical points.

Layers from the skin outward. Each is a closed volume; what lies beneath one stays inside it, except near its
edges, where a sleeve lets an arm out. A point is asked of the outermost layers first: where one covers what
is beneath, that is not asked.

Letters: N points, M of them asked, L garments, V body vertices. Metres.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol, runtime_checkable

import numpy as np
import torch
from jaxtyping import Bool, Float, Float32, Float64

from avatargen.body.distance import BodyDistance, BodyHit
from avatargen.body.model import CanonicalBody
from avatargen.compiled import compiled, inner
from avatargen.wardrobe.lips import between_lips

GAP = 0.003  # m that a layer stays inside the one over it
EDGE_ZONE = 0.012  # m along the cloth from an edge, where what is beneath may come out
LOOSE = 0.04  # m that it may come out at the edge itself
CATCH = 0.025  # m outside a garment that what sticks out is still cut off
SEAM = 0.0006  # m, softness of the colour's edge between layers
AHEAD = 0.0015  # m that the layer beneath must come out to be seen: where both lie together, cloth is
HEM = 0.0005  # m of way to an edge under which a point is on the inside of a hem
HEM_SHADE = 0.75  # inside a hem it is dark
ASKED = 0.045  # m; a layer farther than this changes nothing but how far the nearest one is
SUNK, SUNK_NEAR = 0.0045, 0.0025  # m that loose hair stays under what it lies on, and up to how far over it
BRIM = 0.008  # m under a hat's edge that hair ends: brims hang lower in front
PRESSED = 0.006  # m that hair stands off the head at a hat's edge
SPREAD, FREE = 0.35, 0.05  # more for each m away from it, and m from where on it hangs free
CORE = 0.02  # m under the skin from which the body is solid, whatever is worn: nothing falls apart there
FAR = 1.0  # m: the distance of what was not asked
UNSEEN = 30 * SEAM  # m under the other of two layers, from where one adds nothing to the colour
SINGLE = np.float32  # what layers say has single precision, and so has what is made of it


@dataclass(frozen=True, kw_only=True, eq=False)
class Cloth:
    """A layer at some points: signed distance (m), way along the cloth to its nearest edge (m), sRGB. Hair
    has 0 in place of a way where it grows, and 1 where it is loose."""

    distance: Float[np.ndarray, " M"]
    rim: Float[np.ndarray, " M"]
    color: Float[np.ndarray, "M 3"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Opening:
    """The plane of a hat's edge: a point of it, m, and its unit normal, which points into the hat."""

    at: Float64[np.ndarray, "3"]
    up: Float64[np.ndarray, "3"]

    def above(self, points: Float32[np.ndarray, "N 3"]) -> Float64[np.ndarray, " N"]:
        """Metres that points lie on the hat's side of it."""
        return (points - self.at) @ self.up


@runtime_checkable
class Layer(Protocol):
    """One thing worn."""

    @property
    def kind(self) -> str:
        """What it is: top, bottom, ..., hair."""
        ...

    @property
    def opening(self) -> Opening | None:
        """Of a hat, under which hair stays."""
        ...

    @property
    def hidden(self) -> Bool[np.ndarray, " V"]:
        """The body's vertices that it hides."""
        ...

    def least(self, points: Float32[np.ndarray, "N 3"]) -> Float32[np.ndarray, " N"]:
        """Metres that it is away from each point at least."""
        ...

    def cloth(self, points: Float32[np.ndarray, "M 3"], hit: BodyHit, *, coloured: bool) -> Cloth:
        """What it is at points whose closest points on the body are given."""
        ...


@runtime_checkable
class Skin(Protocol):
    """The bare body's colours."""

    def color(self, points: Float32[np.ndarray, "N 3"], hit: BodyHit) -> Float[np.ndarray, "N 3"]: ...

    def relief(self, points: Float32[np.ndarray, "N 3"]) -> Float[np.ndarray, " N"]:
        """Metres by which it stands out of the body, as under a beard."""
        ...


def chosen(hit: BodyHit, index: np.ndarray) -> BodyHit:
    """Some of the points."""
    return BodyHit(distance=hit.distance[index], face=hit.face[index], barycentric=hit.barycentric[index])


@dataclass(frozen=True, kw_only=True, eq=False)
class DressedField:
    """One person's distance and colour. `garments` come from the skin outward, `hair` lies over them.

    Where the body is another than the one that the layers fit, `fitted` is that one's distance and `offset`
    moves points to it.
    """

    body: CanonicalBody  # that the layers fit
    distance: BodyDistance
    skin: Skin
    garments: tuple[Layer, ...]
    hair: Layer | None
    fitted: BodyDistance | None = None
    offset: Float32[np.ndarray, "3"]

    @property
    def device(self) -> torch.device:
        return torch.device("cpu")

    @cached_property
    def hidden(self) -> Float32[np.ndarray, " V"]:
        """1 at the body's vertices that garments hide."""
        hidden = np.zeros(len(self.body.vertices), dtype=bool)
        for garment in self.garments:
            hidden |= garment.hidden
        return hidden.astype(np.float32)

    def sdf(self, points: Float32[np.ndarray, "N 3"]) -> Float32[np.ndarray, " N"]:
        """Signed distance to the clothed surface, m, negative inside."""
        return self.laid(points, coloured=False)[0].astype(np.float32)

    def color(self, points: Float32[np.ndarray, "N 3"]) -> Float32[np.ndarray, "N 3"]:
        """Colour at points on or near the surface, sRGB."""
        return self.laid(points, coloured=True)[1].astype(np.float32)

    def laid(
        self, points: Float32[np.ndarray, "N 3"], *, coloured: bool
    ) -> tuple[Float64[np.ndarray, " N"], Float64[np.ndarray, "N 3"]]:
        """The layers laid over one another."""
        hit, moved = self.closest(points)
        open_to_air = np.ones(len(points), dtype=bool)  # what is beneath has to be asked
        laid: list[Cloth] = []
        for garment in reversed(self.garments):
            cloth = asked(garment, moved, hit, open_to_air, coloured=coloured)
            open_to_air &= ~covers(cloth)
            laid.insert(0, cloth)
        bare = np.empty(len(points), np.float32)
        share_bare(self.hidden, self.body.faces, hit.face, hit.barycentric, bare)
        naked = open_to_air | (bare > 1e-6)  # a hand before a hip is not hidden by what hides the hip
        distance = np.where(naked, self.bare_distance(moved, hit), FAR)
        colour = np.full((len(points), 3), 0.5)
        seen = np.flatnonzero(naked) if coloured else np.zeros(0, np.int64)
        if len(seen):
            colour[seen] = self.skin.color(moved[seen], chosen(hit, seen))
        if laid:
            outer, rim = (np.stack([getattr(cloth, name) for cloth in laid]) for name in ("distance", "rim"))
            dye = np.stack([cloth.color for cloth in laid])
            lay_garments(distance, colour, bare, outer, rim, dye, coloured)
        distance = np.minimum(distance, hit.distance + CORE)
        if self.hair is not None:
            hair = asked(self.hair, moved, hit, np.ones(len(points), dtype=bool), coloured=coloured)
            strands = hair.distance.astype(np.float64)
            for garment, cloth in zip(self.garments, laid, strict=True):
                if garment.opening is not None:
                    above = garment.opening.above(moved)
                    strands = under_hat(strands, cloth.distance, above, hit.distance)
            lay_hair(distance, colour, strands, hair.rim, hair.color, coloured)
        return distance, colour

    def bare_distance(self, moved: Float32[np.ndarray, "N 3"], hit: BodyHit) -> Float64[np.ndarray, " N"]:
        """To the skin, with lips that meet and a beard."""
        return hit.distance - between_lips(moved) - self.skin.relief(moved)

    def closest(self, points: Float32[np.ndarray, "N 3"]) -> tuple[BodyHit, Float32[np.ndarray, "N 3"]]:
        """The body at points, and the points where the layers know them."""
        hit = self.distance.query_in_order(points)
        if self.fitted is None:
            return hit, points
        moved = points + self.offset
        other = self.fitted.query_in_order(moved)
        return BodyHit(distance=hit.distance, face=other.face, barycentric=other.barycentric), moved


def asked(
    layer: Layer,
    points: Float32[np.ndarray, "N 3"],
    hit: BodyHit,
    wanted: Bool[np.ndarray, " N"],
    *,
    coloured: bool,
) -> Cloth:
    """A layer at the points where it is wanted and can be near; elsewhere how far it is at least."""
    distance = layer.least(points).astype(np.float32)
    rim, colour = np.zeros(len(points), np.float32), np.full((len(points), 3), 0.5, np.float32)
    index = np.flatnonzero(wanted & (distance < ASKED))
    distance[~wanted] = FAR
    if len(index):
        found = layer.cloth(points[index], chosen(hit, index), coloured=coloured)
        distance[index], rim[index] = found.distance, found.rim
        if coloured:
            colour[index] = found.color
    return Cloth(distance=distance, rim=rim, color=colour)


def covers(cloth: Cloth) -> Bool[np.ndarray, " M"]:
    """Where nothing beneath can be seen."""
    return (cloth.rim > EDGE_ZONE) & (cloth.distance < CATCH)


def under_hat(
    hair: Float64[np.ndarray, " N"], hat: np.ndarray, above: np.ndarray, body: np.ndarray
) -> Float64[np.ndarray, " N"]:
    """Hair with a hat over it: what is `above` (m) the hat's edge, or just under it, stays inside, and lower
    down it spreads from what the hat presses on the `body` (m)."""
    away = np.abs(above)
    pressed = body - PRESSED - SPREAD * away * (1 + away / FREE)
    return np.maximum(np.maximum(hair, pressed), np.minimum(hat + GAP, above + BRIM))


@compiled
def share_bare(hidden, faces, face, barycentric, bare):
    """Fill in how far each body point [N] (a face and weights [N 3]) is bare: 1 less what is `hidden` [V]."""
    for i in range(len(face)):
        a, b, c = faces[face[i], 0], faces[face[i], 1], faces[face[i], 2]
        cover = hidden[a] * barycentric[i, 0] + hidden[b] * barycentric[i, 1] + hidden[c] * barycentric[i, 2]
        bare[i] = SINGLE(1) - cover


@inner
def near_edges(rim):
    """1 at the edges of a garment, where what is beneath may come out, 0 away from them."""
    return SINGLE(1) - min(max(rim / SINGLE(EDGE_ZONE), SINGLE(0)), SINGLE(1))


@inner
def kept_inside(beneath, outer, free):
    """What lies `beneath` a layer (m), cut off where it would come out of it and is not `free` (1) to."""
    caught = SINGLE(4) * max(outer - SINGLE(CATCH), SINGLE(0))
    return max(beneath, outer + SINGLE(GAP) - SINGLE(LOOSE) * free - caught)


@inner
def seen_over(outer, beneath, ahead):
    """How much is seen of the outer of two layers (m): that which is further out, which the one beneath must
    be by `ahead` (m)."""
    return 1 / (1 + math.exp(min(max((outer - beneath - ahead) / SEAM, -30.0), 30.0)))


@compiled
def lay_garments(distance, colour, bare, outer, rim, dye, coloured):
    """Lay garments, from the skin outward, over what is in `distance` [N] and, where `coloured`, `colour` [N
    3].

    `outer` and `rim` [L N] their distances and ways to an edge, `dye` [L N 3] their colours; `bare` [N] how
    far the body beneath is.
    """
    count = len(outer)
    for i in range(len(distance)):
        found = distance[i]
        for k in range(count):
            found = kept_inside(found, outer[k, i], max(bare[i], near_edges(rim[k, i])))
        for k in range(count):
            layer = np.float64(outer[k, i])
            for over in range(k + 1, count):
                layer = kept_inside(layer, outer[over, i], near_edges(rim[over, i]))
            if coloured and layer - found < UNSEEN + AHEAD:
                within = rim[k, i] > SINGLE(HEM)  # a hem's inside is no cloth
                seen = seen_over(layer, found, AHEAD if within else 0.0)
                for c in range(3):
                    shaded = dye[k, i, c] * (1.0 if within else HEM_SHADE)
                    colour[i, c] += (shaded - colour[i, c]) * seen
            found = min(found, layer)
        distance[i] = found


@compiled
def lay_hair(distance, colour, strands, loose, dye, coloured):
    """Lay hair, `strands` [N] away, over what is in `distance` [N] and, where `coloured`, `colour` [N 3].
    `loose` [N] is 0 where it grows, 1 where it only lies on something."""
    for i in range(len(distance)):
        beneath = distance[i]
        if strands[i] - beneath < UNSEEN:
            # stray hairs are no skin's colour
            hair = strands[i] + loose[i] * SUNK * math.exp(-((beneath / SUNK_NEAR) ** 2))
            distance[i] = min(beneath, hair)
            if coloured:
                seen = seen_over(hair, beneath, 0.0)
                for c in range(3):
                    colour[i, c] += (dye[i, c] - colour[i, c]) * seen
