"""The four baselines: what they render is what their fields say, and each follows its paper where it can be
measured.
"""

import itertools
import json
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.torch import save
from torch import Tensor, nn
from torch.utils._python_dispatch import TorchDispatchMode

from avatargen.avatar import training_body
from avatargen.baselines import stylesdf
from avatargen.baselines.baseline import Baseline
from avatargen.baselines.giraffe_hd import GiraffeHD, lay_over
from avatargen.baselines.layers import wave_count, waves
from avatargen.baselines.models import BASELINES, load_model, new_baseline
from avatargen.baselines.stylenerf import ShuffleUpsampler, StyleNeRF
from avatargen.baselines.stylesdf import StyleSDF, distance_to_box
from avatargen.baselines.volume import Rays, box_rays, render_once, render_twice, spread, where_it_is
from avatargen.body.model import canonical_body
from avatargen.commands.main import main
from avatargen.errors import InputError
from avatargen.generator.camera import camera_of_vector
from avatargen.generator.checkpoint import read_tensors
from avatargen.generator.config import for_body
from avatargen.generator.density import Density
from avatargen.generator.generator import AvatarGenerator
from avatargen.training.adversarial import train
from avatargen.training.adversarial_config import NETWORKS, PRESETS
from avatargen.training.avatar_model import AvatarModel, avatar_model
from avatargen.training.picture_model import Asked, PictureModel
from tests.small_run import BODY, CONFIG, accelerator, camera, make_data

B, R, S = 4, CONFIG.render.raw_size, CONFIG.render.image_size
CENTER, RADIUS = torch.tensor([0.0, 0.8, 0.0]), 0.3
BOX = torch.tensor([[-1.0, -0.2, -0.7], [1.0, 1.8, 0.7]])


@pytest.fixture(autouse=True)
def one_thread() -> Iterator[None]:
    """Small operations are fastest so."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


def model_of(name: str, **render: int) -> Baseline:
    return new_baseline(name, replace(CONFIG, render=replace(CONFIG.render, **render)), BODY)


def awake(model: Baseline) -> Baseline:
    """With random numbers where networks start at zero, so that everything has a part in the picture."""
    draw = torch.Generator().manual_seed(3)
    for parameter in model.parameters():
        if not parameter.any():
            parameter.data = torch.randn(parameter.shape, generator=draw) * 0.3
    return model


def asked(model: Baseline, **changes: object) -> Asked:
    draw = torch.Generator().manual_seed(0)
    front = camera().vector.expand(B, -1)
    settings = {
        "z": torch.randn(B, model.z_size, generator=draw),
        "other_z": torch.randn(B, model.z_size, generator=draw),
        "crossover": 0,
        "camera": front,
        "mapped_camera": front,
        "pose": 0.3 * torch.randn(B, len(BODY.parents), 3, generator=draw),
        "betas": torch.randn(B, 10, generator=draw),
        "seeds": torch.arange(B) + 1,
    }
    return Asked(**settings | changes)  # pyright: ignore[reportArgumentType]


def in_one(model: Baseline, **changes: object) -> Tensor:
    """Everything that a model answers, in a row."""
    with torch.no_grad():
        picture = model.generate(asked(model, **changes)).picture
    return torch.cat([part.flatten(1) for part in vars(picture).values()], dim=1)


@pytest.mark.parametrize("name", BASELINES)
def test_pictures_come_as_avatargens_do(name: str) -> None:
    model = model_of(name)
    picture = model.generate(asked(model)).picture

    assert picture.image.shape == (B, 3, S, S)
    assert picture.raw.shape == (B, 3, R, R)
    assert picture.depth.shape == picture.mask.shape == (B, R, R)
    assert ((picture.mask >= 0) & (picture.mask <= 1)).all()
    assert ((picture.depth > 1.5) & (picture.depth < 5)).all()  # the camera stands 3.2 m away
    assert all(part.isfinite().all() for part in vars(picture).values())


@pytest.mark.parametrize("name", BASELINES)
def test_losses_reach_every_parameter_that_learns(name: str) -> None:
    model = awake(model_of(name))
    made = model.generate(asked(model, crossover=1))
    picture, losses = made.picture, made.losses()
    (picture.image.square().mean() + picture.raw.square().mean() + sum(losses.values())).backward()

    for parameter_name, parameter in model.named_parameters():
        if parameter.requires_grad:
            assert parameter.grad is not None, parameter_name
            assert parameter.grad.isfinite().all(), parameter_name
            assert parameter.grad.any(), parameter_name
    learning = {id(p) for group in model.groups(CONFIG.optimizer) for p in group["params"]}
    assert learning == {id(p) for p in model.parameters() if p.requires_grad}


@pytest.mark.parametrize("name", BASELINES)
def test_pictures_depend_on_all_that_is_asked_and_on_nothing_else(name: str) -> None:
    model = awake(model_of(name)).eval()
    base = in_one(model)
    turned = camera().vector.clone()
    turned[:, 3] += 0.3

    assert torch.equal(base, in_one(model))
    assert torch.equal(base, in_one(model, other_z=torch.zeros(B, model.z_size)))
    changes = {
        "z": torch.ones(B, model.z_size),
        "pose": torch.zeros(B, len(BODY.parents), 3),
        "betas": torch.zeros(B, 10),
        "camera": turned.expand(B, -1),
        "mapped_camera": turned.expand(B, -1),
        "seeds": torch.arange(B) + 9,
        "crossover": 1,
    }
    for what, value in changes.items():
        assert not torch.allclose(base, in_one(model, **{what: value}), atol=1e-4), what
    firsts = {k: v[:1] if isinstance(v, Tensor) else v for k, v in vars(asked(model)).items()}
    alone = Asked(**firsts)  # pyright: ignore[reportArgumentType]
    with torch.no_grad():
        picture = model.generate(alone).picture
    assert torch.allclose(picture.image.flatten(1), base[:1, : 3 * S * S], atol=1e-4)


class NoWaiting(TorchDispatchMode):
    """Refuses every operation by which a host waits for a device's numbers."""

    refused = (
        "_local_scalar_dense",
        "nonzero",
        "masked_select",
        "unique",
        "equal",
        "is_nonzero",
        "lift_fresh",
    )

    def __torch_dispatch__(self, func, types, args=(), kwargs=None):
        name = func.name().removeprefix("aten::").split(".")[0]
        assert name not in self.refused, name
        return func(*args, **kwargs or {})


@pytest.mark.parametrize("name", BASELINES)
def test_a_step_waits_for_no_number(name: str) -> None:
    model = model_of(name)
    label = asked(model)
    with NoWaiting():
        made = model.generate(label)
        sum(made.losses().values(), made.picture.image.mean()).backward()
    with pytest.raises(AssertionError), NoWaiting():
        float(made.picture.image.detach().sum())


@pytest.mark.parametrize("name", BASELINES)
def test_a_method_can_draw_people_that_it_is_shown(name: str) -> None:
    """Told by squares what a picture should be, it comes nearer at once: gradients point the right way."""
    model, label = model_of(name), asked(model_of(name))
    place = torch.linspace(-1, 1, S)
    person = (place.abs() < 0.25).float() * (place.abs() < 0.7).float()[:, None]
    target = 1 - person * torch.tensor([0.8, 0.3, 0.7])[:, None, None]
    optimizer = torch.optim.Adam(model.groups(CONFIG.optimizer), betas=(0.0, 0.99))
    errors = []
    for _ in range(60):
        picture = model.generate(label).picture
        error = (picture.image - target).square().mean()
        small = nn.functional.interpolate(target[None], size=(R, R), mode="area")
        optimizer.zero_grad()
        (error + (picture.raw - small).square().mean()).backward()
        optimizer.step()
        errors.append(float(error.detach()))

    assert errors[-1] < 0.5 * errors[0]


@pytest.fixture(scope="module")
def avatargen_sizes() -> Callable[[str], int]:
    """How many numbers AvatarGen learns in a preset, on the shipped body."""
    body = canonical_body(training_body(None))

    @cache
    def size(preset: str) -> int:
        config = PRESETS[preset]
        networks = replace(NETWORKS[config.networks], render=config.render, deformation=config.deformation)
        with torch.device("meta"):
            generator = AvatarGenerator(for_body(networks, body))
        return sum(p.numel() for p in generator.parameters())

    return size


def sphere(points: Tensor, direction: Tensor) -> tuple[Tensor, Tensor]:
    """A distance, and a colour that says where a point is."""
    distance = (points - CENTER.to(points)).norm(dim=-1) - RADIUS
    return distance, points * torch.ones_like(direction)


def front_rays(size: int) -> Rays:
    return box_rays(camera_of_vector(camera().vector), size, BOX)


def test_rendering_sees_a_sphere_where_it_is() -> None:
    rays = front_rays(33)  # the middle ray meets the centre
    density = Density(0.003)
    middle = torch.full((1, 33 * 33, 24), 0.5)
    with torch.no_grad():
        once = render_once(sphere, rays, middle, density)
        twice = render_twice(sphere, rays, middle[..., :12], middle[..., :12], density)

    closest = torch.linalg.cross(CENTER - rays.origin, rays.direction).norm(dim=-1)
    for seen, off in ((once, 0.01), (twice, 0.01)):
        assert abs(float(seen.depth[0, 33 * 16 + 16]) - (3.2 - RADIUS)) < off
        assert (seen.mask[closest < 0.85 * RADIUS] > 0.98).all()
        assert (seen.mask[closest > 1.15 * RADIUS] < 0.02).all()
        there = rays.origin + seen.depth[..., None] * rays.direction
        hit = closest < 0.8 * RADIUS
        assert (seen.features[hit] - there[hit]).abs().max() < 0.06


def test_fog_of_equal_density_stops_light_by_beers_law() -> None:
    rays = front_rays(9)
    density = Density(0.5, "density")
    number = torch.tensor(0.2)

    def fog(points: Tensor, _: Tensor) -> tuple[Tensor, Tensor]:
        return number.expand(points.shape[:2]), torch.ones_like(points)

    middle = torch.full((1, 81, 4), 0.5)
    sigma = density(number)
    wanted = 1 - torch.exp(-sigma * (rays.far - rays.near))
    for seen in (render_once(fog, rays, middle, density), render_twice(fog, rays, middle, middle, density)):
        assert torch.allclose(seen.mask, wanted, atol=1e-5)
        assert torch.allclose(seen.features[..., 0], wanted, atol=1e-5)


def test_second_samples_go_where_the_light_is_stopped() -> None:
    """In the numbers that a slow walk along the pieces gives."""
    rays = front_rays(3).some(torch.tensor([[0, 4]]))
    draw = torch.Generator().manual_seed(0)
    sigma = 5 * torch.rand(1, 2, 8, generator=draw)
    depth = where_it_is(sigma, rays, torch.rand(1, 2, 400, generator=draw))

    assert (depth.diff(dim=-1) >= 0).all()
    for ray in range(2):
        near, far = float(rays.near[0, ray]), float(rays.far[0, ray])
        step = (far - near) / 8
        left, weights = 1.0, []
        for s in sigma[0, ray].tolist():
            weights.append(left * (1 - np.exp(-s * step)))
            left -= weights[-1]
        wide = [max(pair) for pair in zip([0.0, *weights], [*weights, 0.0], strict=True)]
        smooth = [(a + b) / 2 + 0.01 / 8 for a, b in itertools.pairwise(wide)]
        counts = np.histogram(depth[0, ray], bins=8, range=(near, far))[0]
        assert np.abs(counts / 400 - np.array(smooth) / sum(smooth)).max() < 0.005


def test_samples_fill_their_rays() -> None:
    rays = front_rays(4)
    samples = spread(rays, torch.rand(1, 16, 6, generator=torch.Generator().manual_seed(0)))
    assert torch.allclose(samples.length.sum(dim=-1), rays.far - rays.near, atol=1e-5)
    bins = (samples.depth - rays.near[..., None]) / (rays.far - rays.near)[..., None] * 6
    assert torch.equal(bins.floor(), torch.arange(6.0).expand_as(bins))


def test_waves_are_counted() -> None:
    x = torch.rand(5, 3)
    made = waves(x, 4)
    assert made.shape == (5, wave_count(3, 4))
    assert torch.allclose(made[:, 3 + 1], torch.sin(2 * torch.pi * x[:, 0]), atol=1e-5)
    assert torch.allclose(made[:, 15 + 4 + 2], torch.cos(4 * torch.pi * x[:, 1]), atol=1e-5)


def slow_distance_to_box(point: np.ndarray, half: np.ndarray) -> float:
    """By the nearest of many points of the six sides."""
    u = np.linspace(-1, 1, 201)
    grid = np.stack(np.meshgrid(u, u), axis=-1).reshape(-1, 2)
    nearest = np.inf
    for axis in range(3):
        for side in (-1.0, 1.0):
            face = np.insert(grid, axis, side, axis=1) * half
            nearest = min(nearest, np.linalg.norm(face - point, axis=1).min())
    return float(-nearest if (np.abs(point) < half).all() else nearest)


def test_distance_to_a_box_is_that_to_its_sides() -> None:
    half = np.array([0.2, 0.8, 0.3])
    points = np.random.default_rng(0).uniform(-1, 1, (40, 3))
    found = distance_to_box(torch.from_numpy(points), torch.from_numpy(half))
    wanted = [slow_distance_to_box(point, half) for point in points]
    assert np.abs(found.numpy() - np.array(wanted)).max() < 0.01


def test_stylesdf_starts_from_a_field_of_slope_one() -> None:
    model = model_of("stylesdf")
    assert isinstance(model, StyleSDF)
    model.distance.weight.data.zero_()
    w = torch.zeros(B, model.config.mapping.w_size)
    losses = model.surface_losses(w, torch.arange(B))
    assert float(losses["eikonal"].detach()) < 1e-6
    points = model.anywhere(torch.arange(B), 2000)
    distance, _ = model.surface(w, points)
    share = float((distance < 0).float().mean())
    assert abs(share - np.prod(stylesdf.SLENDER)) < 0.01
    assert float(losses["minimal_surface"].detach()) < 0.05 * 0.05


def test_stylesdf_sees_a_sphere_where_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    model = model_of("stylesdf", samples=64)
    assert isinstance(model, StyleSDF)
    model.distance.weight.data.zero_()
    middle = model.box.mean(dim=0)
    monkeypatch.setattr(stylesdf, "distance_to_box", lambda points, _: (points - 0).norm(dim=-1) - RADIUS)
    monkeypatch.setattr(model, "density", Density(0.002))
    turned = camera().vector.clone()
    turned[:, [3, 7, 11]] = middle + torch.tensor([0.0, 0.0, 3.2])
    picture = model.generate(asked(model, camera=turned.expand(B, -1), seeds=None)).picture

    origin, direction = box_rays(camera_of_vector(turned), R, model.box).origin, None
    rays = box_rays(camera_of_vector(turned), R, model.box)
    along = ((middle - origin) * rays.direction).sum(dim=-1)
    closest2 = (middle - origin).square().sum(dim=-1) - along**2
    hit = closest2 < (0.8 * RADIUS) ** 2
    wanted = along - (RADIUS**2 - closest2).clamp_min(0).sqrt()
    assert direction is None and hit.sum() >= 4
    assert (picture.depth[0].flatten() - wanted[0])[hit[0]].abs().max() < 0.01
    assert (picture.mask[0].flatten()[hit[0]] > 0.99).all()


def test_stylenerf_starts_by_bilinear_enlargement() -> None:
    """A pixel shuffle of repeated channels is nearest-neighbour; blurred by 1 2 1 it is bilinear."""
    x = torch.randn(2, 5, 6, 6, generator=torch.Generator().manual_seed(0))
    found = ShuffleUpsampler(5)(x)
    wanted = nn.functional.interpolate(x, scale_factor=2, mode="bilinear", align_corners=False)
    assert torch.allclose(found, wanted, atol=1e-5)


def test_stylenerfs_straight_path_is_the_picture_where_nothing_is_enlarged() -> None:
    model = awake(model_of("stylenerf", image_size=R))
    loss = model.generate(asked(model, seeds=None)).losses()["nerf_path"]
    assert float(loss.detach()) < 1e-10


def test_stylenerfs_straight_path_is_the_picture_of_a_fog() -> None:
    """Where all rays see the same, enlarging and rendering at full size agree, whatever the layers do; and
    where they do not, the loss says so.
    """
    model = awake(model_of("stylenerf"))
    assert isinstance(model, StyleNeRF)
    other = float(model.generate(asked(model)).losses()["nerf_path"].detach())
    rays = model.rays(asked(model), R)
    seen = render_once(
        lambda points, _: (torch.full(points.shape[:2], -9.0), torch.ones(*points.shape[:2], 16)),
        rays,
        torch.full((B, R * R, 6), 0.5),
        model.density,
    )
    w = model.styles(asked(model))[0]
    for (
        name,
        part,
    ) in model.named_parameters():  # what is learned differs among a pixel's four; only repeat it
        if name.startswith("grow.") and ".leave." in name:
            part.data.zero_()
    image = model.enlarge(seen.features, model.first_color(seen, w), w)
    straight = model.straight(seen, w)
    assert torch.allclose(image[:, :, S // 2, S // 2], straight[:, 0], atol=1e-4)
    assert other > 1e-6


def test_foreground_hides_what_lies_behind() -> None:
    front, behind = torch.rand(2, 3, 8, 8), torch.rand(2, 3, 8, 8)
    assert torch.equal(lay_over(front, torch.ones_like(front), behind), front)
    assert torch.equal(lay_over(torch.zeros_like(front), torch.zeros_like(front), behind), behind)


@pytest.mark.parametrize(("level", "visible"), [(-50.0, True), (400.0, False)])
def test_giraffe_hd_lays_the_object_over_the_background(level: float, visible: bool) -> None:
    model = model_of("giraffe-hd")
    assert isinstance(model, GiraffeHD)
    model.front.sigma.bias.data.fill_(level)
    before = model.generate(asked(model)).picture
    model.back.leave.weight.data.neg_()
    model.back.sigma.bias.data.fill_(20.0)
    after = model.generate(asked(model)).picture
    moved = (after.raw - before.raw).abs()[:, :, R // 2, R // 2]
    assert (moved.amax(dim=1) > 1e-3).all() if visible else (moved < 1e-6).all()
    assert torch.allclose(before.mask, after.mask)


def test_giraffe_hds_masks_are_held_as_its_paper_says() -> None:
    model = model_of("giraffe-hd")
    assert isinstance(model, GiraffeHD)
    config = model.config
    half = torch.zeros(2, S, S)
    half[0, : S // 2] = 1
    everywhere = torch.ones(2, S, S, dtype=torch.bool)

    def losses(mask: Tensor, meets: Tensor) -> tuple[float, ...]:
        return tuple(float(loss) for loss in model.mask_losses(mask, meets).values())

    assert losses(half, everywhere) == pytest.approx((config.coverage * config.least / 2, 0, 0))
    grey = torch.full((2, S, S), 0.25)
    assert losses(grey, everywhere) == pytest.approx((0, config.binary * 0.25, 0))
    assert losses(half, ~everywhere) == pytest.approx(
        (config.coverage * config.least / 2, 0, config.inside * 0.25)
    )
    back = camera().vector.clone()
    back[:, 11] += 4.0  # four metres farther away, the box no longer fills the picture
    meets = model.meets_box(asked(model, camera=back.expand(B, -1)))
    assert meets[:, S // 2, S // 2].all()
    assert not meets.all()


@pytest.mark.parametrize("name", BASELINES)
@pytest.mark.parametrize("preset", ["cpu", "gpu", "paper"])
def test_baselines_are_about_as_large_as_avatargen(
    name: str, preset: str, avatargen_sizes: Callable[[str], int]
) -> None:
    with torch.device("meta"):
        model = new_baseline(name, PRESETS[preset], BODY)
    share = sum(p.numel() for p in model.parameters()) / avatargen_sizes(preset)
    assert 0.3 < share < 1.6, share


@pytest.mark.parametrize("name", BASELINES)
def test_a_run_can_be_stopped_and_goes_on_and_its_weights_are_read_back(name: str, tmp_path: Path) -> None:
    pictures = make_data(tmp_path / "data")
    config = replace(CONFIG, images=8)

    def run(out: Path, images: int) -> PictureModel:
        model = new_baseline(name, config, BODY)
        return train(
            replace(config, images=images), model, pictures, BODY, out, accelerator(), lambda _: None
        )

    whole = run(tmp_path / "whole", 8)
    run(tmp_path / "parts", 4)
    parts = run(tmp_path / "parts", 8)

    for name_of, value in whole.state_dict().items():
        assert torch.equal(value, parts.state_dict()[name_of]), name_of
    read = load_model(tmp_path / "parts" / "generator.safetensors", BODY)
    assert isinstance(read, Baseline) and isinstance(parts, Baseline)
    assert read.config == parts.config
    assert torch.equal(in_one(read), in_one(parts))
    assert (tmp_path / "parts" / "pictures" / "000000008.png").exists()
    last = json.loads((tmp_path / "parts" / "log.jsonl").read_text().splitlines()[-1])
    assert set(made_losses(parts)) <= set(last)


def made_losses(model: PictureModel) -> dict[str, Tensor]:
    assert isinstance(model, Baseline)
    return model.generate(asked(model)).losses()


def test_another_method_does_not_go_on_in_a_folder(tmp_path: Path) -> None:
    pictures = make_data(tmp_path / "data")
    config = replace(CONFIG, images=2)
    for name, refused in (("eg3d", False), ("stylesdf", True)):
        with pytest.raises(InputError, match="other settings") if refused else nullcontext():
            train(
                config,
                new_baseline(name, config, BODY),
                pictures,
                BODY,
                tmp_path / "run",
                accelerator(),
                lambda _: None,
            )


def test_avatargens_weights_are_read_by_the_same_function(tmp_path: Path) -> None:
    model = avatar_model(CONFIG, BODY)
    model.save(tmp_path / "a.safetensors", {})
    read = load_model(tmp_path / "a.safetensors", BODY)
    assert isinstance(read, AvatarModel)
    assert read.networks.config == model.networks.config


def damaged(path: Path, change: Callable[[dict[str, Tensor], dict[str, str]], None]) -> Path:
    tensors, metadata = read_tensors(path)
    change(tensors, metadata)
    path.write_bytes(save(tensors, metadata))
    return path


def with_settings(**changes: object) -> Callable[[dict[str, Tensor], dict[str, str]], None]:
    def change(_: dict[str, Tensor], metadata: dict[str, str]) -> None:
        metadata["config"] = json.dumps(json.loads(metadata["config"]) | changes)

    return change


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda tensors, _: tensors.pop("leave.bias"), "lacks 1 tensors"),
        (lambda tensors, _: tensors.update(more=torch.ones(2)), "1 unknown tensors"),
        (lambda tensors, _: tensors["leave.bias"].fill_(torch.nan), "NaN or infinity"),
        (lambda _, metadata: metadata.update(model="eg4d"), "'eg4d'"),
        (lambda _, metadata: metadata.update(config="{"), "damaged"),
        (with_settings(width=4000, points=4000), "larger networks than the file holds|is torch.float32"),
        (with_settings(width=10**9), "it must be 1 to"),
        (with_settings(low=(0.0, 0.0, 9.0)), "holds nobody"),
        (with_settings(colour="red"), "unknown settings"),
        (with_settings(width="wide"), "damaged"),
        (with_settings(body_hash="another"), "another body"),
    ],
)
def test_a_damaged_file_is_refused_in_a_sentence(
    change: Callable[[dict[str, Tensor], dict[str, str]], None], said: str, tmp_path: Path
) -> None:
    path = tmp_path / "eg3d.safetensors"
    model_of("eg3d").save(path, {})
    with pytest.raises(InputError, match=said):
        load_model(damaged(path, change), BODY)


def test_the_command_trains_a_method_by_name(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["--preset", "debug", "--data", str(tmp_path), "--out", str(tmp_path / "run"), "--model"]
    assert main(["train", *words, "stylegan"]) == 2
    assert "eg3d" in capsys.readouterr().err
    assert main(["train", *words, "eg3d", "--start-from", "shipped"]) == 2
    assert "starts from random weights" in capsys.readouterr().err
