"""Metrics against cases whose answers are known."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image
from scipy.linalg import sqrtm

from avatargen.body.model import pose, shape
from avatargen.body.pose import named_pose
from avatargen.data.dataset import Pictures, open_pictures
from avatargen.data.joints import project
from avatargen.data.raycast import Light, shoot
from avatargen.errors import InputError
from avatargen.generator.camera import Camera, camera_of_vector, front_camera, rays
from avatargen.generator.canonical import canonical_map
from avatargen.metrics.clothes import bare_depths, clothes_error, offsets, true_depth
from avatargen.metrics.evaluate import data_and_reference, examine, halves, set_exam
from avatargen.metrics.features import all_features, load_inception, random_features
from avatargen.metrics.finer import model_of
from avatargen.metrics.frechet import covariance, distance_error, frechet_distance
from avatargen.metrics.joints import RIDGE_POSE, fit_joints, ridge_judge, true_joints
from avatargen.metrics.judges import BUILT_IN, Judges
from avatargen.metrics.kernel_distance import kernel_distance
from avatargen.metrics.report import mean
from avatargen.metrics.shown import ShowConfig, show, turned_camera
from avatargen.metrics.warp import Pair, carry, pose_error, side_error
from avatargen.training.avatar_model import avatar_model
from tests.bodies import capsule_body
from tests.small_run import BODY, CONFIG, SIZE, make_data

RNG = np.random.default_rng(0)


def test_frechet_distance_matches_the_formula_and_shifts():
    a, b = RNG.normal(size=(400, 6)), RNG.normal(size=(300, 6)) @ RNG.normal(size=(6, 6)) + 1
    product = np.real(np.asarray(sqrtm(covariance(a) @ covariance(b))))
    plain = np.square(a.mean(0) - b.mean(0)).sum() + np.trace(covariance(a) + covariance(b) - 2 * product)
    assert frechet_distance(a, b) == pytest.approx(plain, rel=1e-8)
    assert frechet_distance(a, a + 3) == pytest.approx(6 * 9, rel=1e-9)
    assert frechet_distance(a, a) == pytest.approx(0, abs=1e-9)
    flat = np.repeat(a[:1], 50, axis=0)  # no variance at all
    assert frechet_distance(flat, flat + 1) == pytest.approx(6)


def test_the_distances_interval_shrinks_with_more_pictures_and_holds_the_truth():
    """Of shifted Gaussians the distance is known: the square of the shift."""
    held = 0
    for _ in range(20):
        a, b = RNG.normal(size=(500, 2)), RNG.normal(size=(500, 2)) + np.array([1, 0])
        held += abs(frechet_distance(a, b) - 1) < 1.96 * distance_error(a, b)
    assert held >= 15
    few, many = (distance_error(a[:n], b[:n]) for n in (60, 500))
    assert many < few


def test_features_see_colour_and_layout_and_are_the_same_everywhere():
    images = torch.rand(8, 3, 32, 32, generator=torch.Generator().manual_seed(0))
    features = all_features(random_features, images)
    assert features.shape == (8, 96) and np.array_equal(features, all_features(random_features, images))
    assert np.abs(features - all_features(random_features, images.flip(1))).mean() > 1e-3
    assert np.abs(features - all_features(random_features, images * 0.5)).mean() > 1e-3


@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of TorchScript, the format such files have
def test_only_inception_is_taken_for_the_fid(tmp_path: Path):
    class Wide(torch.nn.Module):
        def forward(self, x: torch.Tensor) -> torch.Tensor:
            return x.mean(dim=(2, 3)).repeat(1, 683)[:, :2048]

    path = tmp_path / "network.pt"
    torch.jit.trace(Wide(), torch.zeros(1, 3, 299, 299)).save(str(path))  # pyright: ignore
    network = load_inception(path)
    assert network(torch.rand(2, 3, 16, 16)).shape == (2, 2048)
    torch.jit.trace(torch.nn.Flatten(), torch.zeros(1, 3, 299, 299)).save(str(path))  # pyright: ignore
    with pytest.raises(InputError, match="2048"):
        load_inception(path)
    path.write_bytes(b"nothing")
    with pytest.raises(InputError, match=r"network\.pt"):
        load_inception(path)


def test_joints_project_to_where_rays_leave_from(tmp_path: Path):
    pictures = make_data(tmp_path / "data")
    found = true_joints(pictures, BODY, np.arange(2))
    camera = Camera(
        cam2world=torch.from_numpy(pictures.labels.camera[:1, :16].reshape(1, 4, 4)),
        intrinsics=torch.from_numpy(pictures.labels.camera[:1, 16:].reshape(1, 3, 3)),
    )
    origin, direction = (part[0].numpy() for part in rays(camera, 8))
    centers = np.stack(np.meshgrid(*[(np.arange(8) + 0.5) / 8] * 2), axis=-1).reshape(-1, 2)
    assert np.abs(project(origin + 2.5 * direction, pictures.labels.camera[0]) - centers).max() < 1e-5
    head, foot = found[0][15], found[0][10]
    assert head[1] < 0.4 < 0.6 < foot[1]
    assert found[0][16][0] > 0.5 > found[0][17][0]  # seen from the front the left shoulder is on the right


def test_the_joint_estimator_learns_where_blobs_are_on_either_side():
    """Two discs move over white pictures, each in its half; the estimator finds them in new ones."""
    centers = RNG.uniform((0.1, 0.2), (0.4, 0.8), size=(300, 2, 2)) + np.array([[0, 0], [0.5, 0]])
    y, x = np.meshgrid(*[(np.arange(32) + 0.5) / 32] * 2, indexing="ij")
    away = np.hypot(x - centers[..., 0, None, None], y - centers[..., 1, None, None])
    inside = (away < 0.1).any(axis=1)
    images = torch.from_numpy(1 - 0.8 * inside.astype(np.float32))[:, None].expand(-1, 3, -1, -1)
    partner = np.array([1, 0])
    estimate = fit_joints(images[:200], centers[:200], partner)
    errors = np.linalg.norm(estimate(images[200:]) - centers[200:], axis=2)
    assert errors.mean() < 0.03 < 0.3 * np.linalg.norm(centers[200:] - centers.mean(axis=0), axis=2).mean()
    mirrored = 1 - estimate(images[200:].flip(3))[:, partner, 0]
    assert np.abs(mirrored - estimate(images[200:])[..., 0]).max() < 0.02


def person(turn: float):
    """A capsule figure that turns, and its map to the canonical space."""
    body = capsule_body(0.05)
    rotations = named_pose("a", body.joint_names)
    rotations[0, 1] = turn
    posed = pose(body, shape(body, np.zeros(10)), rotations)
    return posed, canonical_map(posed)


def seen_by(camera: Camera, posed, mapping, size: int):
    """Colour (the canonical place), depth and mask of the posed body, by casting rays."""
    canonical, _ = mapping(torch.from_numpy(posed.vertices).float())
    colors = ((canonical + 1.3) / 3.2).clamp(0, 1).numpy()
    light = Light(ambient=1.0, direction=np.array([0.0, 1.0, 0.0]), strength=0.0)
    shot = shoot(posed.vertices, posed.shaped.body.faces, colors, camera, light, size)
    color = torch.from_numpy(shot.image.astype(np.float32) / 255).permute(2, 0, 1)
    return color, torch.from_numpy(shot.depth * 1e-4).float(), torch.from_numpy(shot.mask / 255.0).float()


def test_warp_error_is_small_for_one_person_and_large_for_two():
    camera = front_camera()
    cam2world = camera.cam2world.clone()
    cam2world[:, 1, 3] = 0.8
    camera = replace(camera, cam2world=cam2world)
    both = Camera(cam2world=cam2world.expand(2, -1, -1), intrinsics=camera.intrinsics.expand(2, -1, -1))
    people = [person(0.0), person(0.35)]
    color, depth, mask = (
        torch.stack(part) for part in zip(*(seen_by(camera, *one, 64) for one in people), strict=True)
    )
    maps = (people[0][1], people[1][1])
    pair = Pair(colors=color, depth=depth, mask=mask, camera=both)
    same = pose_error(pair, maps)
    other = pose_error(replace(pair, colors=torch.stack([color[0], 1 - color[1]])), maps)
    assert same < 0.03 < 0.1 < other
    assert np.isnan(pose_error(replace(pair, mask=mask * 0), maps))

    vertices = people[0][0].vertices
    assert np.abs(carry(vertices, *maps) - people[1][0].vertices).max() < 1e-4


def orbit(degrees: float) -> Camera:
    """A camera at the capsule figure's height, so many degrees to the side."""
    front = front_camera()
    cam2world = front.cam2world.clone()
    cam2world[:, 1, 3] = 0.8
    vector = turned_camera(replace(front, cam2world=cam2world).vector, torch.tensor([degrees]))
    return camera_of_vector(vector)


def two_sides(turn: float) -> Pair:
    """The capsule figure as two cameras see it."""
    posed, mapping = person(turn)
    cameras = [orbit(0.0), orbit(30.0)]
    color, depth, mask = (
        torch.stack(part)
        for part in zip(*(seen_by(camera, posed, mapping, 64) for camera in cameras), strict=True)
    )
    vectors = torch.cat([camera.vector for camera in cameras])
    return Pair(colors=color, depth=depth, mask=mask, camera=camera_of_vector(vectors))


def test_a_turned_camera_looks_at_the_same_axis_from_the_same_distance():
    camera, turned = orbit(0.0), orbit(30.0)
    eye, other = (each.cam2world[0, :3, 3] for each in (camera, turned))
    assert torch.allclose(eye.norm(), other.norm()) and eye[1] == other[1]
    assert float(torch.atan2(other[0], other[2])) == pytest.approx(np.radians(30), abs=1e-6)
    assert project(np.array([[0.0, 0.8, 0.0]]), turned.vector[0].numpy())[0] == pytest.approx(
        [0.5, 0.5], abs=1e-6
    )


def test_warp_from_two_sides_grows_with_noise_shifted_depth_and_another_person():
    pair = two_sides(0.0)
    exact = side_error(pair)
    assert exact < 0.02
    noise = torch.randn(pair.colors.shape, generator=torch.Generator().manual_seed(0))
    noisy = [side_error(replace(pair, colors=pair.colors + s * noise)) for s in (0.05, 0.1, 0.2)]
    shifted = [side_error(replace(pair, depth=pair.depth - s)) for s in (0.03, 0.06, 0.12)]
    assert [exact, *noisy] == sorted([exact, *noisy]) and [exact, *shifted] == sorted([exact, *shifted])
    assert noisy[-1] > 5 * exact and shifted[-1] > 2 * exact
    once = {name: getattr(pair, name)[:1] for name in ("colors", "depth", "mask")}
    flat = replace(pair, **{name: torch.cat([one, one]) for name, one in once.items()})
    assert side_error(flat) > 2 * exact  # a picture that does not turn with the camera
    assert np.isnan(side_error(replace(pair, mask=pair.mask * 0)))


def test_the_kernel_distance_is_unbiased_and_grows():
    """Of two sets of one kind it is zero on average, whatever their size; the plain sum is the same."""
    values = [kernel_distance(RNG.normal(size=(20, 4)), RNG.normal(size=(30, 4)))[0] for _ in range(300)]
    assert abs(np.mean(values)) < 3 * np.std(values) / np.sqrt(len(values)) and min(values) < 0
    a, b = RNG.normal(size=(7, 3)), RNG.normal(size=(5, 3)) + 1
    pairs = [[(x, y) for i, x in enumerate(s) for j, y in enumerate(s) if i != j] for s in (a, b)]
    pairs.append([(x, y) for x in a for y in b])
    first, second, across = (np.mean([(x @ y / 3 + 1) ** 3 for x, y in each]) for each in pairs)
    plain = first + second - 2 * across
    assert kernel_distance(a, b)[0] == pytest.approx(plain, rel=1e-9)
    shifted = [kernel_distance(a, a + s)[0] for s in (0.5, 1, 2)]
    assert shifted == sorted(shifted)


def test_means_have_intervals_and_nothing_measured_is_said():
    number = mean(np.array([1.0, 2.0, np.nan, 3.0] * 20))
    assert number is not None and number.value == pytest.approx(2) and number.count == 60
    assert 1.7 < number.low < 1.9 and 2.1 < number.high < 2.3
    assert mean(np.array([np.nan])) is None
    with pytest.raises(InputError, match="20 or more"):
        ShowConfig(pictures=3)


def judges(pictures: Pictures) -> Judges:
    """Those that are always there."""
    return Judges(features=(BUILT_IN,), joints=ridge_judge(pictures, BODY, 100))


def test_a_generator_is_measured(tmp_path: Path):
    make_data(tmp_path / "data")
    pictures = open_pictures(tmp_path / "data", SIZE)
    model = model_of(avatar_model(CONFIG, BODY).networks.eval().requires_grad_(False), BODY, None)
    by, config = judges(pictures), ShowConfig(pictures=20, reposed=4)
    report = examine(model, set_exam(pictures, pictures, BODY, by, config, model.render.raw_size))
    assert set(report.numbers) == {"frechet distance", "kernel distance", RIDGE_POSE}
    # no true depth here, and nobody solid yet
    assert report.left_out == ("depth (mm)", "clothes (mm)", "warp", "warp across poses")
    assert report.numbers[RIDGE_POSE].count == 8
    assert report.floors["frechet distance"].value < 0.01 * report.numbers["frechet distance"].value
    assert report.floors[RIDGE_POSE].value < report.numbers[RIDGE_POSE].value
    assert report.table().count("\n") == 4 and report.seconds["total"] > 0
    strange = replace(pictures, labels=replace(pictures.labels, body="f" * 64))
    with pytest.raises(InputError, match="another body"):
        set_exam(strange, pictures, BODY, by, config, 8)


def test_a_set_alone_is_its_own_reference_in_halves(tmp_path: Path):
    make_data(tmp_path / "data")
    data, reference = data_and_reference(tmp_path / "data", None, SIZE)
    whole = open_pictures(tmp_path / "data", SIZE)
    assert reference.labels.names + data.labels.names == whole.labels.names and len(data) == 4
    assert np.array_equal(data.labels.rows(), whole.labels.rows()[4:])
    assert torch.equal(data.image(0), whole.image(4))
    with pytest.raises(InputError, match="give --reference"):
        halves(whole.part(slice(1)))


def test_clothes_are_measured_against_the_bare_body(tmp_path: Path):
    """Figures 2 cm nearer, the figures themselves, and nobody: 20 mm, 0 mm, not measured."""
    thick, bare, blank = (
        make_depth(tmp_path / name, by) for name, by in (("thick", 0.02), ("bare", 0.0), ("no", None))
    )
    chosen = torch.arange(8)
    at_labels = bare_depths(bare, BODY, chosen, 32)
    sets = []
    for data in (thick, bare, blank):
        depth, cover = (
            torch.stack(part) for part in zip(*(true_depth(data, i, 32) for i in range(8)), strict=True)
        )
        sets.append(offsets(depth, cover > 0.99, at_labels))
    value, error = clothes_error(sets[0], sets[1])
    assert value == pytest.approx(20, abs=2) and error < 2  # a little less where pixels mix
    assert clothes_error(sets[1], [row[::-1] for row in sets[1]])[0] < 1e-9
    assert np.isnan(clothes_error(sets[0], sets[2])[0])


def make_depth(folder: Path, by: float | None):
    """True depth of the capsule figures of `make_data`, moved toward the camera; None: of nobody."""
    pictures = make_data(folder)
    (folder / "depth").mkdir()
    for i, name in enumerate(pictures.labels.names):
        camera = camera_of_vector(torch.from_numpy(pictures.labels.camera[i : i + 1]))
        posed = pose(BODY, shape(BODY, np.zeros(10)), pictures.labels.pose[i])
        light = Light(ambient=1.0, direction=np.array([0.0, 1.0, 0.0]), strength=0.0)
        colors = np.zeros(posed.vertices.shape, dtype=np.float32)
        depth = shoot(posed.vertices, BODY.faces, colors, camera, light, 64).depth.astype(np.int64)
        moved = np.where(depth > 0, depth - round((by or 0) / 1e-4), 0) * (by is not None)
        Image.fromarray(moved.astype(np.uint16)).save(folder / "depth" / name.removeprefix("images/"))
    return pictures


def test_sharp_geometry_is_measured_with_finer_samples_than_it_was_trained_with(tmp_path: Path):
    """With six samples a ray a surface of 1 mm is seen half a centimetre off; with 48 it is not."""
    pictures = make_depth(tmp_path / "data", 0.0)
    render = replace(CONFIG.render, raw_size=16, initial_alpha=1e-3)
    generator = avatar_model(replace(CONFIG, render=render), BODY).networks.requires_grad_(False)
    own, fine, exact = (
        show(model_of(generator, BODY, samples), pictures, ShowConfig(pictures=20, turned=0, reposed=0)).first
        for samples in (None, 48, 300)
    )
    assert generator.config.render.samples == 6
    solid = (own.cover() > 0.9) & (exact.cover() > 0.9)
    errors = [float((one.metres() - exact.metres())[solid].abs().mean()) for one in (own, fine)]
    assert errors[1] < 0.001 < 0.005 < errors[0]

    config = ShowConfig(pictures=20)
    exam = set_exam(pictures, pictures, BODY, judges(pictures), config, 16)
    report = examine(model_of(generator, BODY, 48), exam)
    assert report.numbers["depth (mm)"].value < 30 and report.numbers["clothes (mm)"].value < 30
    assert report.floors["clothes (mm)"].value == 0  # the same people
