"""What holds for every format: one table, whole files or none, the same bytes for the same asset."""

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from assets.asset.asset import Asset, PlainAsset, TexturedAsset
from avatargen.atomic import write_together
from avatargen.errors import InputError
from exporters import FORMATS, encode, export, files_of
from exporters.check_usd import check_usd
from tests.figure import figure, in_motion
from tests.mutate import fast_folder
from tests.test_atomic import small_files_only
from tests.test_avatar_export import outside
from tests.verdicts import khronos_issues

NAMES = [f"person{suffix}" for suffix in FORMATS]
ARRAYS = ("vertices", "normals", "uv", "faces", "joints", "weights", "texture")


def person(size: int = 64) -> Asset:
    """A figure with all that there can be a file for."""
    return in_motion(figure(size=size))


@pytest.mark.parametrize("name", ["a.fbx", "a", "a.glb.zip", ".glb", ""])
def test_unknown_suffixes_are_refused_with_the_known_ones(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match=r"no known suffix; use one of \.glb, .*\.usdz"):
        export(figure(), tmp_path / name)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", NAMES)
def test_the_files_announced_are_the_files_written(tmp_path: Path, name: str) -> None:
    path = tmp_path / name.upper()  # the suffix counts in any case
    size = export(person(), path)
    written = list(tmp_path.iterdir())

    assert files_of(path)[0] == path
    assert sorted(written) == sorted(files_of(path))
    assert size == sum(file.stat().st_size for file in written)
    assert encode(person(), path)[-1][0] == path  # a file that is there finds the files it names
    assert dict(encode(person(), path)) == {f: f.read_bytes() for f in written}


@pytest.mark.parametrize("name", NAMES)
def test_encoding_leaves_the_asset_alone(name: str) -> None:
    asset = figure()
    before = {array: getattr(asset, array).copy() for array in ARRAYS}
    encode(asset, name)
    for array, values in before.items():
        np.testing.assert_array_equal(getattr(asset, array), values)


@pytest.mark.parametrize("name", [name for name in NAMES if FORMATS[Path(name).suffix].beside])
def test_one_file_that_cannot_be_written_leaves_all_as_they_were(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    export(person(), path)
    before = {file: file.read_bytes() for file in files_of(path)}
    blocked = files_of(path)[-1]
    blocked.unlink()
    blocked.mkdir()
    with pytest.raises(InputError, match=f"cannot write .*{blocked.name}: it is a folder"):
        export(person(size=32), path)
    assert all(file.read_bytes() == before[file] for file in files_of(path) if file != blocked)
    assert sorted(tmp_path.iterdir()) == sorted(files_of(path))


@pytest.mark.parametrize("name", NAMES)
def test_same_asset_same_bytes(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    first = encode(figure(), name)
    monkeypatch.setattr("time.time", lambda: 2e9)
    assert encode(figure(), name) == first


@pytest.mark.parametrize("kind", [PlainAsset, TexturedAsset])
@pytest.mark.parametrize("name", [name for name in NAMES if not name.endswith(".vrm")])
def test_lesser_assets_make_lesser_files(tmp_path: Path, name: str, kind: type[PlainAsset]) -> None:
    """Nothing is written for what an asset does not have; `.stl` alone never has more than the shape."""
    whole = figure()
    asset = kind(**{part.name: getattr(whole, part.name) for part in fields(kind)})
    size = export(asset, tmp_path / name)
    content = FORMATS[Path(name).suffix].content

    pictures = [path for path in tmp_path.iterdir() if path.name.endswith("_base_color.png")]
    assert bool(pictures) == (kind is TexturedAsset and len(files_of(name)) > 1)
    if content == "mesh" or (content == "textured" and kind is TexturedAsset):
        assert size == sum(len(data) for _, data in encode(whole, name))
    else:
        assert size < sum(len(data) for _, data in encode(whole, name))
    if name.endswith((".glb", ".gltf")):
        assert khronos_issues(tmp_path / name)["messages"] == []
    if ".usd" in name:
        assert check_usd(tmp_path / name) == []


KILLS = 100
KILLER = """
import os, signal, sys, time
from pathlib import Path
import numpy as np
from avatargen.atomic import PART_SUFFIX, write_together
from exporters import encode, export, files_of
from tests.figure import figure, in_motion
assets = [in_motion(figure(size=128)), in_motion(figure(size=96))]
random, cut_short = np.random.default_rng(0), 0
for path in map(Path, sys.argv[2:]):
    export(assets[0], path)
    # what `export` writes, made once: so most moments are those of a write
    versions = [encode(asset, path) for asset in assets]
    for moment in random.uniform(0.0, 0.006, int(sys.argv[1])):
        heard, told = os.pipe()
        child = os.fork()
        while child == 0:
            for files in versions:
                os.write(told, b"x")
                write_together(files)
        os.close(told)
        os.read(heard, 1)
        os.close(heard)
        time.sleep(moment)
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        for file in files_of(path):
            assert file.read_bytes() in [dict(files)[file] for files in versions], f"{file} is torn"
        cut_short += any(file.suffix == PART_SUFFIX for file in path.parent.iterdir())
    export(assets[0], path)
    assert sorted(path.parent.iterdir()) == sorted(files_of(path)), "leftovers were not swept"
print(cut_short)
"""


def test_killed_at_random_moments_no_file_is_torn() -> None:
    """Every file is one of the two that were being written, whole; leftovers are swept by the next write."""
    with fast_folder() as folder:
        paths = [folder / name.replace(".", "_") / name for name in NAMES]
        for path in paths:
            path.parent.mkdir()
        command = [sys.executable, "-c", KILLER, str(KILLS), *map(str, paths)]
        run = subprocess.run(command, env=outside(), capture_output=True, text=True, timeout=600)
    assert run.returncode == 0, run.stderr
    assert int(run.stdout) > len(NAMES)  # many kills met a write half done


@pytest.mark.parametrize("name", NAMES)
def test_full_disk_leaves_the_old_files(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    export(person(), path)
    before = {file: file.read_bytes() for file in tmp_path.iterdir()}
    asset = person(size=96)
    with (
        pytest.raises(InputError, match=r"cannot write .*(File too large|TMPDIR)"),
        small_files_only(),
    ):
        export(asset, path)
    assert {file: file.read_bytes() for file in tmp_path.iterdir()} == before


@pytest.mark.parametrize("name", NAMES)
def test_read_only_folder_leaves_the_old_files(name: str) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / name
        export(person(), path)
        before = {file: file.read_bytes() for file in files_of(path)}
        files = encode(person(size=96), path)
        Path(folder).chmod(0o555)
        with pytest.raises(InputError, match=r"cannot write .*Permission denied"), as_nobody():
            write_together(files)
        assert {file: file.read_bytes() for file in Path(folder).iterdir()} == before
        Path(folder).chmod(0o755)


@contextmanager
def as_nobody() -> Iterator[None]:
    """As a user whom permissions stop: root passes them all."""
    user = os.geteuid()
    if user == 0:
        os.seteuid(65534)
    try:
        yield
    finally:
        os.seteuid(user)
