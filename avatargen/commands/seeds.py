"""Which people, in words: one seed, `random`, or many as in 3,5,8 and 0:100; and what they lend."""

import secrets
from argparse import ArgumentTypeError
from itertools import chain

from avatargen.commands.line import LARGEST_SEED

RANDOM = "random"
DRAWN_BELOW = 10**9  # short enough to be typed again
MOST_SEEDS = 1_000_000
LENT = ("top", "bottom", "dress", "overall", "outer", "shoes", "hat")  # garments that a seed can lend


def one_seed(text: str) -> int | str:
    """An argument type: plain decimal digits, or RANDOM."""
    if text == RANDOM:
        return RANDOM
    if not is_seed(text):
        many = "; many go to --seeds" if set(text) & set(":,") else ""
        raise ArgumentTypeError(
            f"found {text!r}, wanted a whole number from 0 to {LARGEST_SEED}, or {RANDOM}{many}"
        )
    return int(text)


def many_seeds(text: str) -> range | tuple[int, ...]:
    """An argument type: seeds, and ranges A:B of A to B - 1, with commas between them; each seed once."""
    parts = [part.strip().split(":") for part in text.split(",")]
    plain = all(len(part) <= 2 and all(map(is_seed, part)) for part in parts)
    ranges = [range(int(part[0]), int(part[-1]) + (len(part) == 1)) for part in parts] if plain else []
    if not ranges or not all(ranges) or sum(map(len, ranges)) > MOST_SEEDS:
        raise ArgumentTypeError(
            f"found {text!r}, wanted A:B with A < B, or seeds such as 3,5,8; at most {MOST_SEEDS} seeds"
        )
    return ranges[0] if len(ranges) == 1 else tuple(dict.fromkeys(chain(*ranges)))


def borrowed(text: str) -> tuple[tuple[str, int], ...]:
    """An argument type: a seed and what it lends, as in 8:top,outer."""
    seed, _, garments = text.partition(":")
    names = [name.strip() for name in garments.split(",")]
    if not is_seed(seed) or not all(name in LENT for name in names) or len(set(names)) < len(names):
        raise ArgumentTypeError(f"found {text!r}, wanted SEED:GARMENT,.. with garments of {', '.join(LENT)}")
    return tuple((name, int(seed)) for name in names)


def is_seed(text: str) -> bool:
    return text.isascii() and text.isdigit() and len(text) < 30 and int(text) <= LARGEST_SEED


def draw_seed() -> int:
    """A seed that nobody can foretell."""
    return secrets.randbelow(DRAWN_BELOW)
