"""Brows, lashes and the light in the eyes, as they are painted on the default body's face."""

import numpy as np
import pytest
from jaxtyping import Float64

from avatargen.wardrobe.face_paint import FaceLines, brow_share, lash_share, lit_eye, paint_face
from avatargen.wardrobe.makehuman.hm08 import load_hm08

EYES = load_hm08().eyes
FINE = FaceLines(brow_width=0.1, brow_arch=0.9, lashes=1.0)
BUSHY = FaceLines(brow_width=1.0, brow_arch=0.1, lashes=0.0)
HAIR = (0.2, 0.1, 0.05)
GREY = 0.5
COUNT = 20_000


@pytest.fixture(scope="module")
def feet() -> Float64[np.ndarray, "N 3"]:
    """Places on a flat face before the eyes."""
    rng = np.random.default_rng(0)
    low, high = np.array([-0.08, EYES[0, 1] - 0.05, 0.14]), np.array([0.08, EYES[0, 1] + 0.06, 0.14])
    return rng.uniform(low, high, size=(COUNT, 3))


def grey_iris(off: Float64[np.ndarray, "N 2"]) -> Float64[np.ndarray, "N 3"]:
    return np.full((len(off), 3), GREY)


@pytest.mark.parametrize("lines", [FINE, BUSHY])
def test_brows_are_two_alike_above_the_eyes(feet: Float64[np.ndarray, "N 3"], lines: FaceLines):
    share = brow_share(feet, EYES, lines)
    assert share.min() >= 0 and 0.5 < share.max() <= 1
    np.testing.assert_allclose(brow_share(feet * (-1, 1, 1), EYES, lines), share, atol=1e-12)

    drawn = feet[share > 0.2]
    assert (drawn[:, 1] > EYES[0, 1] + 0.004).all() and (drawn[:, 1] < EYES[0, 1] + 0.022).all()
    assert (np.abs(drawn[:, 0]) > 0.006).all()  # they do not meet
    assert not brow_share(feet * (1, 1, -1), EYES, lines).any()  # nor is the back of the head drawn on


def test_brows_are_as_wide_and_as_arched_as_said(feet: Float64[np.ndarray, "N 3"]):
    def area(lines: FaceLines) -> float:
        return float(brow_share(feet, EYES, lines).mean())

    def peak(lines: FaceLines) -> float:
        share = brow_share(feet, EYES, lines)
        at_nose = np.abs(np.abs(feet[:, 0]) - 0.016) < 0.003
        arch = np.abs(np.abs(feet[:, 0]) - 0.042) < 0.003
        return float(
            np.average(feet[arch, 1], weights=share[arch])
            - np.average(feet[at_nose, 1], weights=share[at_nose])
        )

    assert area(BUSHY) > 1.7 * area(FINE)
    assert 0.0 < peak(BUSHY) < peak(FINE) - 0.001  # m: no brow falls outward, as a sad one does


def test_lashes_are_at_the_rims_and_darkest_above(feet: Float64[np.ndarray, "N 3"]):
    rim = np.full(COUNT, 0.42)
    share = lash_share(feet, rim, EYES, FINE)
    above = feet[:, 1] > EYES[0, 1] + 0.006
    below = feet[:, 1] < EYES[0, 1] - 0.006
    assert share[above].min() > 0.9 and share[below].max() < 0.3
    for elsewhere in (0.0, 1.0):
        assert not lash_share(feet, np.full(COUNT, elsewhere), EYES, FINE).any()


def test_light_falls_on_both_eyes_from_the_same_side():
    eyes_at = EYES[:, None, :3] + np.stack(
        [*np.meshgrid(np.linspace(-0.008, 0.008, 81), np.linspace(-0.008, 0.008, 81)), np.zeros((81, 81))],
        axis=-1,
    ).reshape(1, -1, 3)
    colours = [
        paint_face(np.full((81**2, 3), 0.8), at, np.ones(81**2), EYES, FINE, HAIR, grey_iris)
        for at in eyes_at
    ]
    np.testing.assert_allclose(colours[0], colours[1], atol=1e-9)
    light = colours[0].sum(axis=1)
    brightest = eyes_at[:, light > light.max() - 1e-6].mean(axis=1) - EYES[:, :3]
    assert (brightest[:, 0] < -0.001).all() and (brightest[:, 1] >= 0).all()


def test_what_is_no_eye_and_no_brow_stays_as_it_is(feet: Float64[np.ndarray, "N 3"]):
    skin = np.random.default_rng(1).uniform(size=(COUNT, 3))
    low = feet[:, 1] < EYES[0, 1] - 0.02
    painted = paint_face(skin, feet, np.zeros(COUNT), EYES, BUSHY, HAIR, grey_iris)
    np.testing.assert_array_equal(painted[low], skin[low])
    assert (painted >= 0).all() and (painted <= 1).all()


def test_cool_eyes_are_less_loud_and_brown_ones_stay():
    off = np.array([[0.1, -0.1]])
    blue, brown = np.array([[0.2, 0.4, 0.9]]), np.array([[0.4, 0.25, 0.1]])
    assert np.ptp(lit_eye(blue, off)) < 0.7 * np.ptp(blue)
    np.testing.assert_allclose(lit_eye(brown, off), brown, atol=1e-12)


def test_measures_beyond_their_range_are_no_face():
    with pytest.raises(AssertionError):
        FaceLines(brow_width=1.5, brow_arch=0.5, lashes=0.5)
