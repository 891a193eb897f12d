"""Hair from its line, strand by strand, and beards: on the default body, with volumes made here."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
import torch

from avatargen.body.load import load_body
from avatargen.body.model import CanonicalBody, canonical_body
from avatargen.shipped import shipped
from avatargen.wardrobe.attributes import LATENT_SIZE
from avatargen.wardrobe.beards import BEARDS, STANDS, beard_cover, beard_relief
from avatargen.wardrobe.hair_paint import HairPaint
from avatargen.wardrobe.hairline import AROUND, AXIS_Z, Hairline
from avatargen.wardrobe.lips import LIPS_Y
from avatargen.wardrobe.makehuman.choose import DRAWN_AT_ONCE, NEW, draw_latent
from avatargen.wardrobe.makehuman.grooming import CUTS
from avatargen.wardrobe.makehuman.hairs import BALD, beard_style, hair_style
from avatargen.wardrobe.strand_pattern import CURLED, TIED, Flow
from avatargen.wardrobe.worn_hair import BEGINS, CROPPED, HANGING, Cut, Hairdo, WornHair

FOREHEAD, CROWN, EAR, NAPE = (0, 0.75, 0.146), (0, 0.838, 0.05), (0.088, 0.70, 0.04), (0, 0.60, -0.025)
TAGS = {
    "afro01": ("Afro",), "bob01": ("Bob", "Short", "Female"), "long01": ("Long", "Female"),
    "ponytail01": ("Female", "Long"), "short01": ("Male", "Short"), "short03": ("Short", "Female"),
}  # fmt: skip


@pytest.fixture(scope="module")
def body():
    return canonical_body(load_body(shipped("body.npz")))


@dataclass(frozen=True, kw_only=True)
class Thick:
    """Hair 6 cm thick all over the body, and as bright as x says."""

    body: CanonicalBody

    def least(self, points):
        return np.zeros(len(points), np.float32)

    def distance(self, points):
        return (self.body.distance.query(points).distance - 0.06).astype(np.float32)

    def shade(self, points):
        return (1 + 3 * points[:, 0]).astype(np.float32)


def worn(body, kind=CROPPED, **changes) -> WornHair:
    cut = Cut(kind=kind, flow=Flow(x=0.03, back=-0.01, front=0.1), ridges=0.0)
    hairdo = Hairdo(cut=cut, mirrored=False, end=-1.0, line=Hairline(), colour=(0.3, 0.2, 0.1))
    return WornHair(volume=Thick(body=body), hairdo=replace(hairdo, **changes), body=body)


def about_the_head(body, count: int = 4000) -> np.ndarray:
    """Points up to 5 cm over the head and the neck, and down to 1 cm under the skin."""
    rng = np.random.default_rng(0)
    head = body.vertices[(body.vertices[:, 1] > 0.56) & (np.abs(body.vertices[:, 0]) < 0.12)]
    off = rng.normal(size=(count, 3))
    off *= rng.uniform(-0.01, 0.05, (count, 1)) / np.linalg.norm(off, axis=1, keepdims=True)
    return (head[rng.integers(len(head), size=count)] + off).astype(np.float32)


def feet(body, hit) -> np.ndarray:
    return np.einsum("nk,nka->na", hit.barycentric, body.vertices[body.faces[hit.face]]).astype(np.float64)


def test_the_line_leaves_forehead_ears_and_neck_bare():
    line = Hairline()
    assert line.within(np.array([CROWN, (0, 0.74, -0.06)], dtype=float)).min() > 0.03
    assert (
        line.within(np.array([FOREHEAD, EAR, NAPE, (0, 0.64, 0.14), (0.9, 0.9, 0.0)], dtype=float)).max() < 0
    )


def test_ways_to_the_line_are_those_to_its_nearest_point():
    line = Hairline(raised=0.004, receded=0.008)
    rng = np.random.default_rng(1)
    points = rng.uniform((-0.09, 0.58, -0.06), (0.09, 0.84, 0.15), (300, 3))
    u = AROUND * np.abs(np.arctan2(points[:, 0], points[:, 2] - AXIS_Z))
    share = np.linspace(0, 1, 400)[:, None]
    fine = np.concatenate([a + share * (b - a) for a, b in zip(line.corners, line.corners[1:], strict=False)])
    slow = np.linalg.norm(np.stack([u, points[:, 1]], axis=1)[:, None] - fine, axis=2).min(axis=1)
    found = line.within(points)
    assert np.abs(np.abs(found) - slow).max() < 1e-4  # m
    clear = np.abs(found) > 1e-3
    above = points[:, 1] > np.interp(u, line.corners[:, 0], line.corners[:, 1])
    assert np.array_equal((found > 0)[clear], above[clear])
    assert (found <= Hairline().within(points) + 1e-9).all()  # it only recedes


@pytest.mark.parametrize("flow", [Flow(), Flow(x=0.03, back=-0.01, front=0.1), Flow(kind=TIED)])
def test_strands_change_slowly_along_and_quickly_across(flow):
    rng = np.random.default_rng(2)
    side = np.stack([np.full(500, 0.08), rng.uniform(0.70, 0.75, 500), rng.uniform(0.0, 0.08, 500)], axis=1)
    down, back = (0, 0.002, 0), (0, 0, 0.002)
    along, across = (back, down) if flow.kind == TIED else (down, back)
    own = flow.pattern(side)
    change = [np.abs(flow.pattern(side + step) - own)[:, 0].mean() for step in (along, across)]
    assert change[1] > 2.5 * change[0]
    assert (np.abs(own[:, :2]) <= 1).all() and own[:, 2].min() >= 0 and own[:, 2].max() <= 1


def test_curls_have_no_direction():
    points = np.random.default_rng(3).uniform(-0.1, 0.1, (2000, 3))
    flow = Flow(kind=CURLED)
    change = [
        np.abs(flow.pattern(points + step) - flow.pattern(points))[:, 0].mean() for step in np.eye(3) / 500
    ]
    assert max(change) < 1.2 * min(change)


def test_hair_begins_flat_at_its_line_and_keeps_off_the_face(body):
    points = about_the_head(body)
    hit = body.distance.query(points)
    way = Hairline().within(feet(body, hit))
    layer = worn(body)
    found = layer.cloth(points, hit, coloured=False)
    bare = way < BEGINS
    assert bare.sum() > 500 and (found.distance[bare] >= hit.distance[bare] - 1e-6).all()
    low = (way > 0) & (way < 0.012)
    assert low.sum() > 50 and (found.distance[low] >= hit.distance[low] - 0.0075).all()
    deep = way > 0.06
    assert deep.sum() > 50 and np.allclose(found.distance[deep], hit.distance[deep] - 0.06, atol=1e-5)
    assert (found.rim[way > 0.005] == 0).all() and (found.rim[way < -0.005] == 1).all()


def test_the_scalp_is_covered_where_a_volume_has_a_hole(body):
    class Hole(Thick):
        def distance(self, points):
            return np.full(len(points), 0.03, np.float32)

    points = about_the_head(body)
    hit = body.distance.query(points)
    layer = replace(worn(body), volume=Hole(body=body))
    found = layer.cloth(points, hit, coloured=False).distance
    scalp = Hairline().within(feet(body, hit)) > 0.03
    assert scalp.sum() > 100
    least = np.minimum(hit.distance - layer.hairdo.cut.least, 0.03)
    assert np.allclose(found[scalp], least[scalp], atol=1e-6)


def test_loose_hair_hangs_beside_the_face_and_ends_where_it_is_cut(body):
    points = about_the_head(body)
    hit = body.distance.query(points)
    found = worn(body, HANGING, end=0.60).cloth(points, hit, coloured=False).distance
    eyes = (np.abs(points[:, 0]) < 0.06) & (points[:, 2] > 0.115) & (np.abs(points[:, 1] - 0.70) < 0.04)
    assert eyes.sum() > 100 and (found[eyes] >= hit.distance[eyes] - 1e-6).all()
    behind = (points[:, 2] < -0.03) & (points[:, 1] > 0.62) & (hit.distance > 0)
    assert behind.sum() > 50 and (found[behind] < 0).all()
    assert (found[points[:, 1] < 0.59] > 0).all()


def test_mirrored_hair_is_the_mirror_image(body):
    points = about_the_head(body, 500)
    flip = np.array((-1, 1, 1), np.float32)
    hit, other = body.distance.query(points), body.distance.query(points * flip)
    same = np.abs(hit.distance - other.distance) < 1e-4  # the body is not quite
    one = worn(body).cloth(points, hit, coloured=True)
    two = worn(body, mirrored=True).cloth(points * flip, other, coloured=True)
    assert same.sum() > 300 and np.abs(one.distance - two.distance)[same].max() < 0.003
    near = same & (one.distance < 0)
    assert np.quantile(np.abs(one.color - two.color)[near], 0.99) < 0.02
    plain = worn(body).cloth(points * flip, other, coloured=True)
    assert np.abs(one.color - plain.color)[near].mean() > 0.01  # and another than the first


@pytest.mark.parametrize("kind", BEARDS)
def test_beards_grow_on_the_chin_alone(body, kind):
    head = body.vertices[body.vertices[:, 1] > 0.5].astype(np.float64)
    cover, relief = beard_cover(kind, head), beard_relief(kind, head)
    assert cover.min() >= 0 and cover.max() <= 1 and relief.min() >= 0 and relief.max() <= STANDS.get(kind, 0)
    eyes, lips = head[:, 1] > 0.715, (np.abs(head[:, 1] - LIPS_Y) < 0.003) & (np.abs(head[:, 0]) < 0.018)
    lips &= head[:, 2] > 0.13
    assert lips.sum() > 10 and cover[eyes | lips].max() < 0.06 and relief[eyes | lips].max() < 5e-4
    chin = np.array([[0.0, 0.615, 0.145]])
    lip = np.array([[0.012, LIPS_Y + 0.0115, 0.150]])
    if kind != "none":
        assert (beard_cover(kind, chin)[0] > 0.15) == (kind != "moustache")
        assert beard_cover(kind, lip)[0] > 0.15
        assert np.allclose(relief, beard_relief(kind, head * (-1, 1, 1)))


def test_paint_reaches_the_scalp_and_nothing_else(body):
    skin, hair = np.full((len(body.vertices), 3), 0.8), (0.1, 0.1, 0.1)
    foot = body.vertices.astype(np.float64)
    paint = HairPaint(
        line=Hairline(),
        density=0.9,
        flow=Flow(),
        mirrored=False,
        colour=hair,
        beard="none",
        beard_colour=hair,
    )
    shown, way = paint.painted(skin, foot), paint.line.within(foot)
    assert (shown[way < -0.012] == 0.8).all() and (skin == 0.8).all()
    assert shown[way > 0.012].max() < 0.35
    bald = replace(paint, density=0.0)
    assert (bald.painted(skin, foot) == skin).all()


def test_numbers_that_came_later_change_no_others():
    for seed in (0, 7, 12345):
        random = torch.Generator().manual_seed(seed)
        before = [
            torch.randn(1, LATENT_SIZE, generator=random),
            torch.randn(1, DRAWN_AT_ONCE, generator=random),
        ]
        later = [torch.randn(1, 1, generator=random) for _ in NEW[DRAWN_AT_ONCE:]]
        assert torch.equal(draw_latent(seed), torch.cat(before + later, dim=1))


def test_styles_by_sex_skin_and_share():
    shares = np.linspace(0.0005, 0.9995, 2000).tolist()
    women = [hair_style(share, TAGS, True, 0.0) for share in shares]
    men = [hair_style(share, TAGS, False, 0.0) for share in shares]
    assert {*women} == {"bob01", "long01", "ponytail01", "short01", "short03"}
    assert {*men} == {"short01", "short03", "long01", None}
    assert np.mean([style == "short01" for style in women]) == pytest.approx(0.05, abs=0.002)
    assert np.mean([style is None for style in men]) == pytest.approx(1 - BALD, abs=0.002)
    assert "afro01" in {hair_style(share, TAGS, False, 0.9) for share in shares}
    assert hair_style(0.3, {}, True, 0.0) is None


def test_a_third_of_men_have_a_beard():
    shares = np.linspace(0.0005, 0.9995, 2000).tolist()
    found = [beard_style(share, False) for share in shares]
    assert {*found} == {*BEARDS} and 0.3 < np.mean([kind != "none" for kind in found]) < 0.4
    assert {beard_style(share, True) for share in shares} == {"none"}


def test_every_cut_is_of_a_known_kind():
    assert {cut.kind for cut in CUTS.values()} == {0, 1, 2}
    assert all(cut.ends is None or cut.ends[0] < cut.ends[1] for cut in CUTS.values())
