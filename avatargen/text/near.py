"""What a word may mean that is in no table: that of the known word which is used most alike.

Word vectors of GloVe (Pennington, Socher, Manning 2014; 6B tokens, 50 dimensions, PDDL), cut to the most
frequent words and rounded to 8 bits: `word_vectors.npz`, made by `avatargen/text/cut.py`.
"""

from functools import cache
from pathlib import Path

import numpy as np
from jaxtyping import Float32

from avatargen.text.vocabulary import Meaning, vocabulary

FILE = Path(__file__).with_name("word_vectors.npz")
LIKE = {  # adjectives are not asked: they are near to their opposites
    "garment": 0.56,
    "person": 0.68,
    "cannot": 0.58,
}  # cosine of the nearest word of a kind, at least
ASKED, LEAST = 7, 0.5  # words that vote, and the cosine from which one does
MAJORITY = 0.55  # of the votes, by cosine
AGREED = 0.66  # of the words for people, that have a trait which another word then has too


@cache
def vectors() -> dict[str, Float32[np.ndarray, "50"]]:
    """Unit vectors by word."""
    with np.load(FILE, allow_pickle=False) as held:
        words = held["words"].tobytes().decode("ascii").split("\n")
        rows = held["vectors"].astype(np.float32)
    rows /= np.linalg.norm(rows, axis=1, keepdims=True)
    return dict(zip(words, rows, strict=True))


@cache
def known() -> tuple[tuple[str, ...], Float32[np.ndarray, "K 50"]]:
    """Words of the vocabulary that have a vector."""
    have = vectors()
    words = tuple(word for word, each in vocabulary().items() if each.kind in LIKE and word in have)
    return words, np.stack([have[word] for word in words])


def near(word: str) -> Meaning | None:
    """What most of the nearest known words mean: something worn, somebody, or what cannot be made; None where
    none are near, or they do not agree."""
    voters = nearest(word)
    if not voters or voters[0][1] < min(LIKE.values()):
        return None
    kind, share = winner([(vocabulary()[name].kind, cosine) for name, cosine in voters])
    voters = [(name, cosine) for name, cosine in voters if vocabulary()[name].kind == kind]
    if share < MAJORITY or voters[0][1] < LIKE[kind]:
        return None
    meanings = [vocabulary()[name] for name, _ in voters]
    if kind == "person":
        return Meaning(kind=kind, value=agreed(meanings))
    traits = [meaning.value.split(":")[0] for meaning in meanings]
    trait, _ = winner([(trait, cosine) for trait, (_, cosine) in zip(traits, voters, strict=True)])
    return meanings[traits.index(trait)]


def winner(votes: list[tuple[str, float]]) -> tuple[str, float]:
    """What has the most votes, by cosine, and its share of them."""
    count: dict[str, float] = {}
    for name, cosine in votes:
        count[name] = count.get(name, 0.0) + cosine
    best = max(count, key=lambda name: count[name])
    return best, count[best] / sum(count.values())


def nearest(word: str) -> list[tuple[str, float]]:
    """The nearest known words and their cosines, the nearest first."""
    have = vectors()
    vector = next((have[each] for each in (word, word.removesuffix("s")) if each in have), None)
    if vector is None:
        return []
    words, rows = known()
    alike = rows @ vector
    order = np.argsort(-alike, kind="stable")[:ASKED]
    return [(words[place], float(alike[place])) for place in order if alike[place] >= LEAST]


def agreed(meanings: list[Meaning]) -> str:
    """The traits that most of some words for people have."""
    traits = [trait for meaning in meanings for trait in meaning.value.split(" ") if trait]
    return " ".join(trait for trait in dict.fromkeys(traits) if traits.count(trait) >= AGREED * len(meanings))
