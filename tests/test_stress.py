"""Every extreme case but the long ones ends as it must; and one that does not is found out."""

import json

import pytest

from avatargen.commands.stress import run as stress
from avatargen.commands.stress.case import Case, require
from avatargen.errors import FieldError, InputError

CASES = [case for _, case in stress.all_cases() if not case.slow]


@pytest.mark.parametrize("case", CASES, ids=[case.name for case in CASES])
def test_case(case: Case) -> None:
    outcome = stress.attempt("", case)
    assert outcome.right, outcome.happened


def fail(error: Exception) -> str:
    raise error


@pytest.mark.parametrize(
    "case",
    [
        Case(name="wrong", expected="", check=lambda: str(require(1 > 2, "one is less"))),
        Case(name="error", expected="", check=lambda: fail(InputError("bad"))),
        Case(name="no error", expected="", check=lambda: "", error=(InputError, "bad")),
        Case(name="other", expected="", check=lambda: fail(FieldError("bad")), error=(InputError, "bad")),
        Case(name="words", expected="", check=lambda: fail(InputError("good")), error=(InputError, "bad")),
        Case(name="slow", expected="", check=lambda: str(sum(range(100_000))), seconds=1e-6),
        Case(name="large", expected="", check=lambda: str(len(bytes(range(256)) * 400_000)), megabytes=20.0),
    ],
    ids=lambda case: case.name,
)
def test_what_goes_wrong_is_found_out(case: Case, tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.setattr(stress, "all_cases", lambda: [("Group", case)])
    assert stress.main(["--out", str(tmp_path)]) == 2
    assert case.name in capsys.readouterr().err
    assert [row["right"] for row in json.loads((tmp_path / "stress.json").read_text())] == [False]
    assert "| **no** |" in (tmp_path / "stress.md").read_text()
