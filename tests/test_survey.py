"""The survey: one honest row a seed, and sheets of pictures."""

import json
from pathlib import Path

from PIL import Image

from assets import BuildConfig, build
from assets.errors import GeometryError
from avatargen.commands.look.survey import Row, main, summary


def row(seed: int, closed: bool, mean_mm: float) -> Row:
    return Row(
        seed=seed,
        faces=20,
        closed=closed,
        mean_mm=mean_mm,
        p99_mm=1.0,
        max_mm=2.0 * seed,
        bytes=9,
        seconds=1.0,
    )


def test_summary_counts_and_takes_the_worst() -> None:
    found = summary([row(1, True, 0.1), row(2, False, 0.3)])

    assert (found["seeds"], found["closed"]) == (2, 1)
    assert found["mean_mm"] == 0.2
    assert found["worst_mean_mm"] == 0.3
    assert found["worst_max_mm"] == 4.0


def test_survey_of_the_shipped_weights(tmp_path: Path) -> None:
    assert main(["--out", str(tmp_path), "--first", "5", "--count", "1", "--height", "64"]) == 0
    found = json.loads((tmp_path / "survey.json").read_text())

    assert found["closed"] == found["seeds"] == 1
    assert abs(found["rows"][0]["faces"] - 20000) <= 400
    assert found["rows"][0]["bytes"] == (tmp_path / "avatar_5.glb").stat().st_size
    for name in ("sheet.png", "faces.png"):
        assert Image.open(tmp_path / name).height == 64


def test_a_seed_that_cannot_be_built_is_named_and_the_others_are_kept(tmp_path: Path, monkeypatch, capsys):
    def sometimes(avatar):
        if avatar.seed == 5:
            raise GeometryError("extract: nothing is there")
        return build(avatar, BuildConfig(resolution=96, faces=1000, texture=64))

    monkeypatch.setattr("assets.build", sometimes)
    assert main(["--out", str(tmp_path), "--first", "5", "--count", "2", "--height", "64"]) == 2
    printed = capsys.readouterr()
    assert "seed 5: extract: nothing is there" in printed.out and "seeds [5] of 2" in printed.err
    assert [row["seed"] for row in json.loads((tmp_path / "survey.json").read_text())["rows"]] == [6]
