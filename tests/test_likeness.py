"""Likeness: what is known beforehand comes out."""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import torch

from avatargen.avatar import shipped
from avatargen.body.load import load_body
from avatargen.body.model import canonical_body
from avatargen.commands import main
from avatargen.errors import FieldError
from avatargen.metrics.judges import BUILT_IN
from avatargen.metrics.likeness import (
    FieldLikeness,
    before_grey,
    by_pattern,
    correlation,
    field_likeness,
    picture_likeness,
)
from avatargen.metrics.realism import realism, squared
from avatargen.training.pool import make_pool
from avatargen.wardrobe import MARKS
from avatargen.wardrobe.chart import Chart
from avatargen.wardrobe.procedural import ProceduralPerson, ProceduralWardrobe


@dataclass(frozen=True, kw_only=True, eq=False)
class OffPerson(ProceduralPerson):
    """The wardrobe's person, a millimetre larger and half as bright."""

    def sdf(self, points: torch.Tensor) -> torch.Tensor:
        return super().sdf(points) - 0.001

    def color(self, points: torch.Tensor) -> torch.Tensor:
        return 0.5 * super().color(points)


@pytest.fixture(scope="module")
def wardrobe() -> ProceduralWardrobe:
    body = canonical_body(load_body(shipped("body.npz")))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("avatargen.wardrobe.procedural.Chart", lambda body, marks: Chart(body, MARKS, 0.03))
        return ProceduralWardrobe(body)


def test_a_person_is_like_itself_and_an_error_is_told_as_it_is(wardrobe: ProceduralWardrobe):
    points = make_pool(wardrobe.body, 12_000, 5).p
    bare = (s for s in range(200) if dict(wardrobe.sample(s).info.facts)["outer"] == "none")
    truth = next(p for p in map(wardrobe.sample, bare) if dict(p.info.facts)["pattern"] == "blocks")
    same = field_likeness(truth, truth, points)
    off = field_likeness(OffPerson(**vars(truth)), truth, points)
    light = float(truth.color(points[truth.sdf(points).abs() < 0.004]).mean())

    assert (same.sdf_mm, same.colour_l1, same.pattern) == (0, 0, "blocks")
    assert same.correlation == pytest.approx(1, abs=1e-5)
    assert off.sdf_mm == pytest.approx(1, abs=1e-3)
    assert off.colour_l1 == pytest.approx(0.5 * light, rel=1e-4)
    assert off.correlation == pytest.approx(1, abs=1e-5)  # of brightness that is half as strong
    with pytest.raises(FieldError, match="near the surface"):
        field_likeness(truth, truth, torch.full((4, 3), 5.0))


def test_pictures_are_compared_where_either_shows_the_person():
    picture = np.zeros((64, 48, 4), np.uint8)
    picture[16:48, 12:36] = (102, 102, 102, 255)
    lighter = picture.copy()
    lighter[16:48, 12:36, :3] = 153
    wider = picture.copy()
    wider[16:48, 36:40] = (255, 255, 255, 255)
    same, off = picture_likeness("front", picture, picture), picture_likeness("front", lighter, picture)
    error = (255 / 255 - 0.5) ** 2 * 4 / 28  # of the columns that only one of them has

    assert (same.psnr_db, same.ssim) == (100, pytest.approx(1))
    assert off.psnr_db == pytest.approx(-10 * np.log10(0.2**2), abs=1e-6)
    assert off.ssim < 0.99
    assert picture_likeness("front", wider, picture).psnr_db == pytest.approx(-10 * np.log10(error), abs=1e-6)
    with pytest.raises(FieldError, match="nobody"):
        picture_likeness("front", picture * 0, picture * 0)


def test_as_sets_the_same_people_are_as_far_off_as_their_own_and_others_farther():
    rng = np.random.default_rng(3)

    def picture(light: float) -> np.ndarray:
        found = np.zeros((60, 40, 4), np.uint8)
        found[8:52, 10:30] = 255 * light * rng.uniform(0.8, 1, (44, 20, 1))
        found[8:52, 10:30, 3] = 255
        return found

    truth = [picture(light) for light in rng.uniform(0.3, 0.6, 12)]
    squares = squared(truth[0])
    assert squares.shape == (3, 224, 224) and float(squares[:, 0, 0].mean()) == pytest.approx(0.5)
    wanted = before_grey(truth[0]).mean(axis=(0, 1)) * 2 / 3 + 0.5 / 3  # a third of the square is beside it
    assert np.abs(squares.mean(dim=(1, 2)).numpy() - wanted).max() < 1e-3
    for numbers in realism(BUILT_IN, truth, truth).values():
        assert numbers["learned"] == numbers["wardrobe"] is not None
    bright = [picture(light) for light in rng.uniform(0.8, 1.0, 12)]
    for numbers in realism(BUILT_IN, bright, truth).values():
        made, own = numbers["learned"], numbers["wardrobe"]
        assert made is not None and own is not None and made.low > own.high


def test_patterns_are_averaged_where_they_are_seen():
    def person(pattern: str, found: float | None) -> FieldLikeness:
        return FieldLikeness(seed=0, sdf_mm=0.1, colour_l1=0.1, pattern=pattern, correlation=found)

    people = [person("checks", 0.5), person("checks", 1.0), person("checks", None), person("plain", None)]
    assert by_pattern(people) == {"checks": {"people": 2, "correlation": 0.75}}
    flat = torch.full((50,), 0.3)
    varied = torch.linspace(0, 1, 50)
    assert correlation(varied, flat) is None and correlation(flat, varied) == 0
    assert correlation(1 - varied, varied) == pytest.approx(-1)


def test_the_command_writes_what_it_measured(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], wardrobe: ProceduralWardrobe, monkeypatch
):
    monkeypatch.setattr("avatargen.wardrobe.procedural.ProceduralWardrobe", lambda body: wardrobe)
    out = tmp_path / "likeness.json"
    words = ["eval", "likeness", "--out", str(out), "--people", "2", "--points", "2000", "--height", "0"]
    assert main.main(words) == 0
    found = json.loads(out.read_text())
    assert {"sdf_mm", "colour_l1", "picture_psnr_db", "picture_ssim", "patterns"} <= set(found)
    assert found["realism"] == {}  # of two people
    assert 0.1 < found["sdf_mm"] < 2 and found["people"] == 2 and len(found["each"]) == 2
    assert str(out) in capsys.readouterr().out
    assert main.main(["eval", "likeness", "--out", str(tmp_path / "x.txt")]) == 2
    assert "ends in .json" in capsys.readouterr().err
