"""MakeHuman's files read, fitted and made volumes: a tube shirt made in code, and the real ones if there.

AVATARGEN_WARDROBE names a folder of MakeHuman's assets; without it, shared/wardrobe/makehuman beside the
project is looked for.
"""

import os
from dataclasses import replace
from pathlib import Path

import igl
import numpy as np
import pytest
import torch
from scipy.spatial import KDTree
from skimage.color import rgb2lab

from avatargen.artist_wardrobe import ArtistWardrobe
from avatargen.avatar import shipped
from avatargen.body.load import load_body
from avatargen.body.model import canonical_body
from avatargen.body.skinning import unskin
from avatargen.errors import InputError
from avatargen.wardrobe.appearance import Dye, dyed, rgb_of
from avatargen.wardrobe.attributes import LATENT_SIZE
from avatargen.wardrobe.cloth_grain import grain_of
from avatargen.wardrobe.dressed import under_hat
from avatargen.wardrobe.lips import LIPS_Y, between_lips
from avatargen.wardrobe.makehuman.choose import FULL_SIZE, draw_latent
from avatargen.wardrobe.makehuman.emblems import EMBLEMS, paint_out
from avatargen.wardrobe.makehuman.fit import (
    at_rest,
    carried_weights,
    fit,
    hanging,
    on_both_legs,
    straight_legs,
)
from avatargen.wardrobe.makehuman.hm08 import load_hm08
from avatargen.wardrobe.makehuman.load import FittedGarment, load_asset, load_folder
from avatargen.wardrobe.makehuman.pattern import trim_texels, used_texels
from avatargen.wardrobe.makehuman.person import ArtistGarment, unit_normals
from avatargen.wardrobe.makehuman.read import Binding, read_binding, read_mesh
from avatargen.wardrobe.makehuman.solid import Solid, boundary_loops
from avatargen.wardrobe.makehuman.strands import CELL, Strands
from avatargen.wardrobe.makehuman.truth import ClothTruth
from tests.small_wardrobe import AROUND, RINGS, write_tube

REAL = Path(
    os.environ.get("AVATARGEN_WARDROBE")
    or Path(__file__).resolve().parent.parent.parent / "shared" / "wardrobe" / "makehuman"
)
real = pytest.mark.skipif(
    not REAL.is_dir(), reason="no folder of MakeHuman's assets; AVATARGEN_WARDROBE names one"
)


@pytest.fixture(scope="module")
def hm08():
    return load_hm08()


@pytest.fixture(scope="module")
def body():
    return canonical_body(load_body(shipped("body.npz")))


@pytest.fixture(scope="module")
def tube(hm08, tmp_path_factory) -> Path:
    return write_tube(tmp_path_factory.mktemp("assets"), hm08)


@pytest.fixture(scope="module")
def shirt(tube) -> FittedGarment:
    (garment,) = load_folder(tube)
    return garment


def test_what_is_bound_to_the_bodys_own_vertices_lands_on_the_canonical_body(hm08, body):
    mine = np.flatnonzero(hm08.hm08_of_body >= 0)
    index = hm08.hm08_of_body[mine]
    alone = Binding(
        name="", tags=(), mesh=Path(), material=None, z_depth=0, scales=(None, None, None),
        indices=np.repeat(index[:, None], 3, axis=1), weights=np.tile([1.0, 0, 0], (len(mine), 1)),
        offsets=np.zeros((len(mine), 3)), hidden=np.zeros(0, np.int64),
    )  # fmt: skip
    no_faces = np.zeros((0, 3), np.int64)
    assert len(mine) > 0.97 * len(body.vertices)
    assert np.abs(fit(hm08, alone, no_faces) - body.vertices[mine]).max() < 2e-6


@pytest.fixture(scope="module")
def skirt(hm08) -> tuple[Binding, np.ndarray]:
    """A tube around both thighs, bound to their vertices."""
    angle = np.arange(24) * 2 * np.pi / 24
    heights = np.linspace(-0.25, 0.1, 8)
    points = np.array([[0.2 * np.sin(a), y, 0.03 + 0.14 * np.cos(a)] for y in heights for a in angle])
    body = np.flatnonzero(hm08.hm08_of_body >= 0)
    nearest = hm08.hm08_of_body[body][KDTree(hm08.body_at_rest[body]).query(points)[1]]
    binding = Binding(
        name="", tags=(), mesh=Path(), material=None, z_depth=0, scales=(None, None, None),
        indices=np.repeat(nearest[:, None], 3, axis=1), weights=np.tile([1.0, 0, 0], (len(points), 1)),
        offsets=10 * (points - hm08.rest[nearest]), hidden=np.zeros(0, np.int64),
    )  # fmt: skip
    faces = []
    for ring in range(7):
        for i, k in zip(range(24), np.roll(range(24), -1), strict=True):
            a, b, c, d = ring * 24 + i, ring * 24 + k, (ring + 1) * 24 + k, (ring + 1) * 24 + i
            faces += [(a, b, c), (a, c, d)]
    return binding, np.array(faces)


def test_what_hangs_between_the_legs_comes_back_when_they_close(hm08, skirt):
    binding, faces = skirt
    rest, placed = at_rest(hm08, binding), fit(hm08, binding, faces)
    hangs = hanging(hm08, rest, faces)
    assert (hangs[rest[:, 1] < -0.15] == 1).all() and (hangs[rest[:, 1] > 0.08] == 0).all()
    weights = on_both_legs(carried_weights(hm08, binding, faces), rest[:, 0], hangs)
    assert np.abs(weights.sum(axis=1) - 1).max() < 1e-9
    middle = (hangs == 1) & (np.abs(rest[:, 0]) < 1e-9)
    assert middle.any() and np.abs(weights[middle, 1] - weights[middle, 2]).max() < 1e-9
    straight = unskin(placed, weights, straight_legs())  # as an asset does it
    hem = (rest[:, 1] < -0.24) & (rest[:, 2] > 0.1)
    assert np.ptp(straight[hem, 1]) < 0.02 and np.ptp(placed[hem, 1]) > 0.04
    apart = np.concatenate([faces[np.abs(rest[faces, 0]).min(axis=1) > 0.03]])
    assert (hanging(hm08, rest, apart) == 0).all()  # two tubes are trousers


def test_helper_geometry_is_carried_with_the_limbs(hm08, body):
    """Tights, skirt and hair helpers lie around the canonical body; the last eight mark the ground."""
    carried = np.einsum("vj,jab->vab", hm08.dense_weights, hm08.T_canonical_rest)
    at = np.einsum("vab,vb->va", carried[:, :3, :3], hm08.rest) + carried[:, :3, 3]
    distance = body.distance.query(at[:-8].astype(np.float32)).distance
    assert np.abs(distance).max() < 0.45


def test_a_garment_is_fitted_named_and_textured(hm08, tube, shirt):
    assert (shirt.name, shirt.kind, shirt.z_depth, shirt.tags) == ("tube", "top", 40, ("Female",))
    binding = read_binding(tube / "clothes/tube/tube.mhclo")
    mesh = read_mesh(tube / "clothes/tube/tube.obj")
    assert np.abs(at_rest(hm08, binding) - mesh.vertices / 10).max() < 1e-5  # written with that accuracy
    assert len(shirt.vertices) == AROUND * RINGS and len(shirt.faces) == 2 * AROUND * (RINGS - 1)
    wanted = [*range(4000, 4011), 4020]
    assert set(hm08.hm08_of_body[shirt.hidden]) == set(wanted)
    high = shirt.uv[shirt.vertices[shirt.faces][..., 1] > 0.3]
    assert high[:, 1].max() < 0.35  # v counts downward here


def test_a_solid_is_closed_and_its_sign_is_the_exact_winding_number(shirt):
    solid = Solid(garment=shirt)
    vertices, faces = solid.closed
    assert len(boundary_loops(shirt.faces)) == 2
    walls = np.unique(
        np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0, return_counts=True
    )
    open_edges = walls[0][walls[1] == 1]
    assert (open_edges >= len(shirt.vertices)).all()  # along the middle, up and down again
    points = np.random.default_rng(0).uniform(vertices.min(0) - 0.04, vertices.max(0) + 0.04, (4000, 3))
    hit = solid.hit(points.astype(np.float32), reach=1.0)
    exact = np.asarray(igl.winding_number(vertices, faces, points)) > 0.5
    clear = np.abs(hit.distance) > 1e-4
    assert ((hit.distance < 0) == exact)[clear].all() and exact.sum() > 500
    assert np.abs(solid.hit(shirt.vertices).distance).max() < 1e-6
    squared = np.asarray(igl.point_mesh_squared_distance(points, vertices, faces)[0])
    assert np.abs(np.abs(hit.distance) - np.sqrt(squared)).max() < 1e-5


def test_an_open_front_is_open_as_far_as_the_middle(shirt):
    """The tube cut open in front: what is behind the gap is outside, the rest of the room inside; the hem is
    flat."""
    gap = (np.abs(shirt.vertices[shirt.faces][..., 0]) < 0.08).all(axis=1)
    kept = ~(gap & (shirt.vertices[shirt.faces][..., 2] > 0).all(axis=1))
    opened = Solid(garment=replace(shirt, faces=shirt.faces[kept], uv=shirt.uv[kept]))
    assert len(opened.loops) == 1 and np.ptp(opened.garment.vertices[opened.loops[0], 1]) > 0.3
    height = np.median(shirt.vertices[:, 1])
    points = np.array([[0, height, 0.15], [0, height, -0.1], [0.15, height, 0.02]], np.float32)
    assert (opened.hit(points, reach=1.0).distance > 0).tolist() == [True, False, False]
    low = float(shirt.vertices[:, 1].min())
    beneath = np.array([[0.1, low - 0.03, -0.03], [-0.1, low - 0.03, -0.03]], np.float32)
    assert (opened.hit(beneath, reach=1.0).distance > 0.01).all()


def test_the_way_to_an_edge_grows_from_the_rings_at_the_ends(shirt):
    rims = Solid(garment=shirt).rims[: len(shirt.vertices)].reshape(RINGS, AROUND)
    assert (rims[[0, -1]] == 0).all()
    assert (np.diff(rims[: RINGS // 2], axis=0) > 0).all()


def test_the_truth_of_cloth_is_asked_of_its_solid(shirt, body):
    truth = ClothTruth(made=ArtistGarment(solid=Solid(garment=shirt), body=body))
    points = truth.surface(3000, np.random.default_rng(0))
    again = truth.surface(3000, np.random.default_rng(0))
    distance, rim = truth.ask(points.astype(np.float32))
    assert (points == again).all() and np.abs(distance).max() < 1e-6 and (rim >= 0).all()
    low, high = truth.box
    assert (points >= low - 1e-9).all() and (points <= high + 1e-9).all()
    seen, color = truth.seen(3000, np.random.default_rng(1))
    assert len(seen) == len(color) > 2900 and color.shape[1] == 3  # a tube hides nothing of itself
    shade = (seen[:, 1] - seen[:, 1].min()) / np.ptp(seen[:, 1])  # its texture grows brighter along it
    assert abs(np.corrcoef(shade, color[:, 0])[0, 1]) > 0.95


def test_strands_fill_down_to_the_head(body):
    """A cap of cards 8 mm over the skull: closed, without a gap beneath, and its surface on the cards."""
    crown = body.vertices[body.vertices[:, 1].argmax()].astype(float)
    radius = crown[1] + 0.008 - 0.74
    centre, u = np.array([0, 0.74, crown[2]]), np.linspace(0, 2 * np.pi, 33)
    v = np.linspace(0.05, 1.1, 17)
    grid = np.array([[np.sin(b) * np.cos(a), np.cos(b), np.sin(b) * np.sin(a)] for b in v for a in u])
    quads = [
        (r * 33 + c, r * 33 + c + 1, r * 33 + c + 34, r * 33 + c + 33) for r in range(16) for c in range(32)
    ]
    faces = np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])
    cap = FittedGarment(
        name="cap", kind="hair", tags=(), vertices=(centre + radius * grid).astype(np.float32), faces=faces,
        uv=np.zeros((len(faces), 3, 2), np.float32), texture=np.full((4, 4, 4), 255, np.uint8), z_depth=0,
        hidden=np.zeros(0, np.int64),
    )  # fmt: skip
    hair = Strands(garment=cap, body=body.distance)
    clear = cap.vertices[body.distance.query(cap.vertices).distance > 0.005]
    assert len(clear) > 100 and np.abs(hair.distance(clear)).max() < 1.3 * CELL
    up = np.array([[0, y, centre[2]] for y in np.linspace(0.76, 0.74 + radius - CELL, 40)], np.float32)
    both = np.minimum(hair.distance(up), body.distance.query(up).distance)
    assert (both < 0).all()
    assert hair.distance(np.array([[0, 1.2, 0.05]], np.float32))[0] > 0.25
    assert np.allclose(hair.shade(cap.vertices), 1)
    assert_skin_beside_the_cards_is_bare(hair, body)


def assert_skin_beside_the_cards_is_bare(hair: Strands, body) -> None:
    """Skin to which no strand leads straight down within 6 mm is well outside the hair."""
    points = hair.samples[0].astype(np.float32)
    hit = body.distance.query(points)
    feet = np.einsum("nk,nka->na", hit.barycentric, body.vertices[body.faces[hit.face]])
    low, high = points.min(axis=0) - 0.02, points.max(axis=0) + 0.02
    skin = body.vertices[((body.vertices > low) & (body.vertices < high)).all(axis=1)]
    away = KDTree(np.concatenate([feet, points])).query(skin)[0] > 0.006
    assert away.sum() > 20
    assert np.quantile(hair.distance(skin[away]), 0.05) > 0.0015  # m; the rest is in notches of the hairline


def test_dyeing_moves_the_middle_and_keeps_what_differs():
    own = np.repeat(np.random.default_rng(1).uniform(0.35, 0.5, (400, 1)), 3, axis=1)
    lightness, a, b = np.median(rgb2lab(own), axis=0)
    lab = rgb2lab(dyed(own, (lightness, a, b), (0.6, 0.2, 0.3)))
    wanted = rgb2lab(np.array([[0.6, 0.2, 0.3]]))[0]
    assert np.abs(np.median(lab, axis=0) - wanted).max() < 0.5
    assert np.corrcoef(rgb2lab(own)[:, 0], lab[:, 0])[0, 1] > 0.99
    back = rgb2lab(rgb_of(lab))
    assert np.abs(back - lab).max() < 0.05  # CIELAB and back


def test_prints_lie_on_the_cloth_by_its_metres_and_leave_trim(body):
    light = np.full((600, 4), 0.9, np.float32)
    light[300:, 3] = 0
    front = np.zeros((600, 3))
    front[:, 1] = np.tile(np.linspace(0.1, 0.4, 300), 2)
    front[:, 2] = 0.15
    dye = Dye(
        middle=(90.0, 0.0, 0.0), dye=(0.1, 0.1, 0.4), kind="across", ink=(0.8, 0.1, 0.1), width=0.01,
        grain=grain_of(body),
    )  # fmt: skip
    red = dye.color(light, front)[:, 0] > 0.5
    assert (
        abs(red[:300].mean() - 1 / 3) < 0.02 and np.count_nonzero(np.diff(red[:300].astype(int)) == 1) == 10
    )
    assert np.allclose(dye.color(light, front)[300:], 0.9)  # neither dye nor print takes there


def test_pieces_of_another_colour_are_trim_and_keep_it():
    """A sheet of a dark piece and, apart from it on the texture, a small light one."""
    texture = np.full((64, 64, 4), (30, 30, 35, 255), np.uint8)
    texture[:, 52:] = (230, 230, 225, 255)
    wide, small = (
        ((0.05, 0.05), (0.7, 0.05), (0.7, 0.95), (0.05, 0.95)),
        ((0.85, 0.1), (0.95, 0.1), (0.95, 0.5)),
    )
    uv = np.array([[wide[0], wide[1], wide[2]], [wide[0], wide[2], wide[3]], small], np.float32)
    suit = FittedGarment(
        name="suit", kind="top", tags=(), vertices=np.eye(7, 3, dtype=np.float32),
        faces=np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6]]), uv=uv, texture=texture, z_depth=0,
        hidden=np.zeros(0, np.int64),
    )  # fmt: skip
    used, trim = used_texels(suit), trim_texels(suit)
    assert trim.any() and trim[:, 52:].sum() == trim.sum() == used[:, 52:].sum()


def test_hair_under_a_hat_stays_inside_it_above_its_opening():
    hair, hat, above = (
        np.array([-0.01] * 4),
        np.array([-0.02, 0.03, 0.03, -0.02]),
        np.array([0.05, 0.05, -0.04, -0.04]),
    )
    cut = under_hat(hair, hat, above, np.zeros(4))
    assert np.allclose(cut, [-0.01, 0.033, -0.01, -0.01])  # inside it, beside it, and below it twice
    # 3 cm off the head: too far at the hat's edge, where it is pressed, and not at the ears
    far = under_hat(hair[:2], np.full(2, 0.03), np.array([-0.01, -0.09]), np.full(2, 0.03))
    assert far[0] > 0 > far[1]


def test_an_opening_is_the_plane_of_the_longest_edge(shirt):
    solid = Solid(garment=shirt)
    _, normal = solid.opening
    first, second = (solid.above_opening(shirt.vertices[loop]) for loop in solid.loops)
    assert normal[1] > 0.9 and min(np.abs(first).max(), np.abs(second).max()) < 0.05
    up = (0.1 * normal).astype(np.float32)
    assert np.allclose(solid.above_opening(shirt.vertices + up) - solid.above_opening(shirt.vertices), 0.1)


def test_emblems_are_painted_out_and_nothing_else_is_touched():
    name, (box,) = "male_casualsuit02_diffuse", EMBLEMS["male_casualsuit02_diffuse"]
    texture = np.full((256, 256, 4), (40, 90, 160, 255), np.uint8)
    x0, y0, x1, y1 = (int(256 * n) for n in box)
    texture[y0 + 6 : y1 - 6, x0 + 6 : x1 - 6, :3] = (250, 130, 20)
    painted = paint_out(texture, name)
    assert np.abs(painted.astype(int) - (40, 90, 160, 255)).max() < 16
    outside = np.ones((256, 256), bool)
    outside[y0:y1, x0:x1] = False
    assert (painted[outside] == texture[outside]).all()
    assert paint_out(texture, "another") is texture


def test_the_new_numbers_of_a_latent_leave_the_old_ones_as_they_were():
    for seed in (0, 3, 2**40):
        old = torch.randn(1, LATENT_SIZE, generator=torch.Generator().manual_seed(seed))
        z = draw_latent(seed)
        assert z.shape == (1, FULL_SIZE) and torch.equal(z[:, :LATENT_SIZE], old)


@pytest.mark.parametrize(
    ("name", "old", "new", "message"),
    [
        ("tube.mhclo", "basemesh hm08", "basemesh alpha7", "made for alpha7"),
        ("tube.mhclo", "4000 - 4010", "4000 - 3900", "line"),
        ("tube.mhclo", "4000 - 4010", "99999", "outside hm08"),
        ("tube.mhclo", "obj_file tube.obj", "obj_file gone.obj", "cannot read"),
        ("tube.mhclo", " 0.33333334 ", " nan ", "NaN"),
        ("tube.mhclo", "z_depth 40", "z_depth high", "whole number"),
        ("tube.obj", "f 1/1 2/2", "f 1/1 999999/2", "beyond"),
        ("tube.obj", "v ", "v x", "line 1"),
        ("tube.png", None, None, "picture"),
    ],
)
def test_bad_files_end_in_one_sentence(tube, tmp_path, hm08, name, old, new, message):
    home = tmp_path / "clothes" / "tube"
    home.mkdir(parents=True)
    for path in (tube / "clothes/tube").iterdir():
        (home / path.name).write_bytes(path.read_bytes())
    damaged = home / name
    damaged.write_text("none" if old is None else damaged.read_text().replace(old, new, 1))
    with pytest.raises(InputError, match=message):
        load_asset(home / "tube.mhclo", hm08)


def test_a_folder_without_assets_is_refused(tmp_path):
    with pytest.raises(InputError, match="holds no clothes"):
        load_folder(tmp_path)


@pytest.fixture(scope="module")
def wardrobe(body) -> ArtistWardrobe:
    return ArtistWardrobe(REAL, body)


@real
def test_every_real_garment_lies_on_the_body(wardrobe, body):
    kinds = {garment.kind for garment in wardrobe.loaded.values()}
    assert kinds >= {"top", "bottom", "outer", "overall", "shoes", "socks", "hat", "hair"}
    for garment in wardrobe.loaded.values():
        distance = body.distance.query(garment.vertices).distance
        if garment.kind != "hair":
            reach = 0.25 if garment.kind == "bottom" else 0.16  # skirts hang free between the legs
            assert distance.min() > -0.035 and distance.max() < reach, garment.name
        edges = garment.vertices[garment.faces]
        longest = np.linalg.norm(edges - np.roll(edges, 1, axis=1), axis=2).max()
        assert longest < 0.2, garment.name  # a torn garment has faces across the room


@real
def test_a_real_person_is_a_whole_field(wardrobe):
    """Of one seed: attributes are the same each time, skin that clothes hide never comes out."""
    person = wardrobe.sample(3)
    assert person.attributes == wardrobe.attributes(3)
    points = torch.from_numpy(person.body.vertices[person.field.hidden > 0])
    on_surface = person.sdf(points).abs() < 1e-4  # m; elsewhere it is under cloth, or cut away with air there
    assert float(on_surface.float().mean()) < 0.01
    normals = unit_normals(person.body.vertices, person.body.faces)
    shell = person.body.vertices + 0.0005 * normals
    colour = person.color(torch.from_numpy(shell.astype(np.float32)))
    assert colour.min() >= 0 and colour.max() <= 1 and bool(torch.isfinite(colour).all())


@real
@pytest.mark.parametrize("name", ["short04", "ponytail01"])
def test_real_hair_ends_where_its_cards_do(wardrobe, body, name):
    assert_skin_beside_the_cards_is_bare(Strands(garment=wardrobe.loaded[name], body=body.distance), body)


@real
def test_a_suit_keeps_its_shirt_and_tie(wardrobe):
    """However a suit is dyed: the shirt's front and tie are the artist's, half of them nearly white."""
    suit = wardrobe.loaded["male_elegantsuit01-top"]
    trim = trim_texels(suit)
    made = wardrobe.made(suit.name)
    assert 0.02 < trim.sum() / used_texels(suit).sum() < 0.1
    assert (made.takes[trim] == 0).all() and (made.takes[made.used & ~trim] == 255).all()


@real
def test_no_slit_is_left_between_the_lips(wardrobe, body):
    person = wardrobe.sample(3)
    y = np.linspace(LIPS_Y - 0.0015, LIPS_Y + 0.0015, 7)
    ahead = np.stack([0 * y, y, np.full(7, 0.2)], axis=1)
    for _ in range(60):
        ahead[:, 2] -= 0.9 * person.sdf(torch.from_numpy(ahead.astype(np.float32))).numpy()
    assert np.abs(np.diff(ahead[:, 2])).max() < 0.0008  # m, over half a millimetre of height
    assert not between_lips(body.vertices[body.vertices[:, 1] > LIPS_Y + 0.02]).max() > 1e-5
