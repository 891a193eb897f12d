"""Seeds in words: what is read is what a slow obvious reading gives, and all else is refused."""

import random
from argparse import ArgumentTypeError

import pytest

from avatargen.commands.line import LARGEST_SEED
from avatargen.commands.seeds import MOST_SEEDS, RANDOM, draw_seed, many_seeds, one_seed


def test_lists_and_ranges_mixed_are_read_as_they_stand() -> None:
    dice = random.Random(0)
    for _ in range(300):
        parts, wanted = [], []
        for _ in range(dice.randint(1, 6)):
            first = dice.randint(0, 40)
            end = first + dice.randint(1, 9)
            alone = dice.random() < 0.5
            parts.append(f"{first}" if alone else f"{first}:{end}")
            for seed in [first] if alone else range(first, end):
                if seed not in wanted:
                    wanted.append(seed)
        assert list(many_seeds(",".join(parts))) == wanted


def test_the_ends_of_what_may_be_asked_for() -> None:
    assert list(many_seeds(f"{LARGEST_SEED}")) == [LARGEST_SEED]
    assert len(many_seeds(f"1:{MOST_SEEDS + 1}")) == MOST_SEEDS
    assert one_seed(str(LARGEST_SEED)) == LARGEST_SEED
    assert one_seed("random") == RANDOM
    assert len({draw_seed() for _ in range(20)}) == 20


@pytest.mark.parametrize(
    "text",
    [
        *(
            "",
            ",",
            "3,",
            ",3",
            "3,,5",
            "5:3",
            "4:4",
            "3:",
            ":3",
            "1:2:3",
            "-1:4",
            "3;5",
            "a",
            "3.0",
            "٣",
            "1_0",
        ),
        *("random", f"0:{MOST_SEEDS + 1}", f"0:{MOST_SEEDS},0:9", str(2**63), f"0:{2**70}", "9" * 5000),
    ],
)
def test_what_is_no_list_of_seeds_is_refused(text: str) -> None:
    with pytest.raises(ArgumentTypeError, match="wanted A:B with A < B, or seeds such as 3,5,8"):
        many_seeds(text)
