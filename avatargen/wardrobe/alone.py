"""A dressed person layer by layer: the body, each garment and the hair, each with a distance and a colour of
its own.

A layer lies where it lies on the whole person: inside what is worn over it but for its edges, so that nothing
comes through at rest. A garment is a closed volume, as if filled: its openings are closed a little within, in
the shade of a hem, and what it covers can be taken away or kept. Laid over one another the layers are the
whole person.

Letters: N points, V body vertices. Metres.
"""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float32, Float64

from avatargen.body.distance import BodyHit
from avatargen.wardrobe.dressed import (
    CATCH,
    CORE,
    EDGE_ZONE,
    GAP,
    HEM,
    HEM_SHADE,
    LOOSE,
    Cloth,
    DressedField,
    Layer,
    asked,
    under_hat,
)

BODY, HAIR = "body", "hair"
FADE = 0.015  # m along the cloth, from where it begins to hide to where it surely does
SINK = 0.004  # m that it lies deeper beneath them than in one surface: moving parts need some room
OUT = 0.012  # m outside a garment at which nothing lies beneath it any more
MARGIN = 0.008  # m along the cloth from its edges that is as good as the edge: rims are learned
WIG = 0.008  # m beneath the skin down to which hair goes: deep in the head its field says nothing
DEEPEST = 0.015  # m that a layer gives way to those over it: more would tear it


@dataclass(frozen=True, kw_only=True, eq=False)
class LayerField:
    """One layer of a dressed person: the body (`layer` is None), a garment or the hair. `over` are the
    garments that lie over it, from the skin outward."""

    person: DressedField
    layer: Layer | None
    over: tuple[Layer, ...]

    @property
    def device(self) -> torch.device:
        return self.person.device

    def sdf(self, points: Float32[np.ndarray, "N 3"]) -> Float32[np.ndarray, " N"]:
        """Signed distance to the layer's closed volume, m, negative inside."""
        hit, moved = self.person.closest(points)
        if self.layer is None:
            return self.skin_distance(moved, hit).astype(np.float32)
        cloth = whole(self.layer, moved, hit, coloured=False)
        return self.cloth_distance(cloth, moved, hit).astype(np.float32)

    def color(self, points: Float32[np.ndarray, "N 3"]) -> Float32[np.ndarray, "N 3"]:
        """Colour at points on or near the layer's surface, sRGB."""
        hit, moved = self.person.closest(points)
        if self.layer is None:
            return self.person.skin.color(moved, hit).astype(np.float32)
        cloth = whole(self.layer, moved, hit, coloured=True)
        shade = 1.0 if self.layer.kind == HAIR else np.where(cloth.rim > HEM, 1.0, HEM_SHADE)[:, None]
        return (cloth.color * shade).astype(np.float32)

    def cover(self, points: Float32[np.ndarray, "N 3"]) -> Float64[np.ndarray, " N"]:
        """How surely the layer hides what lies there beneath it: 0 outside it and at its edges, 1 away from
        them."""
        if self.layer is None or self.layer.kind == HAIR:
            return np.zeros(len(points))
        hit, moved = self.person.closest(points)
        cloth = whole(self.layer, moved, hit, coloured=False)
        within = self.cloth_distance(cloth, moved, hit) < 0
        return np.where(
            within, np.clip((cloth.rim.astype(np.float64) - EDGE_ZONE - MARGIN) / FADE, 0, 1), 0.0
        )

    def skin_distance(self, moved: Float32[np.ndarray, "N 3"], hit: BodyHit) -> Float64[np.ndarray, " N"]:
        """The bare body, inside what it wears."""
        person = self.person
        bare = 1 - (person.hidden[person.body.faces[hit.face]] * hit.barycentric).sum(axis=1)
        distance = person.bare_distance(moved, hit)
        for over in self.over:
            outer = whole(over, moved, hit, coloured=False)
            free = np.maximum(bare, at_edges(outer.rim))
            distance = beneath(distance, outer, free)
        return np.minimum(distance, hit.distance + CORE)

    def cloth_distance(
        self, cloth: Cloth, moved: Float32[np.ndarray, "N 3"], hit: BodyHit
    ) -> Float64[np.ndarray, " N"]:
        """A garment inside those over it, or hair under a hat, as a wig."""
        distance = cloth.distance.astype(np.float64)
        for over in self.over:
            outer = whole(over, moved, hit, coloured=False)
            if self.layer is not self.person.hair:
                distance = beneath(distance, outer, at_edges(outer.rim))
            elif over.opening is not None:
                distance = under_hat(distance, outer.distance, over.opening.above(moved), hit.distance)
        if self.layer is self.person.hair:
            distance = np.maximum(distance, -hit.distance - WIG)
        return distance


def beneath(inner: Float64[np.ndarray, " N"], outer: Cloth, free: np.ndarray) -> Float64[np.ndarray, " N"]:
    """A layer inside one over it, and whole. It is `free` (1) at that one's edges, and where it stands far
    out, as below a hem, it is not beneath."""
    within = outer.distance + SINK + GAP - LOOSE * free
    kept = np.maximum(inner, within - 4 * np.maximum(outer.distance + SINK - CATCH, 0))
    return np.minimum(kept, inner + give(outer))


def give(outer: Cloth) -> Float64[np.ndarray, " N"]:
    """How far a layer may give way, m: less and less outside what is over it."""
    return DEEPEST * np.clip(1 - outer.distance.astype(np.float64) / OUT, 0, 1)


def at_edges(rim: np.ndarray) -> np.ndarray:
    """1 at the edges of a garment and a little within, 0 away from them."""
    return 1 - np.clip((rim - MARGIN) / EDGE_ZONE, 0, 1)


def whole(layer: Layer, points: Float32[np.ndarray, "N 3"], hit: BodyHit, *, coloured: bool) -> Cloth:
    """A layer, wherever it can be near."""
    return asked(layer, points, hit, np.ones(len(points), dtype=bool), coloured=coloured)


def hidden_under(person: DressedField) -> Bool[np.ndarray, " V"]:
    """The vertices of the body that the layers fit which nobody can see: those that garments name, and those
    that lie within one away from its edges."""
    points, hidden = person.body.vertices.astype(np.float32), person.hidden > 0
    hit = person.body.distance.query(points)
    for garment in person.garments:
        cloth = whole(garment, points, hit, coloured=False)
        hidden |= (cloth.rim > EDGE_ZONE) & (cloth.distance < 0)
    return hidden


def layers_of(person: DressedField) -> dict[str, LayerField]:
    """Body, garments from the skin outward, hair; a second garment of a kind is KIND_2."""
    garments = person.garments
    found = {BODY: LayerField(person=person, layer=None, over=garments)}
    for number, garment in enumerate(garments, 1):
        same = sum(each.kind == garment.kind for each in garments[:number])
        name = garment.kind if same == 1 else f"{garment.kind}_{same}"
        found[name] = LayerField(person=person, layer=garment, over=garments[number:])
    if person.hair is not None:
        found[HAIR] = LayerField(person=person, layer=person.hair, over=garments)
    return found
