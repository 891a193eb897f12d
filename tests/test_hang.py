"""A skirt on a capsule figure: seated it lies on the thighs and under them, and what lies close stays as it
was."""

import functools
from dataclasses import replace

import numpy as np
import pytest

from assets.mesh.surface import Surface
from assets.skin.hang import CLEAR, MOST_SHIN, hang, measure_legs, shares
from assets.skin.skin import Skin, limit_influences
from avatargen.body.model import canonical_body, pose, pose_canonically, shape
from avatargen.body.skinning import skin as skin_points
from tests.bodies import SMPL_JOINTS, capsule_body

ROWS, COLUMNS = 30, 60
NAMES = capsule_body().joint_names
HIPS, KNEES = (1, 2), (4, 5)


@functools.cache
def skirt(length: float = 0.42, flare: float = 0.45) -> tuple[Surface, Skin]:
    """A cone from the waist down, on the leg of its side, the pelvis above the hips."""
    down = np.linspace(-0.06, length, ROWS)
    turn = np.linspace(0, 2 * np.pi, COLUMNS, endpoint=False) + np.pi / COLUMNS
    radius = 0.14 + flare * np.maximum(down, 0)
    vertices = np.stack(
        [
            (radius[:, None] + 0.04) * np.sin(turn),
            np.broadcast_to(0.85 - down[:, None], (ROWS, COLUMNS)),
            radius[:, None] * np.cos(turn),
        ],
        axis=-1,
    ).reshape(-1, 3)
    row, column = np.divmod(np.arange((ROWS - 1) * COLUMNS), COLUMNS)
    a, b = row * COLUMNS + column, row * COLUMNS + (column + 1) % COLUMNS
    faces = np.concatenate([np.stack([a, a + COLUMNS, b], 1), np.stack([b, a + COLUMNS, b + COLUMNS], 1)])
    leg = np.clip((0.85 - vertices[:, 1]) / 0.08, 0, 1)
    left = np.clip(0.5 + vertices[:, 0] / 0.2, 0, 1)
    weights = np.zeros((len(vertices), len(NAMES)))
    weights[:, 0], weights[:, HIPS] = 1 - leg, np.stack([leg * left, leg * (1 - left)], axis=1)
    return Surface(vertices=vertices, faces=faces), limit_influences(weights)


@functools.cache
def canonical():
    return canonical_body(capsule_body())


def hung(surface: Surface, skin: Skin) -> Skin:
    """Of a surface on straight legs, which is laid on the canonical body first."""
    there = skin_points(surface.vertices, skin.dense(24), pose_canonically(capsule_body()).T_posed_rest)
    return hang(skin, Surface(vertices=there, faces=surface.faces), canonical())


def seated(surface: Surface, skin: Skin) -> np.ndarray:
    """Metres from the hips, upward."""
    turns = np.zeros((24, 3))
    turns[list(HIPS), 0], turns[list(KNEES), 0] = -np.pi / 2, np.pi / 2
    body = capsule_body()
    T = pose(body, shape(body, np.zeros(10)), turns).T_posed_rest
    return skin_points(surface.vertices, skin.dense(24), T) - SMPL_JOINTS[1] * (0, 1, 1)


def test_a_seated_skirt_lies_on_the_thighs_and_does_not_sag_beneath():
    surface, skin = skirt()
    stiff, found = seated(surface, skin), seated(surface, hung(surface, skin))
    below = 0.85 - surface.vertices[:, 1]
    reach = np.abs(surface.vertices[:, 0]) < 0.1
    front = (below > 0.18) & (below < 0.3) & (surface.vertices[:, 2] > 0.1) & reach
    back = (below > 0.18) & (below < 0.3) & (surface.vertices[:, 2] < -0.1) & reach
    assert front.sum() > 20 and back.sum() > 20
    assert stiff[front, 1].min() > 0.19 and stiff[back, 1].max() < -0.19
    assert found[front, 1].min() > 0.055 and found[front, 1].max() < 0.1  # thighs are 6 cm thick
    assert found[back, 1].max() < -0.055 and found[back, 1].min() > -0.12
    assert (found[front, 2] > 0.1).all() and (found[back, 2] > 0.1).all()  # both lie forward


def test_a_long_skirt_hangs_down_from_the_knees():
    surface, skin = skirt(0.7)
    hem = 0.85 - surface.vertices[:, 1] > 0.68
    stiff, found = (seated(surface, each)[hem] for each in (skin, hung(surface, skin)))
    assert stiff[:, 2].max() > 0.65 and stiff[:, 1].max() > 0.3
    assert found[:, 1].max() < 0.0 and found[:, 1].mean() < stiff[:, 1].mean() - 0.1
    assert MOST_SHIN < 1


def test_both_sides_hang_alike_and_the_waist_stays():
    surface, skin = skirt()
    weights = hung(surface, skin).dense(24)
    mirrored = weights.reshape(ROWS, COLUMNS, 24)[:, ::-1]
    assert np.abs(weights.sum(axis=1) - 1).max() < 1e-6
    for left, right in ((1, 2), (4, 5)):
        assert np.abs(mirrored[..., left] - weights.reshape(ROWS, COLUMNS, 24)[..., right]).mean() < 0.01
    waist = surface.vertices[:, 1] > 0.85
    assert np.array_equal(weights[waist], skin.dense(24)[waist])
    moved = np.abs(weights - skin.dense(24)).max(axis=1)
    assert (moved > 0.1).mean() > 0.3


def test_what_lies_close_to_the_body_is_left_alone():
    body = capsule_body()
    surface = Surface(vertices=body.v_template.astype(np.float64), faces=body.faces)
    skin = limit_influences(body.weights)
    assert hung(surface, skin) is skin
    surface, skin = skirt()
    nameless = replace(canonical(), joint_names=tuple(f"joint_{number}" for number in range(24)))
    assert hung(surface, skin) is not skin
    assert hang(skin, surface, nameless) is skin


@pytest.mark.parametrize("before", [0.08, 0.15, 0.25])
def test_shares_solve_for_the_thigh(before):
    legs = measure_legs(shape(capsule_body(), np.zeros(10)), NAMES)
    assert legs is not None and legs.thigh == pytest.approx(0.37, abs=0.02)
    assert np.abs(legs.front[5:-12] - 0.06).max() < 0.012 and np.abs(legs.back[5:-12] + 0.06).max() < 0.012
    heights = np.linspace(0.65, 0.55, 5)
    for side in (1, -1):
        places = np.stack([np.zeros(5), heights, np.full(5, side * before)], axis=1)
        pelvis, shin = shares(places, legs)
        below, (line, front, back) = legs.hips - heights, legs.at(heights)
        over = (1 - pelvis - shin) * (side * before - line) - pelvis * below + shin * (legs.thigh - below)
        wanted = (front + CLEAR if side > 0 else back - CLEAR) - line
        assert np.abs(over - wanted).max() < (1e-9 if side > 0 else 0.03)
        assert (pelvis >= 0).all() and (shin >= 0).all() and (pelvis + shin <= 1).all()
