"""Runs compared snapshot by snapshot: every kept one is measured once, and the best are marked."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
from PIL import Image

from avatargen.commands.learn import evaluate_runs
from avatargen.commands.learn.evaluate_runs import Row, snapshots, table
from avatargen.errors import InputError
from avatargen.metrics.evaluate import examine
from tests.small_run import BODY, CONFIG, make_data, small_run


def row(run: str, images: int, distance: float, warp: float | None) -> Row:
    numbers = {"frechet distance": distance} | ({} if warp is None else {"warp": warp})
    return Row(
        run=run,
        images=images,
        weights_hash="",
        measure={},
        numbers={name: {"value": v, "low": v / 2, "high": v * 2} for name, v in numbers.items()},
        floors={"frechet distance": {"value": 0.001}},
    )


def test_a_table_marks_the_best_of_each_run():
    rows = [row("a", 0, 0.5, None), row("a", 1000, 0.125, 0.03), row("b", 0, 0.25, 0.02)]
    lines = table(rows).splitlines()
    assert lines[0] == "| run | pictures shown | frechet distance | warp |"
    assert lines[2] == "| real pictures against others | | 0.001 |  |"
    assert lines[3] == "| a | 0 | 0.5 (0.25 to 1) | - |"
    assert lines[4] == "| a | 1,000 | **0.125** (0.0625 to 0.25) | **0.03** (0.015 to 0.06) |"
    assert lines[5].count("**") == 4
    assert evaluate_runs.plot(rows).startswith(b"\x89PNG")


def test_runs_are_measured_once_and_a_damaged_table_is_refused(tmp_path: Path, monkeypatch):
    make_data(tmp_path / "data")
    small_run(tmp_path / "data", tmp_path / "run", replace(CONFIG, images=4))
    kept = snapshots(tmp_path / "run", 1)
    assert [int(path.stem) for path in kept] == [0, 4]
    assert kept[-1].read_bytes() == (tmp_path / "run" / "generator.safetensors").read_bytes()
    monkeypatch.setattr("avatargen.avatar.training_body", lambda path: BODY)
    calls = []
    monkeypatch.setattr("avatargen.metrics.evaluate.examine", lambda *rest: calls.append(1) or examine(*rest))
    words = ["--runs", str(tmp_path / "run"), "--out", str(tmp_path / "out")]
    words += ["--data", str(tmp_path / "data"), "--reference", str(tmp_path / "data")]
    assert evaluate_runs.main(words) == 0
    first = (tmp_path / "out" / "runs.json").read_bytes()
    assert [row["images"] for row in json.loads(first)] == [0, 4] and len(calls) == 2
    assert evaluate_runs.main(words) == 0
    assert (tmp_path / "out" / "runs.json").read_bytes() == first and len(calls) == 2
    held_out = tmp_path / "data" / "images" / "0.png"
    Image.open(tmp_path / "data" / "images" / "1.png").save(held_out)
    assert evaluate_runs.main(words) == 0
    assert len(calls) == 4  # other held-out pictures, other numbers
    (tmp_path / "out" / "runs.json").write_text('[{"run": 1}]')
    assert evaluate_runs.main(words) == 2


def test_folders_without_snapshots_are_refused(tmp_path: Path):
    with pytest.raises(InputError, match="train one first"):
        snapshots(tmp_path, 1)
    with pytest.raises(InputError, match="--every 0"):
        snapshots(tmp_path, 0)
