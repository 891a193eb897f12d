"""Which clothes, hair and colours a person in a photograph has, of those that a generator knows.

The generator's latent is read through choices, so no gradient leads to it: what can be worn is laid over the
fitted body, seen by the photograph's camera, and compared. An outfit divides the picture of a person into
parts; the one fits best whose parts lie where the person is, and have one colour each, skin that of the face.
The wardrobe's own folds and trims count as differences from a garment's middle colour.

Letters: H W pixels of a view, L labels.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import product

import numpy as np
from jaxtyping import Float64, Int64

from avatargen.dressed_avatar import DressedSampler
from avatargen.photo.figure import Figure
from avatargen.photo.outline import Clothes
from avatargen.photo.problem import Fit
from avatargen.photo.resembling.outfits import Choices, choices_for
from avatargen.photo.resembling.pieces import Dresser, Piece, body_piece, piece_of
from avatargen.photo.resembling.seen_skin import seen_skin
from avatargen.photo.resembling.view import FAR, Layer, View, draw_layer, view_of
from avatargen.photo.seeing.pose import NAMES
from avatargen.photo.sighting import Sighting

SCALE, MOST = 9.0, 3.0  # CIELAB that count as one, and how much a pixel counts at most
LIGHT = 0.45  # of a difference in lightness, which light and shadow make
BETWEEN = 0.4  # of a pixel of hair that shows skin
MISSED = 2.6  # of a pixel that is the person and is not covered, or the other way round
CONTRAST = 0.6  # of the artist's own colours, that is expected
LEAD = 0.007  # m that what is worn further out is before what is beneath, where both lie together
FEWEST = 4  # pixels that tell a colour
FEW = 5  # uppers that are tried over all bottoms
SHARE = 0.15  # of the pixels of hair, that tell its colour
RARE = {"hat": 0.08, "hair": 0.08}  # what is seldom worn has to be better by a share of the person's pixels
MARGIN = 0.06  # of the person's height, around the person
SKIN = "skin"
Middles = dict[str, Float64[np.ndarray, "3"] | None]  # colours by piece


@dataclass(frozen=True, kw_only=True)
class Outfit:
    """What somebody wears, from the skin outward, and the hair."""

    upper: tuple[str, ...]
    bottom: str | None
    shoes: tuple[str, ...]
    hair: str | None
    hat: str | None

    @property
    def garments(self) -> tuple[str, ...]:
        found = (*self.shoes, self.bottom, *self.upper, self.hat)
        return tuple(name for name in found if name is not None)

    @property
    def pieces(self) -> tuple[str, ...]:
        """All that is seen, from the inside outward; hair and hat last."""
        worn = (*self.shoes, self.bottom, *self.upper, self.hair, self.hat)
        return (SKIN, *(name for name in worn if name is not None))


@dataclass(frozen=True, kw_only=True, eq=False)
class Resemblance:
    """What was found: an outfit, the middle colour of each of its pieces as photographed (CIELAB; None where
    it is not seen), the skin's, and how much the picture is missed, a pixel of the person."""

    sex: str
    outfit: Outfit
    colors: Middles
    skin: Float64[np.ndarray, "3"]
    miss: float


class Wardrobe:
    """Pieces of a generator, made when they are first wanted."""

    def __init__(self, sampler: DressedSampler) -> None:
        self.sampler = sampler
        self.pieces: dict[str, Piece] = {SKIN: body_piece(sampler.body)}

    def piece(self, name: str) -> Piece:
        if name not in self.pieces:
            self.pieces[name] = piece_of(self.sampler, name)
        return self.pieces[name]

    def clothes(self, outfit: Outfit, figure: Figure) -> Clothes:
        """All that the outfit shows, as it moves with a figure."""
        pieces = [self.piece(name) for name in outfit.pieces]
        before = np.cumsum([0, *(len(piece.vertices) for piece in pieces)])
        faces = [piece.faces + count for piece, count in zip(pieces, before, strict=False)]
        points = np.concatenate([piece.vertices for piece in pieces])
        return Clothes(cloud=Dresser(self.sampler.body).bind(points, figure), faces=np.concatenate(faces))


class Mirror:
    """One view of a fitted person, in which pieces are tried on."""

    def __init__(self, wardrobe: Wardrobe, dresser: Dresser, fit: Fit, view: View, skin: np.ndarray) -> None:
        self.wardrobe, self.dresser, self.fit, self.view = wardrobe, dresser, fit, view
        self.skin = skin
        self.layers: dict[str, Layer] = {}
        self.size = max(int(view.mask.sum()), 1)

    def layer(self, name: str) -> Layer:
        if name not in self.layers:
            piece = self.wardrobe.piece(name)
            vertices = self.dresser.move(piece.vertices, self.fit)
            self.layers[name] = draw_layer(vertices, piece.faces, piece.color, self.view.camera)
        return self.layers[name]

    def labels(self, names: Sequence[str]) -> Int64[np.ndarray, "H W"]:
        """Which of the pieces each pixel shows, -1 for none."""
        away = np.stack([self.layer(name).away - LEAD * order for order, name in enumerate(names)])
        return np.where(away.min(axis=0) < FAR / 2, away.argmin(axis=0), -1)

    def miss(self, outfit: Outfit) -> float:
        """How much of the picture the outfit misses, a pixel of the person."""
        labels, mask = self.labels(outfit.pieces), self.view.mask
        total = MISSED * float(((labels >= 0) != mask).sum())
        for number, name in enumerate(outfit.pieces):
            at = (labels == number) & mask
            if at.any():
                total += float(self.off(name, at).sum())
        return total / self.size

    def off(self, name: str, at: np.ndarray) -> np.ndarray:
        """How much each pixel of a piece is off its colour; what shows between strands is skin."""
        seen = self.own(name, at)
        if self.wardrobe.piece(name).kind != "hair":
            return apart(seen, self.skin if name == SKIN else np.median(seen, axis=0))
        strands = apart(seen, np.median(self.without_skin(seen), axis=0))
        return np.minimum(strands, apart(self.view.color[at], self.skin) + BETWEEN)

    def own(self, name: str, at: np.ndarray) -> np.ndarray:
        """Photographed colours of a piece, less what its artist's differ from their middle."""
        colors = self.layer(name).color[at].astype(np.float64)
        middle = np.median(self.wardrobe.piece(name).color, axis=0)
        return self.view.color[at] - CONTRAST * (colors - middle)

    def colors(self, outfit: Outfit) -> Middles:
        """The middle colours of the pieces that are seen."""
        labels = self.labels(outfit.pieces)
        found: Middles = {}
        for number, name in enumerate(outfit.pieces):
            seen = self.view.color[(labels == number) & self.view.mask]
            if self.wardrobe.piece(name).kind == "hair":
                seen = self.without_skin(seen)
            found[name] = np.median(seen, axis=0) if len(seen) >= FEWEST else None
        return found

    def without_skin(self, seen: Float64[np.ndarray, "N 3"]) -> Float64[np.ndarray, "_ 3"]:
        """Colours of hair, between whose strands skin shows: those off the skin's, where there are enough."""
        off = np.linalg.norm(seen - self.skin, axis=1) > SCALE
        return seen[off] if off.sum() > SHARE * len(seen) else seen


def apart(seen: Float64[np.ndarray, "N 3"], color: Float64[np.ndarray, "3"]) -> Float64[np.ndarray, " N"]:
    """How far pixels are off a colour."""
    return np.minimum(np.linalg.norm((seen - color) * (LIGHT, 1, 1), axis=1) / SCALE, MOST)


def resemble(
    sampler: DressedSampler,
    wardrobe: Wardrobe,
    sightings: Sequence[Sighting],
    fits: Sequence[Fit],
    sex: str,
) -> Resemblance:
    """The outfit of a woman or a man that is most like what was seen."""
    skins, dresser = [face_color(sighting) for sighting in sightings], Dresser(sampler.body)
    dark = seen_skin(sampler, np.median(skins, axis=0), sex).mix
    choices = choices_for(sampler.items, sex, dark)
    mirrors: list[list[Mirror]] = [
        [
            Mirror(wardrobe, dresser, fit, view_of(sighting, *box(sighting)), skin)
            for sighting, fit, skin in zip(sightings, fits, skins, strict=True)
        ]
        for box in (box_of, head_box)
    ]
    whole, head = mirrors
    outfit = dressed(whole, choices)
    outfit = coiffed(head, outfit, choices)
    colors = middle_colors(whole, outfit)
    close = middle_colors(head, outfit)
    colors |= {name: close[name] for name in (outfit.hair, outfit.hat) if name is not None}
    return Resemblance(
        sex=sex,
        outfit=outfit,
        colors=colors,
        skin=np.median(skins, axis=0) if (bare := colors[SKIN]) is None else bare,
        miss=miss(whole, outfit) + miss(head, outfit) + rarity(outfit, choices),
    )


def miss(mirrors: Sequence[Mirror], outfit: Outfit) -> float:
    """How much of all pictures the outfit misses."""
    return float(np.mean([mirror.miss(outfit) for mirror in mirrors]))


def middle_colors(mirrors: Sequence[Mirror], outfit: Outfit) -> Middles:
    """The pieces' middle colours, over the pictures that show them."""
    each = [mirror.colors(outfit) for mirror in mirrors]
    found: Middles = {}
    for name in outfit.pieces:
        seen = [color for colors in each if (color := colors[name]) is not None]
        found[name] = np.median(seen, axis=0) if seen else None
    return found


def dressed(mirrors: Sequence[Mirror], choices: Choices) -> Outfit:
    """Uppers, each over the first bottom that it goes with; the best few over all bottoms; then shoes."""
    hair = next((name for name in choices.hair if name is not None), None)
    ways = {
        Outfit(upper=each.upper, bottom=each.bottom, shoes=each.shoes[0], hair=hair, hat=None): each
        for each in choices.clothes
    }
    cost = cache(lambda outfit: miss(mirrors, outfit))
    firsts = {outfit.upper: outfit for outfit in reversed(ways)}
    uppers = sorted(firsts, key=lambda upper: cost(firsts[upper]))[:FEW]
    best = min((outfit for outfit in ways if outfit.upper in uppers), key=cost)
    shod = [replace(best, shoes=shoes) for shoes in ways[best].shoes]
    return min(shod, key=cost)


def coiffed(mirrors: Sequence[Mirror], outfit: Outfit, choices: Choices) -> Outfit:
    """Hair and hat."""
    ways = [
        replace(outfit, hair=hair, hat=hat)
        for hair, hat in product((*choices.hair, *choices.rare), choices.hats)
    ]
    return min(ways, key=lambda tried: miss(mirrors, tried) + rarity(tried, choices))


def rarity(outfit: Outfit, choices: Choices) -> float:
    """By how much an outfit has to be better because it is seldom seen."""
    return RARE["hat"] * (outfit.hat is not None) + RARE["hair"] * (outfit.hair in choices.rare)


def box_of(sighting: Sighting) -> tuple[np.ndarray, np.ndarray]:
    """Around the person."""
    places = np.argwhere(sighting.mask > 0.5)[:, ::-1]
    low, high = places.min(axis=0), places.max(axis=0) + 1
    margin = MARGIN * (high - low).max()
    return low - margin, high + margin


def head_box(sighting: Sighting) -> tuple[np.ndarray, np.ndarray]:
    """Around the person's head and neck."""
    place = dict(zip(NAMES, sighting.pixels, strict=True))
    eyes = (place["left_eye_middle"] + place["right_eye_middle"]) / 2
    shoulders = (place["left_shoulder"] + place["right_shoulder"]) / 2
    reach = 1.15 * float(np.linalg.norm(eyes - shoulders))
    return eyes - reach, eyes + reach


def face_color(sighting: Sighting) -> Float64[np.ndarray, "3"]:
    """The skin's middle colour, between eyes and mouth."""
    place = dict(zip(NAMES, sighting.pixels, strict=True))
    eyes = (place["left_eye_middle"] + place["right_eye_middle"]) / 2
    mouth = (place["mouth_left"] + place["mouth_right"]) / 2
    middle, reach = 0.4 * eyes + 0.6 * mouth, max(0.55 * float(np.linalg.norm(eyes - mouth)), 2.0)
    view = view_of(sighting, middle - reach, middle + reach)
    inside = view.color[view.mask]
    return np.median(inside if len(inside) else view.color.reshape(-1, 3), axis=0)
