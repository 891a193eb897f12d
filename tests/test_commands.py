"""The commands' promises to scripts: one line, the right status, no file; help that answers at once."""

import io
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from assets import BuildConfig
from avatargen import __version__
from avatargen.body.load import load_body
from avatargen.commands import main, progress
from avatargen.commands.export import avatar_export, options
from avatargen.commands.line import run_command
from avatargen.commands.progress import progress_line
from avatargen.errors import FieldError, InputError
from tests.bodies import capsule_body

PROJECT = Path(__file__).parents[1]


@pytest.fixture(autouse=True)
def in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.fixture(autouse=True)
def keep_signal_handler():
    handler = signal.getsignal(signal.SIGTERM)
    yield
    signal.signal(signal.SIGTERM, handler)


def fails(arguments: list[str], capsys: pytest.CaptureFixture[str], program=avatar_export) -> str:
    """The one line a bad call ends in; nothing is printed for scripts and the folder stays as it was."""
    before = sorted(os.listdir("."))
    assert program.main(arguments) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert sorted(os.listdir(".")) == before
    return err


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        ([], "found nobody to make; give a seed, as in --seed 3, or --seeds, --text, --photo or --person"),
        (["--seed"], "--seed: expected one argument"),
        (["--seed", "-1"], "--seed"),
        (["--seed", "three"], "found 'three', wanted a whole number from 0 to"),
        (["--seed", "3.0"], "found '3.0'"),
        (["--seed", "1e3"], "found '1e3'"),
        (["--seed", "1_000"], "found '1_000'"),
        (["--seed", "٣"], "wanted a whole number"),
        (["--seed", ""], "found ''"),
        (["--seed", str(2**63)], f"from 0 to {2**63 - 1}"),
        (["--seed", "9" * 5000], "wanted a whole number"),
        (["--seed", "3", "--faces", "0"], "--faces: found '0', wanted a whole number from 100"),
        (["--seed", "3", "--texture", "1000000"], "--texture: found '1000000'"),
        (["--seed", "3", "--resolution", "high"], "--resolution: found 'high'"),
        (["--seed", "3", "--resolution", "4096"], "--resolution: found '4096'"),
        (["--seed", "3", "--fac", "500"], "found --fac, which is no option; did you mean --faces or --face?"),
        (["--sede", "3"], "found --sede, which is no option; did you mean --seed?"),
        (["-seed", "3"], "found -seed, which is no option; did you mean --seed?"),
        (
            ["3", "--textur=64"],
            "found --textur, which is no option; did you mean --texture-from or --texture or",
        ),
        (["3", "--color", "red"], "did you mean --hair-color or --hat-color or --top-color?"),
        (["3", "--xyzzy"], "found --xyzzy, which is no option; see avatar-export --help"),
        (["3", "-x"], "found -x, which is no option; see avatar-export --help"),
        (["--seed", "3", "extra"], "found 'extra', wanted a whole number from 0 to"),
        (["three"], "argument SEED: found 'three', wanted a whole number from 0 to"),
        (["-1"], "argument SEED: found '-1'"),
        (["3", "5"], "unrecognized arguments: 5"),
        (["3", "--seed", "4"], "found 3 and --seed 4; give one seed"),
        (["3", "--seeds", "4:6"], "found --seed with --seeds; give one of them"),
        (["3", "--height", "tall"], "--height: found 'tall', wanted a positive number such as 1.75m"),
        (["3", "--height", "175in"], "--height: found '175in'"),
        (["3", "--height", "300cm"], "height: found 3 m, wanted 1.40 to 2.10 m"),
        (["3", "--top-color", "gren"], "or #7a1f2b; did you mean green?"),
        (["--seed", "3:5"], "or random; many go to --seeds"),
        (["--seed", "Random"], "found 'Random'"),
        (["random", "--out", "a.fbx"], "found --out a.fbx"),
        (["3", "--sheet", "a.png"], "found --sheet with one seed; give --seeds"),
        (["--seeds", "3,5", "--out", "a", "--sheet", "a.gif"], "found --sheet a.gif; give a name that ends"),
        (["--seeds", "3,5", "--out", "a", "--sheet", "none/a.png"], "cannot write none/a.png"),
        (["--seeds", "0:1001", "--out", "a", "--sheet", "a.png"], "found --sheet with 1001 seeds"),
        (["--seed", "3", "--out", "a.glb", "--format", "vrm"], "give a name that ends in .vrm"),
        (["--seed", "3", "--out", "missing/a.glb"], "cannot write missing/a.glb: No such file or directory"),
        (
            ["--seed", "3", "--out", "/dev/full"],
            "wanted a name that ends in one of .glb",
        ),
        (["--seed", "3", "--report", "/dev/full"], "cannot write /dev/full"),
        (["--seed", "3", "--report", "."], "cannot write .: it is a folder"),
        (["--seed", "3", "--report", "missing/a.json"], "cannot write missing/a.json"),
        (["--seed", "3", "--preview", "a.jpg"], "give a name that ends in .png"),
        (["--seed", "3", "--preview", "missing/a.png"], "cannot write missing/a.png"),
        (["--seed", "3", "--weights", "none.safetensors"], "found no file none.safetensors"),
        (["--seed", "3", "--body", "none.npz"], "found no file none.npz"),
        (["--seed", "3", "--clip", "fly"], "--clip: found clip 'fly', wanted one of"),
        (["--seed", "3", "--names", "maya"], "--names: invalid choice: 'maya'"),
        (["--seed", "3", "--motion", "none.npz"], "found no file none.npz"),
        (["--seed", "3", "--fps", "0"], "--fps: found '0', wanted a number above 0, up to 1000"),
        (["--seed", "3", "--speed", "nan"], "--speed: found 'nan'"),
        (["--seed", "3", "--speed", "1_0"], "--speed: found '1_0'"),
    ],
)
def test_bad_arguments_end_in_one_line(
    arguments: list[str], line: str, capsys: pytest.CaptureFixture[str]
) -> None:
    err = fails(arguments, capsys)
    assert err.startswith("avatar-export: ")
    assert line in err


WATCH_IMPORTS = """
import atexit, sys
atexit.register(lambda: print(sorted({"torch", "numpy", "rich"} & set(sys.modules))))
from avatargen.commands.COMMAND import main
main(["--help"])
"""


@pytest.mark.parametrize("command", ["export.avatar_export", "main"])
def test_help_answers_at_once_and_imports_nothing_heavy(command: str) -> None:
    seconds = []
    for _ in range(3):
        started = time.perf_counter()
        code = [sys.executable, "-c", WATCH_IMPORTS.replace("COMMAND", command)]
        run = subprocess.run(code, cwd=PROJECT, capture_output=True, text=True)
        seconds.append(time.perf_counter() - started)
    assert run.returncode == 0, run.stderr
    assert "usage: " in run.stdout
    assert run.stdout.splitlines()[-1] == "[]"
    assert min(seconds) < 1


def test_help_names_the_settings_own_defaults(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        options.read(["--help"])
    text = " ".join(capsys.readouterr().out.split("the asset:")[1].split())
    config = BuildConfig()
    for name in ("faces", "texture", "resolution", "pose"):
        assert f"(default: {getattr(config, name)}" in text.split(f"--{name} ")[1].split("--")[0]


@pytest.mark.parametrize(
    ("error", "status", "line"),
    [
        (InputError("found a\nmess,  wanted order"), 2, "p: found a mess, wanted order\n"),
        (FieldError("NaN"), 2, "p: NaN\n"),
        (MemoryError(), 2, "p: out of memory; lower --resolution or --texture, or close programs\n"),
        (KeyboardInterrupt(), 130, "p: interrupted; nothing is half written\n"),
    ],
)
def test_what_is_raised_becomes_a_line_and_a_status(
    error: BaseException, status: int, line: str, capsys: pytest.CaptureFixture[str]
) -> None:
    def command() -> None:
        raise error

    assert run_command("p", command) == status
    assert capsys.readouterr() == ("", line)


def test_bugs_keep_their_traceback() -> None:
    with pytest.raises(ZeroDivisionError):
        run_command("p", lambda: [][1 // 0])


LEFT = "from avatargen.commands.line import run_command; exit(run_command('p', lambda: print('x')))"


def test_a_reader_that_left_is_no_error() -> None:
    reader, writer = os.pipe()
    os.close(reader)
    run = subprocess.run([sys.executable, "-c", LEFT], cwd=PROJECT, stdout=writer, stderr=subprocess.PIPE)
    os.close(writer)
    assert (run.returncode, run.stderr) == (0, b"")


# a runner in a shell's background ignores SIGINT, and so would its children
INTERRUPTED = """
import signal, sys, time
from avatargen.commands.line import run_command
signal.signal(signal.SIGINT, signal.default_int_handler)
def work():
    try:
        print("ready", flush=True)
        time.sleep(30)
    finally:
        print("tidy", flush=True)
sys.exit(run_command("p", work))
"""


@pytest.mark.parametrize(("sent", "status"), [(signal.SIGTERM, 143), (signal.SIGINT, 130)])
def test_interruption_runs_every_finally(sent: signal.Signals, status: int) -> None:
    code = [sys.executable, "-c", INTERRUPTED]
    with subprocess.Popen(code, cwd=PROJECT, stdout=-1, stderr=-1, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        process.send_signal(sent)
        assert process.communicate()[0] == "tidy\n"
    assert process.returncode == status


@pytest.mark.parametrize("status", [0, 2, 143])
def test_leaving_keeps_the_status_what_was_printed_and_what_waits_for_the_end(status: int) -> None:
    code = f"""
import atexit, sys
from avatargen.commands.line import leave
atexit.register(print, "the end", file=sys.stderr)
print("x" * 100_000)
leave({status})
print("not reached")
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == status
    assert done.stdout == "x" * 100_000 + "\n"
    assert done.stderr == "the end\n"


WRITES = """
import subprocess, sys
from pathlib import Path
from avatargen.commands import main
from avatargen.commands.line import run_command
def work():
    with open("kept", "w") as kept:
        kept.write("whole")
        kept.flush()
        child = "import os, sys; print('child'); print('child', file=sys.stderr); os.write(1, b'x')"
        subprocess.run([sys.executable, "-c", child], check=True)
        print("the path")
        print("closing", file=sys.stderr)
main.main(["--version"])
sys.exit(run_command("p", work))
"""


@pytest.mark.parametrize("closed", ["<&-", ">&-", "2>&-", "<&- >&-", ">&- 2>&-", "<&- >&- 2>&-"])
def test_streams_that_are_closed_are_missed_by_nobody(closed: str) -> None:
    """As services are started: the work is done, the status is right, and nothing that is printed, by us or
    by a child, lands in a file that took a stream's number."""
    shell = ["sh", "-c", f'exec "$0" -c "$1" {closed}', sys.executable, WRITES]
    done = subprocess.run(
        shell, env=os.environ | {"PYTHONPATH": str(PROJECT)}, capture_output=True, text=True
    )
    assert (done.returncode, Path("kept").read_text()) == (0, "whole")
    assert ("the path" in done.stdout) == (">&-" not in closed.replace("2>&-", ""))
    assert ("closing" in done.stderr) == ("2>&-" not in closed)
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_output_that_has_no_room_is_told_in_a_line(unbuffered: str) -> None:
    code = "from avatargen.commands.line import *; leave(run_command('p', lambda: print('the path')))"
    env = os.environ | {"PYTHONUNBUFFERED": unbuffered}
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [sys.executable, "-c", code], cwd=PROJECT, env=env, stdout=full, stderr=-1, text=True
        )
    assert done.returncode == 2
    assert done.stderr.splitlines() == [
        "p: cannot print: No space left on device; give the output room, or send it elsewhere"
    ]


def test_errors_that_have_no_room_leave_the_status() -> None:
    code = (
        "from avatargen.commands.line import *; leave(run_command('p', lambda: print('x', file=sys.stderr)))"
    )
    for mode, status in (("w", 2), ("r", 0)):  # no room; no writing, as if it were closed
        with open("/dev/full", mode) as full:
            done = subprocess.run([sys.executable, "-c", code], cwd=PROJECT, stderr=full, stdout=-1)
        assert done.returncode == status


@pytest.mark.parametrize("encoding", ["utf-8", "ascii", "latin-1"])
def test_names_of_files_are_printed_as_they_are(encoding: str) -> None:
    """Bytes that are no UTF-8, and letters that the stream's encoding does not have."""
    code = """
import os, sys
from avatargen.commands.line import leave, run_command
from avatargen.errors import InputError
def work():
    print(sys.argv[1], sys.argv[1] + chr(0xd800))
    raise InputError(sys.argv[1])
leave(run_command("p", work))"""
    for name in (b"caf\xe9.glb", "ł.glb".encode()):
        command = [sys.executable.encode(), b"-c", code.encode(), name]
        done = subprocess.run(
            command, cwd=PROJECT, env=os.environ | {"PYTHONIOENCODING": encoding}, capture_output=True
        )
        assert done.returncode == 2
        assert done.stdout == name + b" " + name + rb"\ud800" + b"\n"
        assert done.stderr == b"p: " + name + b"\n"


TERMINATED_WITHIN = """
import os, signal, sys, time
from avatargen.commands.line import run_command
class Thing:
    def __del__(self):
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(0.05)
def work():
    thing = Thing()
    try:
        del thing
        while True:
            time.sleep(0.01)
    finally:
        print("tidy", flush=True)
sys.exit(run_command("p", work))
"""


def test_a_signal_within_a_destructor_is_not_lost() -> None:
    code = [sys.executable, "-c", TERMINATED_WITHIN]
    done = subprocess.run(code, cwd=PROJECT, capture_output=True, timeout=20)
    assert (done.returncode, done.stdout) == (143, b"tidy\n")


def test_a_library_that_changes_the_exit_of_a_signal_does_not_change_the_status() -> None:
    def load() -> None:
        try:
            signal.raise_signal(signal.SIGTERM)
        except SystemExit as error:
            raise ImportError("cannot load") from error

    before = signal.getsignal(signal.SIGTERM)
    try:
        assert run_command("test", load) == 143
    finally:
        signal.signal(signal.SIGTERM, before)


def test_progress_is_silent_in_a_pipe_and_seen_on_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    for stream, seen in ((io.StringIO(), False), (Terminal(), True)):
        monkeypatch.setattr(sys, "stderr", stream)
        monkeypatch.setenv("TERM", "xterm")
        with progress_line() as show:
            show("extracting", 0.5)
            time.sleep(0.2)
        assert ("extracting" in stream.getvalue()) == seen


def test_a_pipe_hears_every_ten_seconds_if_at_all(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    now = 1000.0
    monkeypatch.setattr(time, "monotonic", lambda: now)
    for wanted, told in (
        ({}, []),
        ({"in_pipes": True, "quiet": True}, []),
        (
            {"in_pipes": True},
            [
                "2 of 9 in 0:00:14, about 0:00:49 left",
                "4 of 9 in 0:00:28, about 0:00:35 left",
                "6 of 9 in 0:00:42, about 0:00:21 left",
                "8 of 9 in 0:00:56, about 0:00:07 left",
            ],
        ),
    ):
        with progress_line(**wanted) as show:
            show("loading", 0.0)
            for count in range(1, 10):
                now += 7.0
                show(f"{count} of 9", count / 9)
        assert capsys.readouterr().err.splitlines() == told


def test_nobody_who_hears_is_no_reason_to_stop(monkeypatch: pytest.MonkeyPatch) -> None:
    class Broken(io.StringIO):
        def write(self, text: str) -> int:
            raise BrokenPipeError

    monkeypatch.setattr(sys, "stderr", Broken())
    monkeypatch.setattr(progress, "EVERY", 0.0)
    with progress_line(in_pipes=True) as show:
        show("1 of 2", 0.5)


@pytest.mark.parametrize(
    ("words", "line"),
    [
        ([], "found no command, wanted one of: "),
        (["body"], "found 'body'"),
        (["fly", "home", "x"], "found 'fly home'"),
    ],
)
def test_avatargen_names_its_commands(
    words: list[str], line: str, capsys: pytest.CaptureFixture[str]
) -> None:
    err = fails(words, capsys, program=main)
    assert line in err
    assert "body convert" in err


@pytest.mark.parametrize(
    ("words", "meant"),
    [
        (["rendr", "3"], "render"),
        (["avatar-export", "3"], "export"),
        (["data", "prepair"], "data prepare"),
        (["prepare", "--images", "a"], "data prepare"),
        (["data"], "data synth or data prepare or data pack"),
        (["train", "warmstart"], "train warm-start"),
        (["eval", "run"], "eval runs"),
        (["compl"], "completion"),
        (["--hlep"], "--help"),
    ],
)
def test_a_misspelt_command_is_answered_with_the_one_that_was_meant(
    words: list[str], meant: str, capsys: pytest.CaptureFixture[str]
) -> None:
    err = fails(words, capsys, program=main)
    assert err.startswith("avatargen: found ")
    assert f", which is no command; did you mean {meant}? see avatargen --help\n" in err


def test_export_is_a_command_of_avatargen_too(capsys: pytest.CaptureFixture[str]) -> None:
    printed = []
    for program, words in ((main, ["export"]), (avatar_export, [])):
        assert program.main([*words, "3", "--dry-run", "--faces", "900"]) == 0
        printed.append(capsys.readouterr())
    assert printed[0] == printed[1]
    assert printed[0].out.startswith("avatar_3.glb: rigged\n")


def test_the_package_runs_as_its_command() -> None:
    code = [sys.executable, "-m", "avatargen"]
    env = os.environ | {"PYTHONPATH": str(PROJECT)}
    told = subprocess.run([*code, "--version"], env=env, capture_output=True, text=True)
    assert (told.returncode, told.stdout) == (0, f"avatargen {__version__}\n")
    wrong = subprocess.run([*code, "rendr"], env=env, capture_output=True, text=True)
    assert (wrong.returncode, wrong.stdout) == (2, "")
    assert wrong.stderr.startswith("avatargen: found 'rendr'")


def test_every_command_of_the_table_exists() -> None:
    for command in main.COMMANDS:
        assert callable(command.load())


def test_body_convert(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from avatargen.body.load import save_body

    body = capsule_body()
    save_body(body, "in.npz")
    assert main.main(["body", "convert", "in.npz", "out.npz"]) == 0
    assert capsys.readouterr().out == "out.npz\n"
    np.testing.assert_array_equal(load_body("out.npz").v_template, body.v_template)

    Path("bad.pkl").write_bytes(b"cos\nsystem\n(S'touch ran'\ntR.")
    assert "bad.pkl" in fails(["body", "convert", "bad.pkl", "x.npz"], capsys, program=main)
    assert ".npz" in fails(["body", "convert", "in.npz", "x.pkl"], capsys, program=main)
    assert not Path("ran").exists()


def test_training_says_what_it_would_do(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    words = ["train", "warm-start", "--out", str(tmp_path / "run"), "--dry-run", "--training.steps", "7"]

    assert main.main([*words, "--plane-resolution", "8"]) == 0
    printed = capsys.readouterr().out
    assert "blocks=((4, 64), (8, 64))" in printed
    assert "steps=7" in printed
    assert not (tmp_path / "run").exists()
