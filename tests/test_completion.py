"""Completion: what the command offers, and what shells make of its scripts."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from avatargen.commands import completion
from avatargen.commands.completion import candidates, main
from avatargen.commands.export.options import make_parser
from avatargen.commands.main import COMMANDS

PROJECT = Path(__file__).parents[1]


@pytest.mark.parametrize(
    ("line", "offered"),
    [
        ("avatargen d", ["data"]),
        ("avatargen data ", ["synth", "prepare", "pack"]),
        ("avatargen train w", ["warm-start"]),
        ("avatargen completion ", ["bash", "zsh", "fish"]),
        ("avatargen none ", []),
        ("avatargen none --", []),
        ("avatar-export 3 --ha", ["--hair", "--hair-color", "--hat", "--hat-color"]),
        (".venv/bin/avatar-export --ends --mi", ["--mirror"]),
        ("avatargen export --scene ", ["hero", "game", "crowd", "print", "ar", "still"]),
        ("avatar-export --hair b", ["bald", "bob", "bun"]),
        ("avatar-export --out a", []),  # any file
        ("avatar-export ", []),
        ("avatargen render 3 --tu", ["--turntable"]),
        ("avatargen survey --from w", ["wardrobe"]),  # whose help has a frame
        ("avatargen eval r", ["runs", "reading", "rays"]),
        ("avatargen", []),
    ],
)
def test_what_may_stand_there_is_offered(line: str, offered: list[str]) -> None:
    assert candidates(line.split(" ")) == offered


def test_all_commands_and_all_options_are_offered() -> None:
    assert set(candidates(["avatargen", ""])) == {each.words[0] for each in COMMANDS}
    options = {name for action in make_parser()._actions for name in action.option_strings if name != "-h"}
    assert set(candidates(["avatar-export", "-"])) == options


def complete(shell: str, line: str, tmp_path: Path) -> list[str]:
    """What a shell makes of the script, with the words of a line before the cursor."""
    words = line.split(" ")
    program = tmp_path / "avatargen"
    program.write_text(f'#!/bin/sh\nPYTHONPATH={PROJECT} exec {sys.executable} -m avatargen "$@"\n')
    program.chmod(0o755)
    ask = {
        "bash": f"COMP_WORDS=({' '.join(words[:-1])} '{words[-1]}'); COMP_CWORD={len(words) - 1}; "
        '_avatargen; printf "%s\\n" "${COMPREPLY[@]}"',
        "zsh": f"words=({' '.join(words[:-1])} '{words[-1]}'); CURRENT={len(words)}; "
        "compadd() { print -l -- $found }; _files() { print files }; _avatargen",
        "fish": f"complete -C '{line}'",
    }[Path(shell).name]
    script = tmp_path / "script"
    before = "compdef() { : }\n" if "compadd" in ask else ""
    script.write_text(before + completion.SCRIPTS[Path(shell).name] + ask + "\n")
    env = {"PATH": f"{tmp_path}:/usr/bin:/bin", "HOME": str(tmp_path)}
    done = subprocess.run([shell, str(script)], env=env, cwd=tmp_path, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    return sorted(done.stdout.split())


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_shells_offer_what_the_command_does(shell: str, tmp_path: Path) -> None:
    found = shutil.which(shell)
    if found is None:
        pytest.skip(f"{shell} is not installed")
    assert complete(found, "avatargen data ", tmp_path) == ["pack", "prepare", "synth"]
    assert complete(found, "avatar-export 3 --ha", tmp_path) == [
        "--hair",
        "--hair-color",
        "--hat",
        "--hat-color",
    ]
    assert complete(found, "avatar-export --scene h", tmp_path) == ["hero"]


def test_the_command_prints_the_script_of_a_shell(capsys: pytest.CaptureFixture[str]) -> None:
    for shell, script in completion.SCRIPTS.items():
        assert main([shell]) == 0
        assert capsys.readouterr() == (script, "")
    assert main(["words", "avatargen", "rend"]) == 0
    assert capsys.readouterr().out == "render\n"
    for words, line in ((["tcsh"], "invalid choice: 'tcsh'"), ([], "required: shell")):
        assert main(words) == 2
        out, err = capsys.readouterr()
        assert (out, err.count("\n")) == ("", 1)
        assert line in err
