"""Numbers of a configuration that no run can use are refused where they are given, in one line."""

import os
import signal
from dataclasses import dataclass, fields, replace
from pathlib import Path

import pytest

from avatargen.commands import main
from avatargen.commands.bench.run import Grid
from avatargen.errors import InputError
from avatargen.metrics.shown import ShowConfig
from avatargen.ranges import require_ranges
from avatargen.training.adversarial_config import LossConfig, OptimizerConfig, VarietyConfig
from avatargen.training.warm_start import RANGES, WarmStartConfig


@pytest.fixture(autouse=True)
def in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    handler = signal.getsignal(signal.SIGTERM)
    yield
    signal.signal(signal.SIGTERM, handler)


@dataclass(frozen=True)
class Sizes:
    one: float | None = 1
    many: tuple[int, ...] = (1, 2)


def test_every_number_lies_in_its_range() -> None:
    ranges = {"one": (0, 1), "many": (1, 2)}
    for good in (Sizes(), Sizes(one=None), Sizes(one=0), Sizes(many=())):
        require_ranges(good, "sizes", ranges)
    for bad, told in (
        (Sizes(one=-1), "sizes: found one -1, wanted 0 to 1"),
        (Sizes(one=float("nan")), "found one nan"),
        (Sizes(many=(1, 3, 4)), "found many 3, wanted 1 to 2"),
    ):
        with pytest.raises(InputError, match=told):
            require_ranges(bad, "sizes", ranges)


@pytest.mark.parametrize("config", [WarmStartConfig(), LossConfig(), OptimizerConfig(), VarietyConfig()])
def test_no_setting_of_a_training_is_forgotten(config: object) -> None:
    """Whatever number is put far below 0 or at NaN, it is refused."""
    for each in fields(config):  # pyright: ignore[reportArgumentType]
        for bad in (-(10**30),) if isinstance(each.default, int) else (-1e30, float("nan")):
            with pytest.raises(InputError, match=f"found {each.name} "):
                replace(config, **{each.name: bad})  # pyright: ignore[reportArgumentType, reportCallIssue]
    assert set(RANGES) == {each.name for each in fields(WarmStartConfig)}


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("train warm-start --out run --training.searched 64", "found searched 64, wanted 480 or more"),
        ("train warm-start --out run --training.points 0", "found points 0, wanted 1 to 1000000"),
        ("train warm-start --out run --training.people -3", "found people -3"),
        ("train warm-start --out run --training.learning-rate nan", "found learning_rate nan"),
        (
            "train --preset debug --data none --out run --training.batch 3",
            "batch 3 is no whole number of groups",
        ),
        ("train --preset debug --data none --out run --training.losses.points 1", "found points 1, wanted 2"),
        (
            "train --preset debug --data none --out run --training.render.samples 1",
            "found samples 1, wanted 2",
        ),
        ("eval --weights w --data d --out f.json --measure.pictures 3", "3 pictures say nothing"),
        ("eval --weights w --data d --out f.json --samples 1", "found samples 1, wanted 2"),
        ("eval rays --data d --out run --pictures 0", "found pictures 0, wanted 1"),
        ("eval ablations --data d --held-out h --out run --images 0", "found images 0, wanted 1"),
        ("bench --out run --grid.resolutions 4", "found resolutions 4, wanted 32 to 2048"),
        ("bench --out run --seeds -1", "found seeds -1"),
        ("survey --out run --count 0", "found count 0, wanted 1"),
        ("train warm-start --out run --trainig.points 3", "Unrecognized options: --trainig.points"),
        ("train warm-start --out run --training.points many", "many"),
        ("survey --count 3", "--out"),
    ],
)
def test_sizes_out_of_range_are_one_line_and_no_file(
    line: str, told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main.main(line.split()) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n"), os.listdir()) == ("", 1, [])
    assert err.startswith("avatargen ")
    assert told in err


def test_a_measure_of_few_pictures_says_nothing() -> None:
    with pytest.raises(InputError, match="say nothing"):
        ShowConfig(pictures=19)
    with pytest.raises(InputError, match="found neighbours 5"):
        Grid(neighbours=(1, 5))
