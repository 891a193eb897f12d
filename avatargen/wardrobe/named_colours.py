"""Colours by name, beyond the few plain words: navy, crimson, olive green; and written as #rrggbb.

The standard library alone, so that a command can refuse a word before torch loads.
"""

import re
from functools import cache
from pathlib import Path

TABLE = Path(__file__).with_name("named_colours.tsv")
HEX = re.compile(r"#[0-9a-f]{6}")
Rgb = tuple[float, float, float]


@cache
def named() -> dict[str, Rgb]:
    """sRGB in 0..1 by name."""
    lines = (line for line in TABLE.read_text().splitlines() if not line.startswith("#"))
    return {name: rgb_of_hex(code) for name, code in (line.split("\t") for line in lines)}


def rgb_of_hex(code: str) -> Rgb:
    """sRGB in 0..1 of #rrggbb."""
    red, green, blue = (int(code[i : i + 2], 16) / 255 for i in (1, 3, 5))
    return (red, green, blue)


def named_rgb(name: str) -> Rgb | None:
    """sRGB of a name or of #rrggbb; None where it is neither."""
    plain = name.lower().replace("-", " ").replace("gray", "grey")
    return rgb_of_hex(plain) if HEX.fullmatch(plain) else named().get(plain)


def is_colour(name: str) -> bool:
    return named_rgb(name) is not None
