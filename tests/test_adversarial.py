"""Adversarial training: it learns, stops, resumes, divides and refuses as promised."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
import torch
from torch import Tensor
from torch.nn import functional as F

from avatargen.body.model import canonical_body
from avatargen.commands.main import main
from avatargen.data.dataset import Pictures, open_pictures
from avatargen.errors import InputError, TrainingError
from avatargen.generator.checkpoint import load_checkpoint
from avatargen.generator.config import GEOMETRY_CHOICES, GeometryConfig, body_hash
from avatargen.generator.density import Density
from avatargen.generator.generator import AvatarGenerator
from avatargen.training.adversarial import (
    Run,
    blur,
    look,
    snapshot_is_due,
    step_once,
    train,
    update_average,
)
from avatargen.training.adversarial_config import AdversarialConfig, VarietyConfig
from avatargen.training.adversarial_state import State, new_state
from avatargen.training.avatar_model import AvatarModel, avatar_model, first_weights
from avatargen.training.batches import batches, draw_batch
from tests.small_run import BODY, CONFIG, GREEN, SIZE, accelerator, make_data, small_run

WHOLE = slice(0, CONFIG.batch)


@pytest.fixture(scope="module", autouse=True)
def one_thread() -> Iterator[None]:
    """Small operations are fastest so; and numbers are compared with those of processes that have one."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("adversarial")
    make_data(folder / "data")
    return folder


@pytest.fixture
def pictures(folder: Path) -> Pictures:
    return open_pictures(folder / "data", SIZE)


def fresh(config: AdversarialConfig, pictures: Pictures) -> tuple[State, Run]:
    model = avatar_model(config, BODY)
    state = new_state(config, model, pictures.labels.rows().shape[1], torch.device("cpu"))
    return state, Run(config=config, accelerator=accelerator())


def networks_of(state: State, kind: Literal["generator", "average"] = "generator") -> AvatarGenerator:
    model = getattr(state, kind)
    assert isinstance(model, AvatarModel)
    return model.networks


def run_steps(
    config: AdversarialConfig, pictures: Pictures, count: int
) -> tuple[State, list[dict[str, float]]]:
    state, run = fresh(config, pictures)
    lines = []
    for step in range(count):
        batch = draw_batch(pictures, config, state.generator, step, WHOLE)
        lines.append({name: float(value) for name, value in step_once(state, run, batch, step).items()})
    return state, lines


def greenness(state: State, pictures: Pictures) -> float:
    """How far green stands out of the colour of generated people."""
    with torch.no_grad():
        batch = draw_batch(pictures, CONFIG, state.generator, 10**6, WHOLE)
        seen = state.generator.generate(batch.asked).picture
    red, green, blue = seen.raw.permute(0, 2, 3, 1)[seen.mask > 0.5].mean(dim=0)
    return float(green - (red + blue) / 2)


def test_people_take_the_colour_of_the_pictures(pictures: Pictures):
    """Nothing but the discriminator tells the generator that people are green."""
    config = replace(CONFIG, variety=VarietyConfig(blur=0.0))
    state, run = fresh(config, pictures)
    before = greenness(state, pictures)
    for step in range(40):
        step_once(state, run, draw_batch(pictures, config, state.generator, step, WHOLE), step)
    assert greenness(state, pictures) > before + 0.1
    assert GREEN[1] - (GREEN[0] + GREEN[2]) / 2 > 0.4  # what it is on its way to


def test_a_killed_run_continues_with_the_same_numbers(folder: Path):
    """kill -9 between snapshots, and again; then the same log and weights as never stopped."""
    out = folder / "killed"
    lines = out / "log.jsonl"
    small_run(folder / "data", folder / "whole")
    for wanted in (3, 5):  # lines: snapshots are after 2, 4, 6
        process = subprocess.Popen(
            [sys.executable, "-m", "tests.small_run", str(folder), "12", "0.5", str(out)]
        )
        while process.poll() is None and not (lines.exists() and lines.read_bytes().count(b"\n") >= wanted):
            time.sleep(0.05)
        os.kill(process.pid, signal.SIGKILL)
        assert process.wait() == -signal.SIGKILL
    lines.write_bytes(
        lines.read_bytes() + b'{"images": 999, "gen'
    )  # as a kill in the middle of a line leaves it
    small_run(folder / "data", out)

    assert lines.read_text() == (folder / "whole" / "log.jsonl").read_text()
    a, b = (load_checkpoint(folder / name / "generator.safetensors") for name in ("whole", "killed"))
    assert a.weights_hash == b.weights_hash
    assert [json.loads(line)["images"] for line in lines.read_text().splitlines()] == list(range(2, 13, 2))


def test_two_processes_step_as_one_does(folder: Path):
    """Both networks after two steps, R1 and geometry losses among them."""
    small_run(folder / "data", folder / "one", replace(CONFIG, images=4))
    two = folder / "two"
    environment = os.environ | {"MASTER_ADDR": "127.0.0.1", "MASTER_PORT": "29641", "WORLD_SIZE": "2"}
    environment |= {"ACCELERATE_USE_CPU": "true", "GLOO_SOCKET_IFNAME": "lo"}
    command = [sys.executable, "-m", "tests.small_run", str(folder), "4", "0", str(two)]
    processes = [
        subprocess.Popen(command, env=environment | {"RANK": str(rank), "LOCAL_RANK": str(rank)})
        for rank in range(2)
    ]
    try:
        assert [process.wait(timeout=600) for process in processes] == [0, 0]
    finally:  # one that has failed leaves the other waiting
        for process in processes:
            process.kill()
            process.wait()
    states = [torch.load(folder / name / "state.pt", weights_only=True) for name in ("one", "two")]
    for part in ("generator", "discriminator"):
        a, b = (state[part] for state in states)
        # Adam's first steps are a rate (2e-3) whatever the gradient: one that is nearly nothing may differ
        assert max(float((a[name] - b[name]).abs().max()) for name in a) < 5e-4, part
        off = torch.cat([(a[name] - b[name]).abs().flatten() for name in a])
        assert float(off.mean()) < 1e-6, (part, float(off.mean()))
    moments = [state["generator_optimizer"]["state"][0]["exp_avg"] for state in states]
    assert (moments[0] - moments[1]).abs().max() < 1e-3 * moments[0].abs().max()


def test_a_process_draws_its_part_of_the_same_batch(pictures: Pictures):
    config = replace(CONFIG, variety=VarietyConfig(style_mixing=0.5))
    networks = avatar_model(config, BODY)
    whole = draw_batch(pictures, config, networks, 7, WHOLE)
    parts = [draw_batch(pictures, config, networks, 7, slice(i, i + 1)) for i in (0, 1)]
    for name in ("real", "real_label", "label"):
        assert torch.equal(getattr(whole, name), torch.cat([getattr(part, name) for part in parts]))
    for name in ("z", "other_z", "mapped_camera", "pose", "seeds"):
        drawn = torch.cat([getattr(part.asked, name) for part in parts])
        assert torch.equal(getattr(whole.asked, name), drawn), name
    ahead = batches(pictures, config, networks, 7, WHOLE)
    assert torch.equal(next(ahead).asked.z, whole.asked.z)
    other = next(ahead).asked
    ahead.close()
    assert not torch.equal(other.z, whole.asked.z)
    assert torch.equal(other.z, draw_batch(pictures, config, networks, 8, WHOLE).asked.z)


@pytest.mark.parametrize(
    ("name", "value"), [(name, value) for name, choices in GEOMETRY_CHOICES.items() for value in choices]
)
def test_every_choice_of_table_2_trains(pictures: Pictures, name: str, value: str):
    geometry = GeometryConfig(**{name: value, **({"distance": "raw"} if value == "none" else {})})
    state, lines = run_steps(replace(CONFIG, geometry=geometry), pictures, 1)
    assert all(torch.isfinite(torch.tensor(list(line.values()))).all() for line in lines)
    assert (lines[0]["eikonal"] == 0) == (value == "density")
    start = fresh(replace(CONFIG, geometry=geometry), pictures)[0]
    assert (last_layer(state) - last_layer(start)).abs().max() > 0


def last_layer(state: State) -> Tensor:
    """What the residual is read with."""
    return networks_of(state).decoder.get_parameter("networks.0.geometry.weight")


def gradients_after_a_step(config: AdversarialConfig, pictures: Pictures) -> tuple[dict, dict]:
    """Gradients of both networks in the first step, R1 among them, and the numbers of the log."""
    state, run = fresh(config, pictures)
    if state.scaler.is_enabled():  # 65536 at first, which overflows; a few steps later
        state.scaler.load_state_dict(state.scaler.state_dict() | {"scale": 256.0})
    found = step_once(state, run, draw_batch(pictures, config, state.generator, 0, WHOLE), 0)
    numbers = {name: float(value) for name, value in found.items()}
    networks = {"generator": state.generator, "discriminator": state.discriminator}
    return {
        name: torch.cat([p.grad.flatten() for p in network.parameters() if p.grad is not None])
        for name, network in networks.items()
    }, numbers


@pytest.mark.parametrize("precision", ["bf16", "fp16"])
def test_half_precision_steps_almost_as_float32_does(pictures: Pictures, precision: Literal["bf16", "fp16"]):
    """The same code as on a GPU, by the CPU's autocast; fp16 with its scaler."""
    one, whole = gradients_after_a_step(CONFIG, pictures)
    config = replace(CONFIG, precision=precision)
    other, numbers = gradients_after_a_step(config, pictures)
    assert numbers.keys() == whole.keys()
    for name, value in whole.items():
        # 8 bits of mantissa, then a softmax six times as steep as its logits
        assert numbers[name] == pytest.approx(value, rel=0.05, abs=0.02), name
    for name, gradient in one.items():
        assert torch.isfinite(other[name]).all() and not torch.equal(other[name], gradient)
        assert float(F.cosine_similarity(gradient, other[name], dim=0)) > 0.995, name


def test_a_step_that_overflows_in_fp16_is_left_out_and_scaled_less(pictures: Pictures):
    state, run = fresh(replace(CONFIG, precision="fp16"), pictures)
    before = {name: value.clone() for name, value in state.generator.state_dict().items()}
    scale = state.scaler.get_scale()
    with torch.no_grad():
        state.discriminator.judge.bias.fill_(float("inf"))
    step_once(state, run, draw_batch(pictures, CONFIG, state.generator, 0, WHOLE), 1)
    assert all(torch.equal(before[name], value) for name, value in state.generator.state_dict().items())
    assert state.scaler.get_scale() == scale / 2
    assert state.parts()["scaler"].state_dict()["scale"] == scale / 2  # so a resumed run goes on with it
    state.scaler.load_state_dict(state.scaler.state_dict() | {"scale": 1.0})
    numbers = step_once(state, run, draw_batch(pictures, CONFIG, state.generator, 1, WHOLE), 2)
    with pytest.raises(TrainingError, match="gradient has norm"):
        look([numbers], state, CONFIG)


def test_gradients_that_explode_or_are_none_stop_the_run_and_keep_the_checkpoint(folder: Path):
    out = folder / "exploding"
    small_run(folder / "data", out, replace(CONFIG, images=4))
    kept = {name: (out / name).read_bytes() for name in ("state.pt", "generator.safetensors")}
    content = torch.load(out / "state.pt", weights_only=True)
    content["generator"]["networks.decoder.networks.0.geometry.weight"].fill_(float("nan"))
    torch.save(content, out / "state.pt")
    with pytest.raises(TrainingError, match="gradient has norm nan"):
        small_run(folder / "data", out, replace(CONFIG, images=8))
    assert (out / "generator.safetensors").read_bytes() == kept["generator.safetensors"]

    (out / "state.pt").write_bytes(kept["state.pt"])
    tight = replace(CONFIG, images=8, optimizer=replace(CONFIG.optimizer, largest_gradient=1e-9))
    with pytest.raises(InputError, match=r"training.optimizer.largest_gradient 10000.0, now 1e-09"):
        small_run(folder / "data", out, tight)
    with pytest.raises(TrainingError, match="lower the learning rates"):
        small_run(folder / "data", folder / "tight", tight)
    assert (out / "state.pt").read_bytes() == kept["state.pt"]


def test_a_folder_keeps_one_run(folder: Path):
    out = folder / "mine"
    small_run(folder / "data", out, replace(CONFIG, images=2))
    with pytest.raises(InputError, match=r"training\.seed 0, now 1;"):
        small_run(folder / "data", out, replace(CONFIG, seed=1))
    small_run(folder / "data", out, replace(CONFIG, images=4))  # longer is the same run
    shutil.copytree(folder / "data", folder / "moved")
    small_run(folder / "moved", out, replace(CONFIG, images=4))  # the same pictures elsewhere
    shutil.copyfile(folder / "data" / "images" / "1.png", folder / "moved" / "images" / "0.png")
    with pytest.raises(InputError, match=r"data\.contents has other contents"):
        small_run(folder / "moved", out, replace(CONFIG, images=4))
    (out / "state.pt").write_bytes(b"damaged")
    with pytest.raises(TrainingError, match="cannot be continued"):
        small_run(folder / "data", out, replace(CONFIG, images=4))


def test_weights_to_start_from_must_fit(folder: Path, pictures: Pictures):
    start = load_checkpoint(folder / "whole" / "generator.safetensors")
    state = new_state(CONFIG, avatar_model(CONFIG, BODY, start), 107, torch.device("cpu"))
    assert torch.equal(last_layer(state), start.generator.decoder.get_parameter("networks.0.geometry.weight"))
    larger = replace(CONFIG, render=replace(CONFIG.render, image_size=32))
    with pytest.raises(TrainingError, match="other networks"):
        avatar_model(larger, BODY, start)


def test_labels_and_weights_of_another_body_are_refused(folder: Path, pictures: Pictures):
    model, other = (
        avatar_model(CONFIG, BODY),
        replace(pictures, labels=replace(pictures.labels, body="0" * 64)),
    )
    with pytest.raises(TrainingError, match=r"labels in .* of another body"):
        train(CONFIG, model, other, BODY, folder / "other", accelerator(), [].append)
    own = replace(pictures, labels=replace(pictures.labels, body=body_hash(canonical_body(BODY))))
    short = replace(CONFIG, images=2)
    train(short, model, own, BODY, folder / "own", accelerator(), [].append)
    start = load_checkpoint(folder / "own" / "generator.safetensors")
    taller = replace(BODY, v_template=BODY.v_template * np.float32(1.1))
    with pytest.raises(TrainingError, match="weights to start from are of another body"):
        avatar_model(short, taller, start)
    assert not (folder / "other").exists()


def test_weights_that_never_rendered_take_this_runs_sharpness(folder: Path, pictures: Pictures):
    """What the warm start leaves is an initial value; what rendering has learned is kept."""
    small_run(folder / "data", folder / "rendered", replace(CONFIG, images=2))
    start = load_checkpoint(folder / "rendered" / "generator.safetensors")
    sharp = replace(CONFIG, render=replace(CONFIG.render, initial_alpha=0.004))
    learned = float(start.generator.density.alpha.detach())
    assert float(first_weights(start, sharp)["density.p"]) == pytest.approx(learned - 1e-4, rel=1e-5)
    with torch.no_grad():
        untrained = Density(start.generator.config.render.initial_alpha).p
        start.generator.density.p.copy_(untrained.half())  # as files keep it
    assert float(first_weights(start, sharp)["density.p"]) == pytest.approx(0.004 - 1e-4, rel=1e-5)
    assert start.generator.config.render.initial_alpha != 0.004


def test_the_average_halves_its_distance_in_a_half_life(pictures: Pictures):
    config = replace(CONFIG, optimizer=replace(CONFIG.optimizer, half_life=200))
    state, _ = fresh(config, pictures)
    with torch.no_grad():
        networks_of(state).density.p.fill_(1.0)
        networks_of(state, "average").density.p.fill_(0.0)
    state.images = 10**9  # far behind the ramp
    for _ in range(200 // config.batch):
        update_average(state, config)
    assert float(networks_of(state, "average").density.p) == pytest.approx(0.5, abs=1e-3)


def test_blur_keeps_flat_pictures_and_the_mean_and_spreads_a_dot():
    flat = torch.full((1, 3, 32, 32), 0.3)
    assert torch.allclose(blur(flat, 2.0), flat, atol=1e-6)
    dot = torch.zeros(1, 3, 33, 33)
    dot[:, :, 16, 16] = 1
    spread = blur(dot, 2.0)[0, 0]
    place = torch.arange(33.0) - 16
    assert float(spread.sum()) == pytest.approx(1, abs=1e-5)
    assert float((spread.sum(dim=0) * place**2).sum()) == pytest.approx(4.0, rel=0.03)  # variance is sigma^2
    assert torch.equal(blur(dot, 0.0), dot)


def test_mixed_styles_take_coarse_planes_from_one_and_fine_ones_from_the_other(pictures: Pictures):
    generator = networks_of(fresh(CONFIG, pictures)[0])
    w, other = torch.randn(2, 1, 32, generator=torch.Generator().manual_seed(0))
    mixed = [generator.synthesis(w, other, crossover) for crossover in (0, 1, 2, 3)]
    assert torch.equal(mixed[3], generator.synthesis(w))  # beyond the last block
    assert not torch.allclose(mixed[1], mixed[2]) and not torch.allclose(mixed[2], mixed[3])
    own, theirs = generator.synthesis(w), generator.synthesis(other)
    nearer = [(m - theirs).norm() / (m - own).norm().clamp_min(1e-6) for m in mixed]
    assert nearer[1] < nearer[2] < nearer[3]


def test_snapshots_fall_on_multiples_and_the_end():
    config = replace(CONFIG, batch=4, snapshot_every=10, images=26)
    assert [i for i in range(4, 29, 4) if snapshot_is_due(i, config)] == [12, 20, 28]


def test_the_command_shows_its_settings_and_names_what_is_wrong(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    arguments = ["train", "--preset", "cpu", "--data", str(tmp_path), "--out", str(tmp_path / "run")]
    assert main([*arguments, "--dry-run", "--training.geometry.prior", "observed"]) == 0
    shown = capsys.readouterr().out
    assert "prior='observed'" in shown and "raw_size=32" in shown and "samples=12" in shown
    assert main(arguments) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and "dataset.json" in error
    monkeypatch.setattr("torch.cuda.is_available", lambda: False)
    make_data(tmp_path / "data")
    small = ["train", "--preset", "debug", "--data", str(tmp_path / "data"), "--out", str(tmp_path / "run")]
    assert main([*small, "--training.precision", "fp16"]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and "fp16" in error and "bf16" in error
    assert main(["train", "--preset", "huge", "--data", "x", "--out", "y"]) == 2
    assert "debug, cpu, gpu, paper" in capsys.readouterr().err
    assert not (tmp_path / "run").exists()
