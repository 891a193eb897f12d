"""What pictures of people say they wear, read by a linear reader on features of a pretrained network; the
colour of eyes, which are few pixels, on a histogram of colours.

A picture shows somebody from the front and the back and their face, as `avatargen survey` draws them. Of each
trait it is cut to where the trait is seen. A reader has the least squared error on other people (ridge
regression to one number a word), so nobody is read by a reader that has seen them. How often it is right says
whether pictures show what attributes say: what is smeared cannot be read.

Letters: N people, F features, C words, H and L height and length of a picture in pixels, S pixels a side.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Float64, Int64, UInt8
from skimage.color import rgb2lab
from torch import Tensor
from torch.nn import functional

from avatargen.errors import InputError
from avatargen.metrics.features import Features, all_features
from avatargen.metrics.report import Number, mean

SIDE = 224  # pixels
FACE_WIDTH = 0.8  # of the picture's height, the last panel's
FOLDS = 10
RIDGE = 0.01  # times the mean variance of a feature
BENEATH = ("top", "pattern")  # traits of what is worn beneath jackets and coats
SKIN = 12.0  # CIELAB's distance from the usual colour of an eye's surroundings, within which it is skin
LIGHTNESS = np.array([0.0, 25, 45, 65, 101])  # limits of the histogram's bins
GREENS, BLUES = np.linspace(-20, 24, 9), np.linspace(-28, 36, 11)
FEWEST = 5  # people by whom a word is worn that is asked for


@dataclass(frozen=True, kw_only=True)
class Region:
    """A square of a panel: its upper rim and its side in heights of the picture; it is as far from the left
    as from the right."""

    panel: str  # front, back or face
    top: float
    side: float


UPPER = (Region(panel="front", top=0.13, side=0.4), Region(panel="back", top=0.13, side=0.4))
LOWER = (Region(panel="front", top=0.45, side=0.5), Region(panel="back", top=0.45, side=0.5))
FEET = (Region(panel="front", top=0.745, side=0.255), Region(panel="back", top=0.745, side=0.255))
HEAD = (Region(panel="face", top=0.0, side=0.8), Region(panel="back", top=0.02, side=0.18))
EYES = (Region(panel="face", top=0.39, side=0.32),)
REGIONS = {
    "top": UPPER,
    "outer": UPPER,
    "pattern": UPPER,
    "bottom": LOWER,
    "shoes": FEET,
    "hair": HEAD,
    "eyes": EYES,
}


@dataclass(frozen=True, kw_only=True, eq=False)
class Pictured:
    """Somebody's picture and the words of their traits."""

    picture: UInt8[np.ndarray, "H L 3"]
    words: dict[str, str]


@dataclass(frozen=True, kw_only=True)
class TraitRead:
    """How many are right, over the people whose word enough others share; and what was taken for what."""

    right: Number
    words: dict[str, int]  # people by word
    taken: tuple[tuple[str, str], ...]  # the word read, the word it is


def read_all(people: Sequence[Pictured], network: Features) -> dict[str, TraitRead]:
    """Every trait of REGIONS of which enough people have two words at least, by features of a network.
    Raises InputError where there is none."""
    seen: dict[Region, Float[np.ndarray, "N F"]] = {}
    found: dict[str, TraitRead] = {}
    for name, regions in REGIONS.items():
        words = [shown_word(person, name) for person in people]
        known = {word for word in words if word is not None}
        count = {word: words.count(word) for word in sorted(known) if words.count(word) >= FEWEST}
        asked = [i for i, word in enumerate(words) if word in count]
        if len(count) < 2:
            continue
        for region in (region for region in regions if region not in seen):
            crops = torch.stack([cut(person.picture, region) for person in people])
            told = region in EYES
            seen[region] = colours_off_skin(crops) if told else all_features(network, crops)
        features = np.concatenate([seen[region] for region in regions], axis=1)[asked]
        own = [people[i].words.get(name, "none") for i in asked]
        read = read_by_others(features, own)
        right = mean(np.array([a == b for a, b in zip(read, own, strict=True)], dtype=np.float64))
        assert right is not None
        taken = tuple((a, b) for a, b in zip(read, own, strict=True) if a != b)
        found[name] = TraitRead(right=right, words=count, taken=taken)
    if not found:
        raise InputError(f"eval: found {len(people)} people, too few to tell two words of a trait; make more")
    return found


def shown_word(person: Pictured, name: str) -> str | None:
    """The word of a trait; None where a jacket or coat hides what it speaks of."""
    hidden = name in BENEATH and person.words.get("outer", "none") != "none"
    return None if hidden else person.words.get(name, "none")


def cut(picture: UInt8[np.ndarray, "H L 3"], region: Region) -> Float[Tensor, "3 S S"]:
    """A region of a picture, 0..1."""
    height, length = picture.shape[:2]
    face = round(FACE_WIDTH * height)
    figure = (length - face) // 2
    start, width = {"front": (0, figure), "back": (figure, figure), "face": (2 * figure, face)}[region.panel]
    side, top = round(region.side * height), round(region.top * height)
    left = start + max((width - side) // 2, 0)
    square = picture[top : top + side, left : min(left + side, start + width)]
    pixels = torch.from_numpy(square.astype(np.float32) / 255).permute(2, 0, 1)[None]
    return functional.interpolate(pixels, size=(SIDE, SIDE), mode="bilinear", antialias=True)[0]


def colours_off_skin(crops: Float[Tensor, "N 3 S S"]) -> Float64[np.ndarray, "N F"]:
    """Square roots of the shares of pixels by bins of CIELAB, of those that are not as most are."""
    found = []
    for crop in crops.permute(0, 2, 3, 1).numpy():
        colours = rgb2lab(crop).reshape(-1, 3).astype(np.float64)
        off = colours[np.linalg.norm(colours - np.median(colours, axis=0), axis=1) > SKIN]
        bins, _ = np.histogramdd(off, bins=(LIGHTNESS, GREENS, BLUES))
        found.append(np.sqrt(bins.ravel() / len(colours)))
    return np.stack(found)


def read_by_others(features: Float[np.ndarray, "N F"], words: list[str]) -> list[str]:
    """Each person's word as a reader reads it that was made from people of the other tenths."""
    known = sorted(set(words))
    place = np.array([known.index(word) for word in words])
    read = np.zeros(len(words), dtype=np.int64)
    fold = np.arange(len(words)) % FOLDS
    for k in range(FOLDS):
        others, own = fold != k, fold == k
        read[own] = read_by(features[others], place[others], len(known), features[own])
    return [known[i] for i in read]


def read_by(
    seen: Float[np.ndarray, "N F"], word: Int64[np.ndarray, " N"], count: int, asked: Float[np.ndarray, "M F"]
) -> Int64[np.ndarray, " M"]:
    """The words of those `asked`, by ridge regression on those `seen`; float64."""
    middle = seen.mean(axis=0, dtype=np.float64)
    centred, other = seen - middle, asked - middle
    target = np.eye(count)[word]
    usual = target.mean(axis=0)
    products = centred @ centred.T  # fewer people than features
    penalty = RIDGE * max(float(np.trace(products)) / max(len(seen), 1), 1e-12)
    weight = np.linalg.solve(products + penalty * np.eye(len(seen)), target - usual)
    return np.argmax(other @ centred.T @ weight + usual, axis=1)
