"""Snapshots are measured alike, the best of them is kept, and a run that was stopped keeps the same one."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import torch
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
from torch.nn.utils import parameters_to_vector

from avatargen.data.dataset import open_pictures
from avatargen.errors import InputError
from avatargen.metrics.evaluate import examine, set_exam
from avatargen.metrics.joints import RIDGE_POSE, ridge_judge
from avatargen.metrics.judges import BUILT_IN, Judges
from avatargen.metrics.shown import ShowConfig
from avatargen.metrics.watch import watch
from avatargen.training.adversarial import train
from avatargen.training.adversarial_config import AdversarialConfig
from avatargen.training.avatar_model import avatar_model
from avatargen.training.best_snapshot import DECIDES, Watch, snapshot_path, watch_snapshot
from avatargen.training.picture_model import Asked, Generated, PictureModel
from tests.small_run import BODY, CONFIG, SIZE, accelerator, make_data


class Nobody(PictureModel):
    """Shows nothing."""

    def generate(self, asked: Asked) -> Generated:
        raise NotImplementedError

    def settings(self) -> dict[str, Any]:
        return {}

    def save(self, path: Path, notes: dict[str, str]) -> None:
        raise NotImplementedError


def told(numbers: dict[str, float], pictures: int = 20) -> Watch:
    return Watch(pictures=pictures, measure=lambda model: numbers)


def shown(out: Path, images: int, numbers: dict[str, float], pictures: int = 20) -> dict:
    """Take a snapshot whose weights are its number; the record afterwards."""
    snapshot_path(out, images).parent.mkdir(exist_ok=True)
    snapshot_path(out, images).write_bytes(str(images).encode())
    assert watch_snapshot(told(numbers, pictures), Nobody(), images, out) == numbers
    record = json.loads((out / "best.json").read_bytes())
    assert (out / "best.safetensors").read_bytes() == str(record["best"]).encode()
    return record


def test_the_lowest_distance_is_the_best_and_the_earlier_of_equal_ones(tmp_path: Path):
    found = []
    for images, distance in ((4, 3.0), (8, 2.0), (12, 2.0), (16, 2.5), (20, 1.0)):
        found.append(shown(tmp_path, images, {DECIDES: distance, "warp": -distance})["best"])
    assert found == [4, 8, 8, 8, 20]
    record = json.loads((tmp_path / "best.json").read_bytes())
    assert record["snapshots"]["16"] == {DECIDES: 2.5, "warp": -2.5} and DECIDES in record["rule"]


def test_what_could_not_be_measured_is_never_the_best(tmp_path: Path):
    snapshot_path(tmp_path, 4).parent.mkdir()
    assert watch_snapshot(told({"warp": 1.0}), Nobody(), 4, tmp_path) == {"warp": 1.0}
    assert not (tmp_path / "best.json").exists()
    assert shown(tmp_path, 8, {DECIDES: 9.0})["best"] == 8
    assert shown(tmp_path, 12, {"warp": 0.0})["best"] == 8


def test_a_run_that_goes_on_from_earlier_forgets_what_came_after(tmp_path: Path):
    for images, distance in ((4, 3.0), (8, 1.0), (12, 2.0)):
        shown(tmp_path, images, {DECIDES: distance})
    record = shown(tmp_path, 8, {DECIDES: 2.5})  # as if stopped before the state of 8 was written
    assert record["best"] == 8 and list(record["snapshots"]) == ["4", "8"]
    record = shown(tmp_path, 12, {DECIDES: 2.0}, pictures=40)
    assert list(record["snapshots"]) == ["12"]  # others were measured with fewer pictures
    snapshot_path(tmp_path, 12).unlink()
    assert list(shown(tmp_path, 16, {DECIDES: 5.0}, pictures=40)["snapshots"]) == ["16"]


@pytest.mark.parametrize("damage", [b"{", b"[]", b'{"pictures": 20, "snapshots": {"4": 5}}'])
def test_a_damaged_record_is_named(tmp_path: Path, damage: bytes):
    (tmp_path / "best.json").write_bytes(damage)
    with pytest.raises(InputError, match=r"best\.json is damaged") as found:
        watch_snapshot(told({DECIDES: 1.0}), Nobody(), 4, tmp_path)
    assert "\n" not in str(found.value)


def run(folder: Path, name: str, config: AdversarialConfig, watched: Watch | None) -> Path:
    pictures, model = open_pictures(folder / "data", SIZE), avatar_model(config, BODY)
    train(config, model, pictures, BODY, folder / name, accelerator(), silent, watch=watched)
    return folder / name


def silent(line: str) -> None:
    pass


def test_measuring_changes_no_training_and_says_what_an_evaluation_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    torch.set_num_threads(1)
    pictures = make_data(tmp_path / "data")
    measured: list[dict[str, float]] = []
    own = watch(pictures, BODY, 20, CONFIG.render.raw_size)

    def measure(model: PictureModel) -> dict[str, float]:
        before = parameters_to_vector(model.parameters()).clone()
        measured.append(own.measure(model))
        assert torch.equal(before, parameters_to_vector(model.parameters()))
        assert own.measure(model) == measured[-1]  # always of the same people
        return measured[-1]

    config = replace(CONFIG, images=8)
    run(tmp_path, "watched", config, replace(own, measure=measure))
    run(tmp_path, "alone", config, None)
    a, b = (torch.load(tmp_path / name / "state.pt", weights_only=True) for name in ("watched", "alone"))
    assert all(torch.equal(x, b["generator"][name]) for name, x in a["generator"].items())
    assert all(torch.equal(x, b["discriminator"][name]) for name, x in a["discriminator"].items())
    assert not (tmp_path / "alone/best.json").exists()
    for name, count in (("watched", 2), ("alone", 0)):
        curves = EventAccumulator(str(tmp_path / name / "tensorboard")).Reload()
        drawn = [tag for tag in curves.Tags()["scalars"] if tag.startswith("snapshot/")]
        assert bool(drawn) == bool(count)
        for tag in drawn:
            values = [(event.step, event.value) for event in curves.Scalars(tag)]
            numbers = [found[tag.removeprefix("snapshot/")] for found in measured]
            assert values == [(4, pytest.approx(numbers[0])), (8, pytest.approx(numbers[1]))]

    record = json.loads((tmp_path / "watched/best.json").read_bytes())
    assert record["snapshots"] == {"4": measured[0], "8": measured[1]}
    assert BUILT_IN.frechet == DECIDES and {DECIDES, RIDGE_POSE} < set(measured[0])
    model = avatar_model(config, BODY)
    model.load_state_dict(a["average"])
    judges = Judges(features=(BUILT_IN,), joints=ridge_judge(pictures, BODY, 400))
    shown = ShowConfig(pictures=20, turned=10, reposed=0)
    exam = set_exam(pictures, pictures, BODY, judges, shown, CONFIG.render.raw_size)
    report = examine(model.eval().requires_grad_(False), exam)
    assert {name: number.value for name, number in report.numbers.items()} == pytest.approx(measured[1])


def test_a_run_stopped_before_its_state_is_written_keeps_the_same_best(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    torch.set_num_threads(1)
    make_data(tmp_path / "data")
    own = Watch(
        pictures=20, measure=lambda model: {DECIDES: float(parameters_to_vector(model.parameters()).sum())}
    )
    whole = run(tmp_path, "whole", CONFIG, own)
    broken = stopping(monkeypatch, at=2)
    with pytest.raises(KeyboardInterrupt):
        run(tmp_path, "stopped", CONFIG, own)
    assert set(json.loads((tmp_path / "stopped/best.json").read_bytes())["snapshots"]) == {"4", "8"}
    broken()
    again = run(tmp_path, "stopped", CONFIG, own)
    for name in ("best.json", "best.safetensors", "log.jsonl"):
        assert (again / name).read_bytes() == (whole / name).read_bytes()


def stopping(monkeypatch: pytest.MonkeyPatch, at: int) -> Callable[[], None]:
    """The run ends as it is about to write that state; the function returned lets it be."""
    from avatargen.training import adversarial

    save, count = adversarial.save_state, [0]

    def stop(*arguments) -> None:
        count[0] += 1
        if count[0] == at:
            raise KeyboardInterrupt
        save(*arguments)

    monkeypatch.setattr(adversarial, "save_state", stop)
    return lambda: monkeypatch.setattr(adversarial, "save_state", save)
