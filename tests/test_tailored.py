"""Garments sewn in code: cutting, draping and hanging, and what comes out of it."""

import igl
import numpy as np
import pytest
import torch

from avatargen.wardrobe.makehuman.choose import Draw, choose, draw_latent
from avatargen.wardrobe.makehuman.outfit import TAILORED, outfit_of
from avatargen.wardrobe.makehuman.solid import Solid, boundary_loops, lid
from avatargen.wardrobe.makehuman.words import GARMENTS
from avatargen.wardrobe.tailored import cuts
from avatargen.wardrobe.tailored.collection import PATTERNS, made
from avatargen.wardrobe.tailored.curves import SHOULDER, neckline
from avatargen.wardrobe.tailored.cutting import cut, parted, split
from avatargen.wardrobe.tailored.form import Sheet, default_body, whole_form
from avatargen.wardrobe.tailored.hanging import AXIS_Z, COLUMNS, carried, hulls, skirt
from avatargen.wardrobe.tailored.pieces import GUTTER, laid_out, pieces, rows
from tests.shapes import icosphere

LOOPS = {"tailored-tshirt": 4, "tailored-skirt": 2, "tailored-shorts": 3}  # openings
LIGHT = {"skins": ["young_lightskinned_female_diffuse"], "irises": ["brown"]}


@pytest.fixture(scope="module", params=LOOPS)
def garment(request):
    return made(request.param)


def ball() -> Sheet:
    """A sphere of 1 m as a sheet."""
    surface = icosphere(rounds=4)
    vertices = surface.vertices.astype(np.float64)
    return Sheet(
        vertices=vertices, at=vertices, faces=surface.faces, part=np.zeros(len(surface.faces), np.int64)
    )


def areas(sheet: Sheet) -> np.ndarray:
    corners = sheet.vertices[sheet.faces]
    return np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2


def test_a_cut_follows_its_curve_and_keeps_what_is_on_its_positive_side():
    sheet = ball()
    cap = cut(sheet, sheet.at[:, 1] - 0.3)
    (edge,) = boundary_loops(cap.faces)
    assert np.abs(cap.vertices[edge, 1] - 0.3).max() < 0.02  # snapped within a tenth of an edge
    assert np.median(np.abs(cap.vertices[edge, 1] - 0.3)) < 1e-9
    assert areas(cap).sum() == pytest.approx(2 * np.pi * 0.7, rel=0.02)


def test_parting_loses_nothing_and_opens_nothing():
    sheet = ball()
    whole, positive = split(sheet, sheet.at @ np.array([0.3, 0.5, 0.8]) - 0.1)
    assert areas(whole).sum() == pytest.approx(areas(sheet).sum(), rel=1e-9)
    assert boundary_loops(whole.faces) == [] and 0 < positive.sum() < len(positive)
    two = parted(sheet, sheet.at[:, 0])
    four = parted(two, two.at[:, 2])
    assert [len(pieces(four)), *np.unique(four.part)] == [4, 0, 1, 2, 3]
    assert len({round(float(areas(four.kept(four.part == k)).sum()), 1) for k in range(4)}) == 1


def test_pieces_are_laid_out_beside_one_another_at_their_size():
    sheet = parted(ball(), ball().at[:, 1] - 0.2)
    uv = laid_out(sheet)
    assert uv.min() > 0 and uv.max() < 1
    sizes = [np.array([0.5, 0.4]), np.array([0.5, 0.3]), np.array([0.3, 0.2])]
    places, height = rows(sizes, 1.1)
    boxes = [(place, place + size) for place, size in zip(places, sizes, strict=True)]
    for i, (low, high) in enumerate(boxes):
        assert (high <= (1.1, height)).all()
        assert all(
            (low >= other_high).any() or (high <= other_low).any() for other_low, other_high in boxes[:i]
        )
    assert height == pytest.approx(0.4 + 0.2 + 3 * GUTTER)


def test_a_neckline_is_as_deep_and_wide_as_asked_for():
    deep = [
        [0, SHOULDER - 0.1, 0.1],
        [0, SHOULDER - 0.12, 0.1],
        [0, SHOULDER - 0.08, 0.1],
        [0.09, SHOULDER, 0.1],
    ]
    front = np.array(deep)
    found = neckline(front, 0.08, 0.1, 0.03)
    assert found[0] == pytest.approx(0, abs=1e-9)
    assert found[1:3] == pytest.approx([0.02, -0.02], rel=0.05) and found[3] == pytest.approx(0.01, rel=0.05)


def test_skirts_go_round_both_legs_and_hang_level():
    hanging = skirt(cuts.SKIRT)
    radius = np.hypot(hanging.at[:, 0], hanging.at[:, 2] - AXIS_Z).reshape(-1, COLUMNS)
    heights = hanging.at[:, 1].reshape(-1, COLUMNS)
    assert np.ptp(heights, axis=1).max() == 0 and heights[-1, 0] == pytest.approx(cuts.SKIRT.hem)
    assert (radius[-1] > hulls(heights[-1:, 0])[0]).all()
    there = carried(hanging)
    on_body = default_body().distance.query(there.vertices.astype(np.float32)).distance
    assert on_body.min() > 0.002  # m


def test_a_garment_is_one_closed_volume(garment):
    solid = Solid(garment=garment)
    assert len(solid.loops) == LOOPS[garment.name]
    vertices, faces = solid.closed
    rng = np.random.default_rng(2)
    points = rng.uniform(
        garment.vertices.min(axis=0) - 0.05, garment.vertices.max(axis=0) + 0.05, size=(2000, 3)
    )
    squared, _, _ = solid.closed_tree.query(points)
    around = np.asarray(igl.winding_number(vertices, faces, points[squared > 0.004**2]))
    assert np.abs(around - np.round(around)).max() < 0.02 and set(np.round(around)) == {0, 1}
    inside = default_body().vertices[garment.hidden].astype(np.float64)
    assert len(inside) > 300 and solid.wound(inside).all()


def test_a_garment_keeps_off_the_skin(garment):
    hit = default_body().distance.query(garment.vertices)
    assert hit.distance.min() > 0.002  # m


def test_a_garments_texture_covers_it_and_has_its_colour(garment):
    pattern = PATTERNS[garment.name]
    assert garment.uv.min() > 0 and garment.uv.max() < 1
    assert np.abs(np.array(garment.own_color) - pattern.own_color).max() < 0.06
    assert garment.texture[..., :3].reshape(-1, 3).astype(float).std(axis=0).max() > 1  # it is not even


def test_sides_are_told_as_winding_numbers_tell_them(garment):
    solid = Solid(garment=garment)
    rng = np.random.default_rng(4)
    low, high = garment.vertices.min(axis=0) - 0.02, garment.vertices.max(axis=0) + 0.02
    near = (
        garment.vertices[rng.integers(len(garment.vertices), size=3000)] + rng.normal(size=(3000, 3)) * 0.008
    )
    points = np.concatenate([rng.uniform(low, high, size=(3000, 3)), near])
    squared, face, corners = solid.closed_tree.query(points)
    assert np.array_equal(solid.inside(points, np.sqrt(squared), face, corners), solid.wound(points))


@pytest.mark.parametrize("middle", [0.15, 0.0])
def test_the_lid_of_an_arm_hole_lies_in_its_plane_and_others_on_an_upright_line(middle):
    angle = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    edge = np.stack([middle - 0.02 * np.sin(angle), 0.07 * np.sin(angle), 0.06 * np.cos(angle)], axis=1)
    found = lid(edge)
    assert np.abs(found[:, 1] - edge[:, 1]).max() == 0
    lean = 0.02 / 0.07 if middle else 0.0
    assert np.abs(found[:, 0] - middle + lean * edge[:, 1]).max() < 1e-9


def test_every_pattern_is_named_and_worn_by_itself():
    assert set(PATTERNS) <= set(GARMENTS)
    for name, pattern in PATTERNS.items():
        assert pattern.name == name == outfit_of(pattern) and TAILORED in pattern.tags
        assert len({"Female", "Male"} & set(pattern.tags)) >= 1


def test_a_third_of_women_wear_a_dress_or_a_skirt():
    people = [
        choose(Draw(draw_latent(seed)), PATTERNS, LIGHT["skins"], LIGHT["irises"]) for seed in range(300)
    ]
    women = [person.facts() for person in people if person.sex == "woman"]
    skirted = [facts for facts in women if facts["bottom"] in ("dress", "skirt")]
    assert 0.25 < len(skirted) / len(women) < 0.45
    for facts in women:
        assert (facts["top"] == "dress") == (facts["bottom"] == "dress")
    men = [person.facts() for person in people if person.sex == "man"]
    assert {facts["bottom"] for facts in men} == {"shorts"}
    assert {facts["top"] for facts in men} == {"polo shirt", "hoodie", "shirt", "t-shirt", "sweater"}


def test_new_numbers_of_a_draw_leave_the_old_ones_as_they_were():
    old = torch.Generator().manual_seed(5)
    before = torch.cat([torch.randn(1, 80, generator=old), torch.randn(1, 20, generator=old)], dim=1)
    assert torch.equal(draw_latent(5)[:, :100], before)


def test_the_whole_form_lies_on_the_body():
    assert (
        np.abs(default_body().distance.query(whole_form().vertices.astype(np.float32)).distance).max() < 1e-4
    )
