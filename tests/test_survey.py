"""The survey: one honest row a seed, and sheets of pictures."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

from assets import BuildConfig, build
from assets.asset.asset import apart
from assets.errors import GeometryError
from assets.poke import poke_through
from assets.separate import build_parts
from avatargen.commands.bench.poses import rotations
from avatargen.commands.look.survey import Row, main, summary
from avatargen.commands.look.survey_parts import POSES, PartsRow, in_parts, summary_in_parts
from avatargen.errors import InputError
from tests.layered import Layer, person


def row(seed: int, closed: bool, mean_mm: float) -> Row:
    return Row(
        seed=seed,
        faces=20,
        closed=closed,
        handles=0 if closed else 2,
        mean_mm=mean_mm,
        p99_mm=1.0,
        max_mm=2.0 * seed,
        bytes=9,
        seconds=1.0,
    )


def test_summary_counts_and_takes_the_worst() -> None:
    found = summary([row(1, True, 0.1), row(2, False, 0.3)])

    assert (found["seeds"], found["closed"], found["without_handles"]) == (2, 1, 1)
    assert found["mean_mm"] == 0.2
    assert found["worst_mean_mm"] == 0.3
    assert found["worst_max_mm"] == 4.0


def test_survey_of_the_shipped_weights(tmp_path: Path) -> None:
    assert main(["--out", str(tmp_path), "--first", "5", "--count", "1", "--height", "64"]) == 0
    found = json.loads((tmp_path / "survey.json").read_text())

    assert found["closed"] == found["seeds"] == 1 == len(found["rows"])
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


def parts_row(seed: int, through: float, *broken: str) -> PartsRow:
    return PartsRow(
        seed=seed,
        faces={"body": 9, "top": 7},
        open=broken,
        mean_mm=0.1,
        p99_mm=0.4,
        through={pose: {"body": through if pose == "sit" else 0.0} for pose in POSES},
        bytes=9,
        seconds=1.0,
    )


def test_parts_are_counted_and_poses_told_apart() -> None:
    found: Any = summary_in_parts([parts_row(1, 0.5), parts_row(2, 3.0, "top")])

    assert (found["seeds"], found["parts"], found["closed"]) == (2, 4, 3)
    assert found["through"]["sit"] == {"parts": 2, "over_1_mm": 1, "worst_p99_mm": 3.0}
    assert found["through"]["a"] == {"parts": 2, "over_1_mm": 0, "worst_p99_mm": 0.0}
    assert "all closed" in str(parts_row(1, 0.5)) and "open: top" in str(parts_row(2, 3.0, "top"))
    assert "sit 3.0" in str(parts_row(2, 3.0))


def small(avatar: Any) -> Any:
    return build_parts(avatar, BuildConfig(resolution=96, faces=2400, texture=64), "keep")


def test_a_person_in_parts_comes_out_closed_and_a_torn_part_is_named(monkeypatch) -> None:
    monkeypatch.setattr("assets.separate.build_parts", small)
    asset, data, row = in_parts(person())
    assert set(row.faces) == {"body", "shoes", "top"} and row.open == () and row.bytes == len(data)
    assert sum(row.faces.values()) == len(asset.faces)
    assert list(row.through) == list(POSES) and all(set(found) == {"body"} for found in row.through.values())
    covers = {name: layer.cover for name, layer in person().layers.items()}
    resting = poke_through(asset, covers, rotations("a", asset.skeleton.joint_names))
    assert row.through["a"]["body"] == resting["body"].p99_mm > 1 > row.through["sit"]["body"]

    def torn(avatar: Any) -> Any:
        made = small(avatar)
        top = dict(apart(made))["top"]
        last = made.parts[-1]
        assert last.name == "top" and len(top.faces) == last.faces[1] - last.faces[0]
        faces = made.faces.copy()
        faces[-1] = faces[-2]  # the last but one lies twice, and where the last one was there is a hole
        return replace(made, faces=faces)

    monkeypatch.setattr("assets.separate.build_parts", torn)
    assert in_parts(person())[2].open == ("top",)


def test_who_is_one_field_has_no_parts() -> None:
    who = person()
    with pytest.raises(InputError, match="leave --parts separate out"):
        in_parts(Layer("body", who.body, who.betas, who.info))
