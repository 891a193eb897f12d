"""From what was seen to a person: bodies fitted to known landmarks, clothes found again, pixels carried over.

Nothing is looked at by a network: a person of the shipped generator stands in a pose before a background, and
landmarks and mask are those of the figure itself.
"""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest

import avatargen
from avatargen.body.model import forward_kinematics, shape
from avatargen.body.pose import axis_angle_to_matrix
from avatargen.dressed_avatar import DressedSampler
from avatargen.errors import InputError
from avatargen.export.photographs import Finder
from avatargen.photo.camera import Pinhole
from avatargen.photo.figure import tensor
from avatargen.photo.fit import Fitter, check_whole
from avatargen.photo.picture import Picture
from avatargen.photo.problem import Fit
from avatargen.photo.raster import look_at
from avatargen.photo.resembling.outfits import choices_for
from avatargen.photo.resembling.pieces import Dresser
from avatargen.photo.resembling.resemble import (
    BETWEEN,
    MOST,
    Mirror,
    Outfit,
    Wardrobe,
    box_of,
)
from avatargen.photo.resembling.resemble import SKIN as SKIN_PIECE
from avatargen.photo.resembling.seen_skin import seen_skin
from avatargen.photo.resembling.view import view_of
from avatargen.photo.seeing.see import Eyes
from avatargen.photo.sighting import Sighting
from avatargen.wardrobe.appearance import rgb_of
from avatargen.wardrobe.choosing import traits_of
from avatargen.wardrobe.colour_names import lab
from avatargen.wardrobe.makehuman.choose import Draw, draw_latent, skin_of

WIDTH, HEIGHT, FOCAL = 300, 400, 420.0
SKIN, HAIR = (0.72, 0.53, 0.43), (0.2, 0.14, 0.1)
DYES = {"male_casualsuit04-top": (0.75, 0.2, 0.18), "male_casualsuit06-bottom": (0.15, 0.2, 0.4)}
OUTFIT = Outfit(
    upper=("male_casualsuit04-top",),
    bottom="male_casualsuit06-bottom",
    shoes=("shoes05-socks", "shoes05-shoes"),
    hair="short04",
    hat=None,
)
BLIND = Eyes(detector=lambda picture: [], landmarks=lambda picture: [], face=lambda picture: [])
TURNS = {  # degrees
    "pelvis": (0, 25, 0),
    "left_shoulder": (0, -20, -20),
    "right_shoulder": (0, 0, 60),
    "left_elbow": (0, -60, 0),
    "left_hip": (-25, 0, 8),
    "left_knee": (30, 0, 0),
}


@dataclass(frozen=True, kw_only=True)
class Posing:
    """Somebody in front of a camera, and what is seen of them."""

    fit: Fit
    sighting: Sighting
    joints: np.ndarray


@cache
def sampler() -> DressedSampler:
    found = avatargen.load_generator()
    assert isinstance(found, DressedSampler) and found.sizing is not None
    return found


@cache
def fitter() -> Fitter:
    sizing = sampler().sizing
    assert sizing is not None
    return Fitter(sampler().body.source, sizing)


@cache
def wardrobe() -> Wardrobe:
    return Wardrobe(sampler())


@cache
def posing() -> Posing:
    """A man with bent limbs, in red and blue."""
    body = sampler().body.source
    rotations = np.zeros((body.joint_count, 3))
    for name, turn in TURNS.items():
        rotations[body.joint_names.index(name)] = np.radians(turn)
    betas = np.array([-0.4, 0.8, -0.3, 0.2, 0.1, 0.3, -0.1, 0.2, 0.0, 0.1])
    camera = Pinhole(width=WIDTH, height=HEIGHT, focal=FOCAL)
    fit = Fit(
        betas=betas,
        rotations=rotations,
        move=np.array([0.05, 0.2, -2.4]),
        camera=camera,
        height=1.76,
        height_known=False,
        uncertain=(),
    )
    shaped = shape(body, betas)
    T = forward_kinematics(shaped.joints, axis_angle_to_matrix(rotations), body.parents)
    names = fitter().figure.names
    rows = [body.joint_names.index(name.replace("hand", "middle1")) for name in names]
    figure = fitter().figure.pose(
        tensor(betas), tensor(axis_angle_to_matrix(rotations[rows])), tensor(fit.move)
    )
    landmarks = figure.landmarks.double().numpy()
    pixels, mask = photographed(fit)
    sighting = Sighting(
        picture=Picture(name="posing", pixels=pixels, focal=FOCAL),
        mask=mask,
        pixels=camera.see(landmarks)[0],
        metres=landmarks - landmarks[23:25].mean(axis=0),
        visibility=np.ones(33),
    )
    return Posing(fit=fit, sighting=sighting, joints=T[:, :3, 3] + fit.move)


def photographed(fit: Fit) -> tuple[np.ndarray, np.ndarray]:
    """The dressed person in even colours before grey."""
    dresser = Dresser(sampler().body)
    picture, front = np.full((HEIGHT, WIDTH, 3), 0.55), np.full((HEIGHT, WIDTH), np.inf)
    for order, name in enumerate(OUTFIT.pieces):
        piece = wardrobe().piece(name)
        seen = look_at(dresser.move(piece.vertices, fit), piece.faces, fit.camera)
        nearer = seen.away - 0.007 * order < front
        colors = np.full((len(piece.vertices), 3), SKIN)
        if piece.kind == "hair":
            colors[:] = HAIR
        elif piece.kind != "skin":
            middle = np.median(piece.color, axis=0)
            wanted = lab(np.array([DYES[name]]))[0] if name in DYES else middle
            colors = rgb_of(wanted + 0.6 * (piece.color - middle))
        picture[nearer] = seen.read(colors[piece.faces])[nearer]
        front = np.where(nearer, seen.away - 0.007 * order, front)
    return np.rint(255 * picture).astype(np.uint8), np.isfinite(front).astype(np.float32)


def joints_of(fit: Fit) -> np.ndarray:
    body = sampler().body.source
    shaped = shape(body, fit.betas)
    T = forward_kinematics(shaped.joints, axis_angle_to_matrix(fit.rotations), body.parents)
    return T[:, :3, 3] + fit.move


def aligned(found: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Procrustes: turned, scaled and moved onto the others."""
    a, b = found - found.mean(axis=0), wanted - wanted.mean(axis=0)
    u, s, vt = np.linalg.svd(b.T @ a)
    signs = np.array([1, 1, np.linalg.det(u @ vt)])
    return (s * signs).sum() / (a**2).sum() * a @ (u @ np.diag(signs) @ vt).T + wanted.mean(axis=0)


def test_a_body_is_fitted_to_landmarks() -> None:
    posed = posing()
    fit = fitter().fit(posed.sighting, gender="man")
    found, wanted = joints_of(fit)[:22], posed.joints[:22]
    assert np.linalg.norm(aligned(found, wanted) - wanted, axis=1).mean() < 0.035
    seen, places = fit.camera.see(found)[0], fit.camera.see(wanted)[0]
    assert np.linalg.norm(seen - places, axis=1).mean() < 0.02 * HEIGHT
    assert fit.height == pytest.approx(1.76, abs=0.02) and not fit.height_known
    assert fit.rotations.shape == (52, 3)


def test_a_height_that_is_told_is_kept() -> None:
    fit = fitter().fit(posing().sighting, height=1.6, gender="man")
    assert fit.height == pytest.approx(1.6, abs=0.01) and fit.height_known


def test_limbs_along_the_view_and_hidden_ones_are_named() -> None:
    sighting = posing().sighting
    visibility = sighting.visibility.copy()
    visibility[16] = 0.2  # the right wrist
    fit = fitter().fit(replace(sighting, visibility=visibility))
    assert "right wrist" in fit.uncertain and "left knee" not in fit.uncertain


def test_half_a_person_is_refused_with_what_is_missing() -> None:
    sighting = posing().sighting
    pixels = sighting.pixels.copy()
    pixels[25:33, 1] += HEIGHT
    with pytest.raises(InputError, match="the left knee, right knee, left ankle, right ankle lie outside"):
        check_whole(replace(sighting, pixels=pixels))


def test_the_clothes_and_colours_of_a_person_are_found_again() -> None:
    posed = posing()
    found = Finder(sampler(), BLIND).resembling([posed.sighting], traits_of({"gender": "man"}), {})
    mask = posed.sighting.mask > 0.5
    _, again = photographed(found.fits[0])
    share = (mask & (again > 0.5)).sum() / (mask | (again > 0.5)).sum()
    assert share > 0.93
    person = found.avatar.attributes
    assert person is not None
    facts = person.facts()
    assert (facts["gender"], facts["top"], facts["hair"]) == ("man", "t-shirt", "short")
    assert (facts["top_color"], facts["bottom_color"]) == ("red", "blue")
    assert (facts["hat"], facts["outer"]) == ("none", "none") and facts["skin"] in ("light", "medium")
    assert found.lines() and found.facts()["height_told"] is False


@pytest.mark.parametrize("sex", ["woman", "man"])
@pytest.mark.parametrize(
    ("depth", "tone"), [(0.1, "light"), (0.45, "medium"), (0.7, "brown"), (0.97, "dark")]
)
def test_a_skin_is_told_by_its_colour_in_usual_light(sex: str, depth: float, tone: str) -> None:
    """As dark as it was drawn, and its tint brings it onto the colour."""
    names, middle = sampler().config.skin.skins, sampler().skin.middle
    kind = "female" if sex == "woman" else "male"
    pair = [names.index(f"young_{each}skinned_{kind}_diffuse") for each in ("light", "dark")]
    dark, shade = skin_of(depth)
    color = 0.94 * shade * np.array([1 - dark, dark]) @ middle[pair]
    found = seen_skin(sampler(), lab(color[None])[0], sex)
    assert found.tone == tone and found.mix == pytest.approx(dark, abs=0.15)
    mixed = np.array([1 - found.mix, found.mix]) @ middle[[names.index(name) for name in found.names]]
    assert np.allclose(mixed * found.tint, color, atol=0.01)


def test_strands_that_show_skin_are_hair_still() -> None:
    """A third of the hair's pixels are skin; the rest tell its colour, and skin costs a little."""
    posed = posing()
    mirror = Mirror(
        wardrobe(),
        Dresser(sampler().body),
        posed.fit,
        view_of(posed.sighting, *box_of(posed.sighting)),
        lab(np.array([SKIN]))[0],
    )
    at = mirror.labels(OUTFIT.pieces) == OUTFIT.pieces.index("short04")
    seen = np.where(np.arange(at.sum())[:, None] % 3 == 0, mirror.skin, lab(np.array([HAIR]))[0])
    color = mirror.view.color.copy()
    color[at] = seen
    mirror.view = replace(mirror.view, color=color)
    off = mirror.off("short04", at)
    assert np.allclose(off[::3], BETWEEN) and off[1::3].max() < MOST
    assert off.mean() < 1 < mirror.off(SKIN_PIECE, at).mean()


def test_whatever_a_seed_wears_is_tried_on() -> None:
    """Dresses, coats over what fits closely, bare legs without socks: nobody wears what is not looked for."""
    choices, kinds = {sex: choices_for(sampler().items, sex, dark=1.0) for sex in ("woman", "man")}, set()
    for seed in range(400):
        person = sampler().choose(Draw(draw_latent(seed)))
        worn = dict(zip(person.garments, person.kinds, strict=True))
        kinds |= set(person.kinds)
        clothes = {name for name, kind in worn.items() if kind not in ("shoes", "socks", "hat")}
        feet = tuple(name for name, kind in worn.items() if kind in ("shoes", "socks"))
        fitting = [
            each
            for each in choices[person.sex].clothes
            if {*each.upper, *([] if each.bottom is None else [each.bottom])} == clothes
        ]
        assert len(fitting) == 1 and feet in fitting[0].shoes, person.garments
        assert person.hair in (*choices[person.sex].hair, *choices[person.sex].rare)
    assert {"dress", "outer", "overall", "socks"} <= kinds
