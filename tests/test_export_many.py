"""Many seeds: a crash or a bad seed costs that seed alone, and the same command finishes the rest."""

import hashlib
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pygltflib
import pytest
from PIL import Image

import avatargen
from assets.picture.sheet import WORD
from avatargen.commands import progress
from avatargen.commands.export import avatar_export
from avatargen.commands.export.options import parse
from avatargen.errors import AvatarGenError, InputError
from avatargen.export import many as export_many
from avatargen.export.manifest import NAME, Row, open_manifest
from avatargen.export.many import Worker, bury
from avatargen.export.seed import SeedExporter
from tests.test_avatar_export import Model, command, in_an_empty_folder, model, outside

__all__ = ["in_an_empty_folder", "model"]  # fixtures
SETTINGS: dict[str, object] = {"faces": 2000}


def rows(folder: Path) -> list[dict]:
    return [json.loads(line) for line in (folder / NAME).read_text().splitlines()]


def children(pid: int) -> list[int]:
    try:
        return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
    except OSError:
        return []


def is_worker(pid: int) -> bool:
    try:
        return b"spawn_main" in Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return False


def wait_for(condition, seconds: float = 120.0):
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        found = condition()
        if found:
            return found
        time.sleep(0.02)
    raise AssertionError("it did not happen in time")


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="workers are found in /proc")
def test_a_killed_worker_and_a_bad_seed_cost_one_seed_each(model: Model) -> None:
    folder = Path("crowd")
    (folder / "avatar_5.glb").mkdir(parents=True)  # seed 5 has nowhere to be written
    words = ["--seeds", "0:6", "--jobs", "2", "--out", "crowd", *model.options]
    with subprocess.Popen(command(*words), env=outside(), stdout=-1, stderr=-1, text=True) as run:
        wait_for(lambda: (folder / NAME).exists() and len(rows(folder)) >= 1)
        victim = wait_for(lambda: [child for child in children(run.pid) if is_worker(child)])[0]
        os.kill(victim, signal.SIGKILL)
        out, err = run.communicate()
    found = {row["seed"]: row for row in rows(folder)}
    failed = {seed: row["error"] for seed, row in found.items() if row["error"] is not None}

    assert (run.returncode, out) == (2, "")
    assert set(found) == set(range(6))
    assert "cannot write crowd/avatar_5.glb" in failed.pop(5)
    assert list(failed.values()) == ["its worker died (killed by signal 9)"]
    assert err.splitlines()[-1].startswith("avatar-export: 2 of 6 seeds failed (")
    for seed, row in found.items():
        if row["error"] is None:
            check_row(folder, seed, row)

    (folder / "avatar_5.glb").rmdir()
    before = {path.name: path.stat().st_mtime_ns for path in folder.glob("*.glb")}
    again = subprocess.run(command(*words), env=outside(), capture_output=True, text=True)
    assert (again.returncode, again.stdout) == (0, "crowd/manifest.jsonl\n"), again.stderr
    assert "crowd: 6 avatars, 2 of them made now" in again.stderr
    last = {row["seed"]: row for row in rows(folder)}
    for seed in range(6):
        check_row(folder, seed, last[seed])
    assert {name: (folder / name).stat().st_mtime_ns for name in before} == before
    assert sorted(path.suffix for path in folder.iterdir()) == [".glb"] * 6 + [".json", ".jsonl"]

    batch = avatargen.export_many(parse(words))  # what the command calls: all are there
    assert (batch.made, batch.failed, batch.manifest) == (0, (), folder / NAME)
    assert [row.seed for row in batch.rows] == list(range(6))

    one = [*model.options, "--seed", "4", "--out", "one.glb"]
    assert avatar_export.main(one) == 0
    assert Path("one.glb").read_bytes() == (folder / "avatar_4.glb").read_bytes()


def check_row(folder: Path, seed: int, row: dict) -> None:
    """The file is whole, the seed's own, and what its row says."""
    data = (folder / row["file"]).read_bytes()
    document: Any = pygltflib.GLTF2.load_from_bytes(data)
    assert document.asset.extras["seed"] == seed
    assert hashlib.sha256(data).hexdigest() == row["sha256"]
    assert row["bytes"] == len(data)
    assert abs(row["faces"] - 2000) <= 40
    assert 0 < row["error_mm"]["mean"] <= row["error_mm"]["p99"] <= row["error_mm"]["max"]
    assert row["seconds"] > 0


def size_of(path: str | Path) -> tuple[int, int]:
    """Pixels of a picture."""
    with Image.open(path) as picture:
        return picture.size


@pytest.fixture
def without_processes(monkeypatch: pytest.MonkeyPatch) -> None:
    """The work of the workers is done here, in the order of the seeds."""

    def outcomes(request: avatargen.ExportRequest, todo: list[int]) -> Iterator[Row]:
        return map(SeedExporter(request).export, todo)

    monkeypatch.setattr(export_many, "outcomes", outcomes)


@pytest.mark.usefixtures("without_processes")
def test_a_sheet_shows_everybody_whoever_was_made_when(
    model: Model, capsys: pytest.CaptureFixture[str]
) -> None:
    """One more, one whose picture is gone, one without a picture and none at all: always the sheet that one
    run makes."""
    words = ["--out", "crowd", *model.options]
    made = (
        (["--seeds", "3"], [], []),  # without a sheet
        (["--seeds", "3,5", "--sheet", "crowd/sheet.png"], [], [3, 5]),
        (["--seeds", "3,5,8", "--sheet", "crowd/sheet.png"], [], [8]),
        (["--seeds", "3,5,8", "--sheet", "other.png"], ["pictures/avatar_5.png", "avatar_8.glb"], [5, 8]),
        (["--seeds", "3,5,8", "--sheet", "again.png"], [], []),
    )
    for options, gone, seeds in made:
        for name in gone:
            (Path("crowd") / name).unlink()
        before = len(rows(Path("crowd"))) if Path("crowd").exists() else 0
        assert avatar_export.main([*options, *words]) == 0, capsys.readouterr().err
        if "--sheet" in options:
            assert [row["seed"] for row in rows(Path("crowd"))[before:]] == seeds
            assert f"all of them in {options[3]}" in capsys.readouterr().err
    whole = Path("crowd/sheet.png").read_bytes()
    assert whole == Path("other.png").read_bytes() == Path("again.png").read_bytes()
    pictures = [Image.open(f"crowd/pictures/avatar_{seed}.png") for seed in (3, 5, 8)]
    sheet = np.asarray(Image.open("again.png"))
    assert sheet.shape == (256 + WORD, 3 * max(picture.width for picture in pictures), 3)
    cells = np.split(sheet[:256], 3, axis=1)
    for picture, cell in zip(pictures, cells, strict=True):
        left = (cell.shape[1] - picture.width) // 2
        assert (cell[:, left : left + picture.width] == np.asarray(picture)).all()

    Path("crowd/pictures/avatar_5.png").write_bytes(b"damaged")
    for words_more, line in (
        (["--seeds", "5,8", "--sheet", "no.png"], "crowd/pictures/avatar_5.png is no picture of ours"),
        (
            ["--seeds", "3,8", "--sheet", "crowd/pictures/avatar_3.png"],
            "it is of seed 3; give another --sheet",
        ),
    ):
        assert avatar_export.main([*words_more, *words]) == 2
        out, err = capsys.readouterr()
        assert (out, err.count("\n")) == ("", 1)
        assert line in err
    assert not Path("no.png").exists()
    assert pictures[0].tobytes() == Image.open("crowd/pictures/avatar_3.png").tobytes()


@pytest.mark.usefixtures("without_processes")
def test_a_failed_seed_is_left_out_of_the_sheet_and_a_pipe_hears_how_far_it_is(
    model: Model, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (Path("crowd") / "avatar_5.glb").mkdir(parents=True)
    monkeypatch.setattr(progress, "EVERY", 0.0)
    words = ["--seeds", "3,5,8", "--out", "crowd", "--sheet", "sheet.jpg", *model.options]
    assert avatar_export.main(words) == 2
    told = capsys.readouterr().err.splitlines()
    assert [line.split(" in ")[0] for line in told if " left" in line] == ["1 of 3", "2 of 3"]
    assert told[-1].startswith("avatar-export: 1 of 3 seeds failed (5)")
    assert sorted(os.listdir("crowd/pictures")) == ["avatar_3.png", "avatar_8.png"]
    width = max(size_of(path)[0] for path in Path("crowd/pictures").iterdir())
    assert size_of("sheet.jpg") == (2 * width, 256 + WORD)
    (Path("crowd") / "avatar_5.glb").rmdir()
    assert avatar_export.main([*words, "--quiet"]) == 0
    assert capsys.readouterr() == ("crowd/manifest.jsonl\n", "")
    assert size_of("sheet.jpg")[0] >= 3 * width


def test_the_package_s_own_command_starts_workers(model: Model) -> None:
    words = ["-m", "avatargen", "export", "--seeds", "3,5", "--jobs", "2", *model.options]
    words += ["--out", "crowd", "--sheet", "crowd/sheet.png"]
    run = subprocess.run([sys.executable, *words], env=outside(), capture_output=True, text=True)
    assert (run.returncode, run.stdout) == (0, "crowd/manifest.jsonl\n"), run.stderr
    assert sorted(row["seed"] for row in rows(Path("crowd"))) == [3, 5]
    assert size_of("crowd/sheet.png")[1] == 256 + WORD


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (["--seeds", "0:4"], "found --seeds, which wants --out FOLDER"),
        (["--seeds", "0:4", "--out", "a", "--report", "r.json"], "takes neither --report nor --preview"),
        (["--seeds", "4:4", "--out", "a"], "--seeds: found '4:4', wanted A:B with A < B"),
        (["--seeds", "0:99999999999", "--out", "a"], "at most 1000000 seeds"),
        (["--seeds", "-1:4", "--out", "a"], "--seeds"),
        (
            ["--seeds", "0:4", "--seed", "3", "--out", "a"],
            "required: --seed, --seeds, --text, --photo or --person, one of them",
        ),
        (["--seed", "3", "--jobs", "2"], "found --jobs with one seed"),
        (["--seeds", "0:4", "--out", "file"], "cannot write file/manifest.jsonl"),
        (["--seeds", "0:4", "--out", "a", "--weights", "none"], "found no file none"),
    ],
)
def test_bad_options_are_one_line(words: list[str], line: str, capsys: pytest.CaptureFixture[str]) -> None:
    Path("file").write_bytes(b"mine")
    assert avatar_export.main(words) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert line in err
    assert os.listdir() == ["file"]


def test_bad_weights_are_told_once_and_no_seed_is_tried(
    model: Model, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("noise").write_bytes(b"noise" * 100)
    words = ["--seeds", "0:4", "--out", "a", *model.options, "--weights", "noise"]
    assert avatar_export.main(words) == 2
    assert "noise is no whole safetensors file" in capsys.readouterr().err
    assert rows(Path("a")) == []


def row(seed: int, **values: object) -> Row:
    return Row(seed=seed, **values)  # pyright: ignore[reportArgumentType]


def add(folder: Path, *added: Row) -> None:
    with open_manifest(folder, SETTINGS) as manifest:
        for each in added:
            manifest.add(each)


def test_manifest_keeps_rows_and_cuts_off_half_a_line(tmp_path: Path) -> None:
    folder = tmp_path / "new" / "crowd"
    add(folder, row(0, error="bad"), row(1, file="a.glb", sha256="0" * 64), row(0, file="b.glb"))
    whole = (folder / NAME).read_bytes()
    for cut in range(1, 40):
        (folder / NAME).write_bytes(whole + whole[:cut])
        with open_manifest(folder, SETTINGS) as manifest:
            assert (folder / NAME).read_bytes() == whole
            assert manifest.rows[0] == row(0, file="b.glb")
            assert set(manifest.rows) == {0, 1}


def test_only_files_that_are_there_as_written_are_done(tmp_path: Path) -> None:
    sound = hashlib.sha256(b"sound").hexdigest()
    (tmp_path / "a.glb").write_bytes(b"sound")
    (tmp_path / "b.glb").write_bytes(b"torn")
    names = [("a.glb", None), ("b.glb", None), ("none.glb", None), ("a.glb", "failed"), (None, None)]
    add(tmp_path, *(row(i, file=n, sha256=sound, error=e) for i, (n, e) in enumerate(names)))
    with open_manifest(tmp_path, SETTINGS) as manifest:
        assert [manifest.holds(seed) for seed in range(6)] == [True, False, False, False, False, False]


@pytest.mark.parametrize(
    "line", ["x", "[]", "{}", '{"seed": 1}', "[" * 100_000, json.dumps(asdict(Row(seed=1)) | {"file": 3})]
)
def test_a_damaged_manifest_is_refused_and_kept(tmp_path: Path, line: str) -> None:
    (tmp_path / NAME).write_text(line + "\n")
    with pytest.raises(InputError, match="line 1 is no row"), open_manifest(tmp_path, SETTINGS):
        pass
    assert (tmp_path / NAME).read_text() == line + "\n"


def test_other_settings_and_two_runs_at_once_are_refused(tmp_path: Path) -> None:
    add(tmp_path, row(0))
    with pytest.raises(InputError, match="other settings"), open_manifest(tmp_path, {"faces": 8}):
        pass
    with (
        open_manifest(tmp_path, SETTINGS),
        pytest.raises(InputError, match="by another process"),
        open_manifest(tmp_path, SETTINGS),
    ):
        pass


def test_workers_that_cannot_start_end_the_run() -> None:
    process = export_many.SPAWN.Process(target=os._exit, args=(3,))
    process.start()
    here, there = export_many.SPAWN.Pipe()
    there.close()
    with pytest.raises(AvatarGenError, match=r"before its first seed \(status 3\)"):
        bury(Worker(process, here))
