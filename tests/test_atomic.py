"""Whole or not at all: after any failure the target holds what it held before and nothing lies beside it."""

import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

import pytest

from avatargen.atomic import check_writable, only_writer, part_prefix, write_atomically, write_together
from avatargen.errors import InputError

OLD, NEW = b"old bytes", b"new bytes, more of them"


def names(folder: Path) -> list[str]:
    return sorted(entry.name for entry in folder.iterdir())


@contextmanager
def small_files_only() -> Iterator[None]:
    """A disk that is full after 1,000 bytes, by the process's own limit.

    Only around the write itself: pytest's own output may go to a longer file.
    """
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        signal.signal(signal.SIGXFSZ, handler)


def test_writes_new_and_replaces_old(tmp_path: Path) -> None:
    path = tmp_path / "a.glb"
    write_atomically(path, OLD)
    assert path.read_bytes() == OLD
    write_atomically(str(path), NEW)
    assert path.read_bytes() == NEW
    write_atomically(path, b"")
    assert path.read_bytes() == b""
    assert names(tmp_path) == ["a.glb"]


def test_full_disk_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "a.glb"
    write_atomically(path, OLD)

    with (
        pytest.raises(InputError, match=r"cannot write .*a\.glb: File too large; choose a place"),
        small_files_only(),
    ):
        write_atomically(path, bytes(5000))

    assert path.read_bytes() == OLD
    assert names(tmp_path) == ["a.glb"]


@pytest.mark.parametrize("place", ["missing/a.glb", "file/a.glb", ".", "x" * 300, "null\0byte", "loop"])
@pytest.mark.parametrize("act", [check_writable, lambda path: write_atomically(path, NEW)])
def test_impossible_places_are_input_errors(tmp_path: Path, place: str, act) -> None:
    (tmp_path / "file").write_bytes(OLD)
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    before = names(tmp_path)

    with pytest.raises(InputError, match="cannot write"):
        act(tmp_path / place)

    assert names(tmp_path) == before
    assert (tmp_path / "file").read_bytes() == OLD


@pytest.mark.parametrize("path", ["/proc/avatar.glb", "/dev/full", "/dev/null"])
def test_no_file_is_made_in_the_system(path: str) -> None:
    if not Path(path).parent.exists():
        pytest.skip(f"this system has no {Path(path).parent}")
    existed = Path(path).exists()
    for act in (check_writable, lambda place: write_atomically(place, NEW)):
        with pytest.raises(InputError, match="cannot write"):
            act(path)
    assert Path(path).exists() == existed


@pytest.mark.skipif(os.geteuid() == 0, reason="permission bits do not stop root")
def test_read_only_folder(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    with pytest.raises(InputError, match="Permission denied"):
        check_writable(tmp_path / "a.glb")
    tmp_path.chmod(0o700)


def test_together_or_not_at_all(tmp_path: Path) -> None:
    first, second = tmp_path / "a.json", tmp_path / "a.glb"
    write_together([(first, OLD), (second, OLD)])

    with pytest.raises(InputError, match=r"cannot write .*a\.glb: File too large"), small_files_only():
        write_together([(first, NEW), (second, bytes(5000))])
    with pytest.raises(InputError, match="two are the same file"):
        write_together([(first, NEW), (tmp_path / "x" / ".." / "a.json", NEW)])

    assert (first.read_bytes(), second.read_bytes()) == (OLD, OLD)
    write_together([(first, NEW), (second, NEW)])
    assert (first.read_bytes(), second.read_bytes()) == (NEW, NEW)
    assert names(tmp_path) == ["a.glb", "a.json"]


def test_umask_and_existing_mode_are_kept(tmp_path: Path) -> None:
    umask = os.umask(0o027)
    try:
        write_atomically(tmp_path / "new", NEW)
    finally:
        os.umask(umask)
    assert (tmp_path / "new").stat().st_mode & 0o777 == 0o640
    (tmp_path / "new").chmod(0o604)
    write_atomically(tmp_path / "new", OLD)
    assert (tmp_path / "new").stat().st_mode & 0o777 == 0o604


def test_link_is_followed(tmp_path: Path) -> None:
    (tmp_path / "real").write_bytes(OLD)
    (tmp_path / "link").symlink_to("real")
    write_atomically(tmp_path / "link", NEW)
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "real").read_bytes() == NEW


def test_interruption_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.glb"
    write_atomically(path, OLD)

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "replace", interrupt)
    with pytest.raises(KeyboardInterrupt):
        write_atomically(path, NEW)
    assert path.read_bytes() == OLD
    assert names(tmp_path) == ["a.glb"]


def test_sweeps_the_leftovers_of_this_target_alone(tmp_path: Path) -> None:
    path = tmp_path / "a.glb"
    dead = tmp_path / f"{part_prefix(path)}dead.part"
    foreign = tmp_path / f"{part_prefix(tmp_path / 'a.glb.png')}x.part"
    locked = tmp_path / f"{part_prefix(path)}lock"  # by a process that was killed
    for part in (dead, foreign, locked):
        part.write_bytes(b"half")
    write_atomically(path, NEW)
    assert names(tmp_path) == sorted([foreign.name, "a.glb"])


WRITING = """
import sys, time
from pathlib import Path
from avatargen.atomic import only_writer
with only_writer(Path(sys.argv[1])):
    print("writing", flush=True)
    sys.stdin.read()
"""


def test_another_writer_is_waited_for_or_named(tmp_path: Path) -> None:
    path = tmp_path / "a.glb"
    part = tmp_path / f"{part_prefix(path)}living.part"
    part.write_bytes(b"half")
    command = [sys.executable, "-c", WRITING, str(path)]
    with subprocess.Popen(command, cwd=Path(__file__).parents[1], stdin=-1, stdout=-1) as process:
        assert process.stdin and process.stdout
        assert process.stdout.readline() == b"writing\n"
        with (
            pytest.raises(InputError, match=r"a\.glb is being written by another process"),
            only_writer(path),
        ):
            pass
        check_writable(path)
        with ThreadPoolExecutor(1) as pool:
            written = pool.submit(write_atomically, path, NEW)
            with pytest.raises(TimeoutError):
                written.result(timeout=0.3)
            assert part.exists()  # nobody sweeps what a living process writes
            process.stdin.close()
            written.result(timeout=30)
    assert path.read_bytes() == NEW
    assert names(tmp_path) == ["a.glb"]


KILLED = """
import sys
from avatargen.atomic import write_atomically
letter = 0
while True:
    letter = (letter + 1) % 26
    write_atomically(sys.argv[1], bytes([65 + letter]) * 3_000_000)
"""


def test_kill_leaves_a_whole_file_and_the_next_write_sweeps(tmp_path: Path) -> None:
    path = tmp_path / "a.glb"
    for attempt in range(12):
        with subprocess.Popen(
            [sys.executable, "-c", KILLED, str(path)], cwd=Path(__file__).parents[1]
        ) as process:
            waited = time.monotonic() + 20
            while not path.exists() and time.monotonic() < waited:
                time.sleep(0.01)
            time.sleep(0.01 + 0.007 * attempt)
            process.kill()
        data = path.read_bytes()
        assert len(data) == 3_000_000
        assert data == data[:1] * len(data)
    write_atomically(path, NEW)
    assert names(tmp_path) == ["a.glb"]
