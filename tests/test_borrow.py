"""Somebody in another's clothes: what is borrowed is the lender's, all else stays."""

from dataclasses import replace

import pytest

from avatargen import load_generator
from avatargen.errors import InputError
from avatargen.wardrobe.face_paint import FaceLines
from avatargen.wardrobe.hairline import Hairline
from avatargen.wardrobe.makehuman.borrow import borrow, worn_by
from avatargen.wardrobe.makehuman.choose import Attributes
from avatargen.wardrobe.makehuman.hairs import HairWorn

PLAIN = Attributes(
    sex="woman",
    age="young",
    tone="light",
    skin=("a", "b"),
    skin_mix=0.0,
    skin_tint=(1.0, 1.0, 1.0),
    eyes="blue",
    face=FaceLines(brow_width=0.5, brow_arch=0.5, lashes=0.5),
    hair=None,
    hair_colour=(0.1, 0.1, 0.1),
    hair_worn=HairWorn(mirrored=False, length=0.5, line=Hairline(), shaved=False),
    beard="none",
    garments=(),
    colours=(),
    kinds=(),
    shades=(),
    prints=(),
    print_colour=(0.0, 0.0, 0.0),
    print_width=0.01,
)


def wearing(whose: str, *kinds: str) -> Attributes:
    """Somebody whose garments bear their owner's name."""
    count, shade = len(kinds), (0.2, 0.3, 0.4)
    return replace(
        PLAIN,
        garments=tuple(f"{whose} {kind}" for kind in kinds),
        kinds=kinds,
        colours=(None,) * count,
        shades=(shade,) * count,
        prints=tuple("checks" if kind == "top" else "plain" for kind in kinds),
        print_colour=(float(len(whose)), 0.0, 0.0),
    )


OWN = wearing("my", "socks", "shoes", "bottom", "top")
OTHER = wearing("their", "socks", "shoes", "bottom", "top", "outer", "hat")
OVERALL = wearing("an", "socks", "shoes", "overall")
DRESSED = wearing("her", "shoes", "dress", "hat")


@pytest.mark.parametrize(
    ("person", "wear", "worn"),
    [
        (OWN, ("top",), ["my socks", "my shoes", "my bottom", "their top"]),
        (OWN, ("outer", "hat"), ["my socks", "my shoes", "my bottom", "my top", "their outer", "their hat"]),
        (OWN, ("shoes",), ["their socks", "their shoes", "my bottom", "my top"]),
        (OVERALL, ("top",), ["an socks", "an shoes", "an overall", "their top"]),
        (OVERALL, ("top", "bottom"), ["an socks", "an shoes", "their bottom", "their top"]),
        (DRESSED, ("top", "bottom"), ["her shoes", "their bottom", "their top", "her hat"]),
        (DRESSED, ("shoes",), ["their socks", "their shoes", "her dress", "her hat"]),
    ],
)
def test_what_is_borrowed_takes_the_place_of_what_was_worn(person, wear, worn):
    found = borrow(person, lambda seed: OTHER, dict.fromkeys(wear, 8))
    assert list(found.garments) == worn
    assert found.kinds == tuple(name.split()[1] for name in worn)
    assert found.print_colour == (OTHER if "top" in wear else person).print_colour
    assert len(found.colours) == len(found.shades) == len(found.prints) == len(worn)


def test_who_borrows_nothing_or_shoes_wears_the_own_top_under_an_overall():
    worn = wearing("an", "socks", "shoes", "top", "overall")
    assert borrow(worn, lambda seed: OWN, {}) == worn
    found = borrow(worn, lambda seed: OWN, {"shoes": 1})
    assert [each.garment for each in worn_by(found)] == ["my socks", "my shoes", "an top", "an overall"]


def test_an_overall_takes_the_place_of_top_and_bottom():
    found = borrow(OWN, lambda seed: OVERALL, {"overall": 1})
    assert [each.garment for each in worn_by(found)] == ["my socks", "my shoes", "an overall"]


@pytest.mark.parametrize("person", [OWN, OVERALL])
def test_a_dress_takes_the_place_of_all_but_shoes(person):
    found = borrow(person, lambda seed: DRESSED, {"dress": 1})
    assert [each.kind for each in worn_by(found)] == ["socks", "shoes", "dress"]
    facts = found.facts()
    assert facts["top"] == facts["bottom"] == "dress" and facts["overall"] == "none"
    assert facts["top_color"] == "blue" and "bottom_color" not in facts


def test_several_lend():
    found = borrow(OWN, {1: OTHER, 2: OVERALL}.__getitem__, {"hat": 1, "shoes": 2})
    assert found.garments == ("an socks", "an shoes", "my bottom", "my top", "their hat")


@pytest.mark.parametrize(
    ("person", "lender", "wear", "words"),
    [
        (OWN, OVERALL, {"outer": 8}, "seed 8 wears no outer; it wears shoes, overall"),
        (OWN, OTHER, {"scarf": 8}, "wanted one of top"),
        (OVERALL, OTHER, {"bottom": 8}, "borrow a top as well"),
        (DRESSED, OTHER, {"bottom": 8}, "borrow a top as well"),
        (DRESSED, OTHER, {"top": 8}, "borrow a bottom as well"),
    ],
)
def test_what_cannot_be_borrowed_is_said(person, lender, wear, words):
    with pytest.raises(InputError, match=words):
        borrow(person, lambda seed: lender, wear)


def test_a_seed_in_another_s_clothes_is_itself_but_for_them():
    generator = load_generator()
    own, other = generator.sample(9).info, generator.sample(8).info
    found = generator.sample(9, wear={"top": 8}).info
    mine, theirs, facts = dict(own.facts), dict(other.facts), dict(found.facts)
    for name in ("top", "top_color", "pattern"):
        assert facts[name] == theirs[name], name
    for name in ("gender", "age", "skin", "eyes", "hair", "bottom", "bottom_color", "shoes"):
        assert facts[name] == mine[name], name
    assert found.height_m == own.height_m
    with pytest.raises(InputError, match="wears no hat"):
        generator.sample(9, wear={"hat": 8})
