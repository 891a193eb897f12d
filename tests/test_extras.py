"""Commands that need an extra say so in one line, before any work; the list of extras is pyproject's own."""

import os
import re
import signal
import tomllib
from pathlib import Path

import pytest

from avatargen.commands import main
from avatargen.commands.export import avatar_export
from avatargen.extras import EXTRA_OF

PROJECT = Path(__file__).parents[1]
COMMANDS = {
    "train --preset debug --data none --out new": "accelerate",
    "eval ablations --data none --held-out none --out new": "accelerate",
    "bench --out new": "matplotlib",
    "view": "viser",
    "render 3 --clip walk --out new.mp4": "av",
    "render 3 --turntable new.mp4": "av",
}


@pytest.fixture(autouse=True)
def in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    handler = signal.getsignal(signal.SIGTERM)
    yield
    signal.signal(signal.SIGTERM, handler)


def without(monkeypatch: pytest.MonkeyPatch, library: str) -> None:
    """Nothing of this name is installed any more."""
    monkeypatch.setattr("avatargen.extras.find_spec", lambda name: None if name == library else name)


@pytest.mark.parametrize("line", COMMANDS)
def test_a_missing_extra_is_one_line_before_any_work(
    line: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    library = COMMANDS[line]
    without(monkeypatch, library)
    assert main.main(line.split()) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n"), os.listdir()) == ("", 1, [])
    assert f"found no {library}, which this needs; " in err
    assert f"pip install 'avatargen[{EXTRA_OF[library]}]'" in err


def test_a_cluster_without_ray_is_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    without(monkeypatch, "ray")
    assert avatar_export.main(["--seeds", "0:2", "--ray", "auto", "--out", "new"]) == 2
    assert "found no ray, which this needs; install it with pip install 'avatargen[ray]'" in (
        capsys.readouterr().err
    )
    assert os.listdir() == []


def test_every_library_is_in_the_extra_that_is_named() -> None:
    extras = tomllib.loads((PROJECT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    for library, extra in EXTRA_OF.items():
        assert library in {re.split("[>=]", line)[0].replace("-", "_") for line in extras[extra]}
