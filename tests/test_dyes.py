"""Colours that clothes are dyed in."""

import numpy as np
import pytest

from avatargen.wardrobe.colour_names import NAMES, colour_name, lab
from avatargen.wardrobe.dyes import BOTTOMS, COATS, SHOES, SUITS, TOPS, Dyes

ALL = {"tops": TOPS, "bottoms": BOTTOMS, "coats": COATS, "suits": SUITS, "shoes": SHOES}


@pytest.mark.parametrize("among", ALL.values(), ids=ALL)
def test_each_dye_is_worn_as_often_as_said(among: Dyes):
    shares = (np.arange(1000) + 0.5) / 1000
    drawn = np.array([among.dye(share, 0.0, 0.0) for share in shares])
    counts = [(np.abs(drawn - np.clip(c, 0.02, 0.97)).max(axis=1) < 0.004).mean() for c in among.colours]
    np.testing.assert_allclose(counts, np.array(among.wearers) / sum(among.wearers), atol=2e-3)
    assert among.dye(1.0, 0.0, 0.0) == pytest.approx(among.colours[-1], abs=0.004)


@pytest.mark.parametrize("among", ALL.values(), ids=ALL)
def test_dyes_differ_a_little_and_stay_colours(among: Dyes):
    rng = np.random.default_rng(3)
    for share in rng.uniform(size=200):
        plain = lab(np.array(among.dye(share, 0.0, 0.0))[None])
        moved = np.array(among.dye(share, *rng.normal(size=2)))
        assert moved.min() > 0 and moved.max() < 1
        assert np.linalg.norm(lab(moved[None]) - plain) < 30


def test_whatever_colour_is_asked_for_somebody_wears():
    assert {colour_name(np.array(c)) for c in TOPS.colours} == set(NAMES)
    assert {colour_name(np.array(c)) for c in BOTTOMS.colours} >= set(NAMES) - {"orange"}


def test_no_bottom_looks_like_skin():
    """Skin is reddish-yellow, neither dark nor pale."""
    lightness, a, b = lab(np.array(BOTTOMS.colours)).T
    hue, chroma = np.degrees(np.arctan2(b, a)), np.hypot(a, b)
    skin = (hue > 25) & (hue < 75) & (chroma > 12) & (chroma < 40) & (lightness > 30) & (lightness < 80)
    assert not skin.any(), np.array(BOTTOMS.colours)[skin]
