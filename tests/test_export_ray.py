"""Many seeds on a Ray cluster of one node: the same files and manifest; a killed worker costs one seed."""

import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from avatargen.commands.export import avatar_export
from avatargen.export.manifest import NAME
from tests.test_avatar_export import Model, command, in_an_empty_folder, model, outside
from tests.test_export_many import check_row, rows, wait_for

__all__ = ["in_an_empty_folder", "model"]  # fixtures
MARK = f"AVATARGEN_TEST_{os.getpid()}"
QUIET = {"RAY_AUTH_MODE": "disabled", "RAY_USAGE_STATS_ENABLED": "0", "RAY_DISABLE_IMPORT_WARNING": "1"}


@contextmanager
def cluster() -> Iterator[str]:
    """The address of a cluster of two processors, gone at the end."""
    program = Path(sys.executable).with_name("ray")
    if not program.exists():
        pytest.skip("Ray is not installed; it comes with the extra avatargen[ray]")
    with tempfile.TemporaryDirectory(dir="/tmp") as folder:  # Ray's sockets need a short path
        options = ["--head", "--block", "--num-cpus=2", "--port=0", "--include-dashboard=false"]
        memory = ["--object-store-memory=100000000", f"--temp-dir={folder}", "--node-ip-address=127.0.0.1"]
        with (Path(folder) / "log").open("w+") as log:
            run = subprocess.Popen(
                [str(program), "start", *options, *memory],
                env=outside() | QUIET | {MARK: "1"},
                stdout=log,
                stderr=log,
            )
            try:
                found = wait_for(lambda: address_in(Path(folder)))
                yield found
            finally:
                run.send_signal(signal.SIGINT)
                with suppress(subprocess.TimeoutExpired):  # some versions do not heed it
                    run.wait(20)
                for process in ours():
                    with suppress(OSError):
                        os.kill(process, signal.SIGKILL)
                run.wait(60)


def address_in(folder: Path) -> str | None:
    path = folder / "ray_current_cluster"
    return path.read_text().strip() if path.exists() else None


def ours() -> list[int]:
    """Processes of this test's cluster."""
    found = []
    for entry in Path("/proc").iterdir():
        with suppress(OSError):
            if entry.name.isdigit() and MARK.encode() in (entry / "environ").read_bytes():
                found.append(int(entry.name))
    return found


def makers() -> list[int]:
    """Those that make avatars."""
    found = []
    for process in ours():
        with suppress(OSError):
            if Path(f"/proc/{process}/cmdline").read_bytes().startswith(b"ray::Maker"):
                found.append(process)
    return found


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="workers are found in /proc")
def test_a_killed_worker_costs_one_seed_and_the_same_command_finishes(model: Model) -> None:
    folder = Path("crowd")
    with cluster() as address:
        words = ["--seeds", "0:4", "--jobs", "2", "--ray", address, "--out", "crowd", *model.options]
        with subprocess.Popen(command(*words), env=outside() | QUIET, stdout=-1, stderr=-1, text=True) as run:
            wait_for(lambda: (folder / NAME).exists() and len(rows(folder)) >= 1)
            os.kill(wait_for(makers)[0], signal.SIGKILL)
            out, err = run.communicate(timeout=300)
        failed = {row["seed"]: row["error"] for row in rows(folder) if row["error"] is not None}
        assert (run.returncode, out) == (2, ""), err
        assert len(failed) == 1 and "its worker died (" in next(iter(failed.values()))
        assert {row["seed"] for row in rows(folder)} == set(range(4))

        again = subprocess.run(
            command(*words), env=outside() | QUIET, capture_output=True, text=True, timeout=300
        )
        assert (again.returncode, again.stdout) == (0, "crowd/manifest.jsonl\n"), again.stderr
        assert "crowd: 4 avatars, 1 of them made now" in again.stderr
        last = {row["seed"]: row for row in rows(folder)}
        for seed in range(4):
            check_row(folder, seed, last[seed])
        words[words.index("crowd")] = "other"
        bad = [*words, "--pose", "nowhere"]
        told = subprocess.run(
            command(*bad), env=outside() | QUIET, capture_output=True, text=True, timeout=300
        )
        assert told.returncode == 2 and "found --pose nowhere" in told.stderr.splitlines()[-1]
    assert avatar_export.main([*model.options, "--seed", "2", "--out", "one.glb"]) == 0
    assert Path("one.glb").read_bytes() == (folder / "avatar_2.glb").read_bytes()
    shutil.rmtree("other", ignore_errors=True)


def test_no_cluster_and_one_seed_are_one_line(model: Model, capsys: pytest.CaptureFixture[str]) -> None:
    assert avatar_export.main(["--seed", "3", "--ray", "auto"]) == 2
    assert "found --ray with one seed; give --seeds A:B" in capsys.readouterr().err
    started = time.monotonic()
    words = ["--seeds", "0:2", "--ray", "nonsense", "--out", "a", *model.options]
    run = subprocess.run(command(*words), env=outside() | QUIET, capture_output=True, text=True, timeout=120)
    assert run.returncode == 2
    assert "found --ray nonsense, where no cluster answers" in run.stderr.splitlines()[-1]
    assert time.monotonic() - started < 120
