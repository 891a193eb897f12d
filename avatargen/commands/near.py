"""What somebody may have meant by a word that is none of ours."""

import difflib
import re
from collections.abc import Collection, Sequence

from avatargen.errors import InputError

MOST = 3  # that are named
OPTION = re.compile(r"--?[A-Za-z][^ ]*")


def did_you_mean(found: str, known: Collection[str]) -> str:
    """The end of a complaint: which of the known names may have been meant; empty where none is near."""
    names = near(found, known)
    return f"; did you mean {' or '.join(names)}?" if names else ""


def near(found: str, known: Collection[str]) -> list[str]:
    """Names that begin so, or have it as a word of theirs, or else the one that is spelt most alike."""
    begun = [name for name in known if name.startswith(found)]
    within = [name for name in known if found.strip("-") in re.split("[ -]+", name)]
    return (begun or within)[:MOST] or difflib.get_close_matches(found, known, 1)


def check_option_names(words: Sequence[str], known: Collection[str], program: str) -> None:
    """Raises InputError for the first word that has the form of an option and is none: before argparse, which
    first misses what is required."""
    for word in words:
        if word == "--":
            return
        name = word.split("=")[0]
        if OPTION.fullmatch(word) and name not in known:
            hint = did_you_mean(name, known) or ";"
            raise InputError(f"found {name}, which is no option{hint} see {program} --help")
