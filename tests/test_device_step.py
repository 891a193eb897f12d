"""The training's step as a GPU takes it: no number is asked of the device, and all are those of the CPU."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from torch import Tensor

from avatargen.body.distance import BodyDistance
from avatargen.body.model import pose, shape
from avatargen.data.dataset import Pictures
from avatargen.generator import layers
from avatargen.generator.canonical import canonical_map
from avatargen.generator.closest import closest_on, surfaces_of, topology_of
from avatargen.generator.config import GEOMETRY_CHOICES, GeometryConfig
from avatargen.generator.draws import normal, uniform
from avatargen.generator.nearest import nearest_by_all
from avatargen.generator.picture import CanonicalSurface, Picture
from avatargen.generator.posing import posing_of
from avatargen.generator.room import Room
from avatargen.training import adversarial_config
from avatargen.training.adversarial import Run, step_once
from avatargen.training.adversarial_config import AdversarialConfig
from avatargen.training.adversarial_state import new_state
from avatargen.training.avatar_model import avatar_model
from avatargen.training.batches import draw_batch, to_device
from tests.bodies import capsule_body
from tests.generators import randomize
from tests.small_run import BODY, CONFIG, make_data

CHOICES = [(name, value) for name, values in GEOMETRY_CHOICES.items() for value in values]
WHOLE = slice(0, CONFIG.batch)


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Pictures:
    return make_data(tmp_path_factory.mktemp("device") / "data")


def run_on(device: torch.device, config: AdversarialConfig) -> Run:
    accelerator = SimpleNamespace(device=device, num_processes=1, is_main_process=True)
    return Run(config=config, accelerator=accelerator)  # pyright: ignore[reportArgumentType]


def step_on(device: torch.device, config: AdversarialConfig, data: Pictures) -> dict[str, Tensor]:
    """A first step, R1 and mixed styles among it."""
    config = replace(config, variety=replace(config.variety, style_mixing=1.0))
    model = avatar_model(config, BODY)
    state = new_state(config, model, data.labels.rows().shape[1], device)
    batch = to_device(draw_batch(data, config, model, 0, WHOLE, Room(rays=32, samples=100)), device)
    if device.type != "cuda":
        return step_once(state, run_on(device, config), batch, 0)
    step_once(state, run_on(device, config), batch, 0)  # kernels are made, libraries loaded
    torch.cuda.set_sync_debug_mode("error")
    try:
        return step_once(state, run_on(device, config), batch, 0)
    finally:
        torch.cuda.set_sync_debug_mode("default")


def with_choice(name: str, value: str) -> AdversarialConfig:
    choice = {name: value} | ({"distance": "raw"} if value == "none" else {})
    return replace(CONFIG, geometry=GeometryConfig(**choice))


@pytest.mark.parametrize(("name", "value"), CHOICES)
def test_a_whole_step_asks_no_device_for_a_number(name: str, value: str, data: Pictures):
    """Tensors without numbers have none to give: whatever asks for one raises."""
    numbers = step_on(torch.device("meta"), with_choice(name, value), data)
    assert all(number.is_meta for number in numbers.values())
    assert {"generator", "eikonal", "smpl", "generator_gradient"} <= set(numbers)


@pytest.mark.parametrize("change", [{"at_once": 1}, {"nearest": 3}, {"parts": True}])
def test_so_does_a_step_in_parts_with_more_vertices_and_a_network_a_part(
    change: dict, data: Pictures, monkeypatch: pytest.MonkeyPatch
):
    config = replace(CONFIG, at_once=change.get("at_once", 0))
    config = replace(config, render=replace(config.render, nearest=change.get("nearest", 1)))
    if "parts" in change:
        split_networks(monkeypatch)
    assert step_on(torch.device("meta"), config, data)["generator"].is_meta


@pytest.mark.skipif(not torch.cuda.is_available(), reason="no GPU")
@pytest.mark.parametrize("precision", ["no", "bf16"])
def test_a_gpu_is_never_waited_for(precision: str, data: Pictures):
    numbers = step_on(torch.device("cuda"), replace(CONFIG, precision=precision), data)
    assert all(torch.isfinite(number) for number in numbers.values())


def split_networks(monkeypatch: pytest.MonkeyPatch) -> None:
    debug = adversarial_config.NETWORKS["debug"]
    split = replace(debug, decoder=replace(debug.decoder, split=True))
    monkeypatch.setitem(adversarial_config.NETWORKS, "debug", split)


@contextmanager
def as_on_a_gpu() -> Iterator[None]:
    """The CPU takes the ways of a device that nobody waits for."""
    before = layers.BRANCHING.copy()
    layers.BRANCHING.clear()
    try:
        yield
    finally:
        layers.BRANCHING.update(before)


def pictured(
    config: AdversarialConfig, data: Pictures
) -> tuple[Picture, dict[str, Tensor], dict[str, Tensor]]:
    """A batch of a random model: pictures, its losses, gradients of both."""
    model = avatar_model(config, BODY)
    randomize(model.networks)
    with torch.no_grad():
        model.networks.density.p.fill_(0.02)
        for parameter in model.networks.deformation.leave.parameters():
            parameter.mul_(0.01)
    room = model.survey(data.row(torch.arange(len(data))))
    made = model.generate(draw_batch(data, config, model, 0, WHOLE, room).asked)
    own = made.losses()
    picture = made.picture
    (picture.image.square().mean() + picture.depth.mean() + torch.stack([*own.values()]).sum()).backward()
    slopes = {n: p.grad for n, p in model.networks.named_parameters() if p.grad is not None}
    return picture, {name: loss.detach() for name, loss in own.items()}, slopes


@pytest.mark.parametrize(
    ("choice", "nearest", "parts"),
    [({}, 1, True), ({"prior": "observed"}, 3, False), ({"distance": "raw"}, 1, False)],
)
def test_pictures_losses_and_gradients_are_those_of_the_cpu(
    choice: dict, nearest: int, parts: bool, data: Pictures, monkeypatch: pytest.MonkeyPatch
):
    if parts:
        split_networks(monkeypatch)
    render = replace(CONFIG.render, nearest=nearest, samples=12)
    config = replace(CONFIG, geometry=GeometryConfig(**choice), render=render)
    one, own, slopes = pictured(config, data)
    with as_on_a_gpu():
        other, others, other_slopes = pictured(config, data)
    assert one.mask.max() > 0.9
    for name in vars(one):
        assert (getattr(one, name) - getattr(other, name)).abs().max() < 1e-5, name
    assert own.keys() == others.keys() and slopes.keys() == other_slopes.keys()
    assert all((own[name] - others[name]).abs() < 2e-5 for name in own)
    for name, slope in slopes.items():
        assert (slope - other_slopes[name]).norm() <= 0.01 * slope.norm() + 1e-7, name


def bodies(count: int, pose_blend: bool = True) -> tuple[list, Tensor, Tensor]:
    """Bent people of all shapes, one of whose knees is turned by half a circle, as the CPU poses them."""
    body, rng = capsule_body(0.04, pose_blend), np.random.default_rng(0)
    betas = rng.normal(size=(count, 10)).astype(np.float32)
    turns = (rng.normal(size=(count, 24, 3)) * 0.5).astype(np.float32)
    turns[0, 4] = [np.pi, 0, 0]
    posed = [pose(body, shape(body, b), turn) for b, turn in zip(betas, turns, strict=True)]
    return posed, torch.from_numpy(betas), torch.from_numpy(turns)


@pytest.mark.parametrize("pose_blend", [False, True])
def test_many_bodies_are_posed_and_mapped_back_as_one_is(pose_blend: bool):
    people, betas, turns = bodies(3, pose_blend)
    found = posing_of(people[0].shaped.body)(betas, turns)
    for i, person in enumerate(people):
        assert np.abs(found.vertices[i].numpy() - person.vertices).max() < 1e-6
        maps = canonical_map(person).T_canonical_posed
        assert np.abs(found.T_canonical_posed[i].numpy() - maps).max() < 1e-6 * np.abs(maps).max()


@pytest.mark.parametrize("count", [1, 4])
def test_the_nearest_vertices_are_those_of_the_trees(count: int):
    people, betas, turns = bodies(2)
    posed = posing_of(people[0].shaped.body)(betas, turns)
    points = posed.vertices[:, ::7] + torch.randn(2, 1, 3) * 0.05
    squared, index = nearest_by_all(points, posed.vertices, count)
    away, expected = posed.nearest(points, count)
    assert (squared.sqrt() - away).abs().max() < 1e-5
    assert (index == expected).float().mean() > 0.999  # but for ties


def test_the_closest_points_are_those_of_the_trees():
    """Of posed bodies, from far inside to far outside, on vertices and edges too."""
    people, betas, turns = bodies(2)
    posed = posing_of(people[0].shaped.body)(betas, turns)
    faces, draw = people[0].shaped.body.faces, torch.Generator().manual_seed(0)
    corners = posed.vertices[:, torch.from_numpy(faces)[:100]]
    spread = torch.randn(2, 400, 3, generator=draw) * torch.logspace(-4, -0.7, 400)[:, None]
    points = torch.cat(
        [posed.vertices[:, :400] + spread, posed.vertices[:, :50], corners[:, :, :2].mean(dim=2)], dim=1
    )
    surfaces = surfaces_of(posed.vertices, topology_of(posed.vertices[0].numpy(), faces))
    _, near = posed.nearest(points)
    found = closest_on(surfaces, points, near[..., 0])
    for i in range(2):
        hit = BodyDistance(posed.vertices[i].numpy(), faces).query(points[i].numpy())
        error = found.distance[i].numpy() - hit.distance
        assert np.abs(error[np.abs(hit.distance) > 1e-6]).max() < 1e-5
        assert np.abs(np.abs(found.distance[i].numpy()) - np.abs(hit.distance)).max() < 1e-6
        at = [
            (posed.vertices[i].numpy()[faces[face]] * weights[..., None]).sum(axis=1)
            for face, weights in (
                (found.face[i].numpy(), found.barycentric[i].numpy()),
                (hit.face, hit.barycentric),
            )
        ]
        same = np.linalg.norm(at[0] - at[1], axis=1) < 1e-5
        assert same.mean() > 0.99  # but for points as near to two places


def test_surfaces_know_when_two_bodies_are_asked_at_once():
    surface, device = CanonicalSurface(BODY), torch.device("cpu")
    points = surface.on(device).vertices[:, :50].expand(2, -1, -1) + torch.tensor([[[0.02]], [[0.05]]])
    near = torch.arange(50).expand(2, -1)
    own = surface.on(device).at(points, near)
    with as_on_a_gpu():
        other = surface.on(device).at(points, near)
    assert (own.distance - other.distance).abs().max() < 1e-6
    for vertices in (own.vertices, other.vertices):
        assert vertices.shape == (2, 50, 3)


def test_random_numbers_are_even_independent_and_the_seeds_own():
    seeds = torch.tensor([3, 2**61, 4])
    numbers = uniform(seeds, 20_000, 0)
    assert torch.equal(uniform(seeds[1:2], 20_000, 0)[0], numbers[1]) and torch.equal(
        uniform(seeds, 10, 0), numbers[:, :10]
    )
    assert ((numbers >= 0) & (numbers < 1)).all()
    counts = torch.histc(numbers[0], 20, 0, 1)
    assert ((counts - 1000).square() / 1000).sum() < 44  # chi squared of 19, at one in a thousand
    rows = torch.cat([numbers, uniform(seeds, 20_000, 1), numbers.roll(1, 1)])
    correlation = torch.corrcoef(rows) - torch.eye(len(rows))
    assert correlation.abs().max() < 0.03
    drawn = normal(seeds, 20_000, 2)
    assert drawn.mean(dim=1).abs().max() < 0.03 and (drawn.std(dim=1) - 1).abs().max() < 0.03
    assert drawn.abs().max() < 6
