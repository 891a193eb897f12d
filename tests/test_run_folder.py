"""A folder belongs to one run: what made it is compared by content, and a refusal names what differs."""

import json
from pathlib import Path

import numpy as np
import pytest

from avatargen.errors import InputError
from avatargen.run_folder import claim, cut_log, digest, digest_arrays, digest_files

SETTINGS = {"size": 8, "rates": (0.1, 0.2), "group": {"seed": 0, "steps": 5}, "data": "a" * 64}


def mine(folder: Path, **change: object) -> None:
    claim(folder, "config.json", SETTINGS | change, "test", made=["state.pt"], free=["group.steps"])


def test_a_claimed_folder_goes_on_and_names_what_differs(tmp_path: Path) -> None:
    mine(tmp_path / "new" / "run")
    folder = tmp_path / "new" / "run"
    before = (folder / "config.json").read_bytes()
    mine(folder)
    for change, told in (
        ({"size": 9}, r"settings: size 8, now 9; name another"),
        ({"group": {"seed": 1, "steps": 5}}, r"settings: group\.seed 0, now 1;"),
        ({"data": "b" * 64}, r"settings: data has other contents;"),
        ({"new": None}, r"settings: new not told, now null;"),
        ({"size": 1, "rates": 2, "data": 3, "new": 4}, r"size 8, now 1, rates .* and 1 more;"),
    ):
        with pytest.raises(InputError, match=told):
            mine(folder, **change)
    assert (folder / "config.json").read_bytes() == before
    mine(folder, group={"seed": 0, "steps": 9})
    assert json.loads((folder / "config.json").read_bytes())["group"] == {"seed": 0, "steps": 9}


def test_what_a_run_left_without_settings_is_nobodys_to_continue(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").touch()
    mine(tmp_path)
    (tmp_path / "config.json").unlink()
    (tmp_path / "state.pt").touch()
    with pytest.raises(InputError, match=r"holds other files, such as state\.pt, and no config\.json"):
        mine(tmp_path)
    assert not (tmp_path / "config.json").exists()


@pytest.mark.parametrize("content", [b"", b"[1]", b"\xff", b"[" * 100_000])
def test_damaged_settings_are_refused_and_kept(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "config.json").write_bytes(content)
    with pytest.raises(InputError, match="cannot use"):
        mine(tmp_path)
    assert (tmp_path / "config.json").read_bytes() == content


def test_a_log_is_cut_to_what_was_reached(tmp_path: Path) -> None:
    log = tmp_path / "log.jsonl"
    cut_log(log, "step", 4, "test")
    assert not log.exists()
    log.write_text('{"step": 2}\n{"step": 4}\n{"step": 6}\n{"st')
    cut_log(log, "step", 4, "test")
    assert log.read_text() == '{"step": 2}\n{"step": 4}\n'
    log.write_text('{"images": 2}\n')
    with pytest.raises(InputError, match="is damaged"):
        cut_log(log, "step", 4, "test")


def test_digests_follow_names_and_contents_and_nothing_else(tmp_path: Path) -> None:
    for folder in ("a", "b"):
        (tmp_path / folder / "in").mkdir(parents=True)
        (tmp_path / folder / "in" / "one").write_bytes(b"same")
        (tmp_path / folder / "two").write_bytes(b"size")
    assert digest(tmp_path / "a") == digest(tmp_path / "b")
    (tmp_path / "b" / "two").write_bytes(b"Size")
    assert digest(tmp_path / "a") != digest(tmp_path / "b")
    (tmp_path / "b" / "two").rename(tmp_path / "b" / "too")
    (tmp_path / "b" / "too").write_bytes(b"size")
    assert digest(tmp_path / "a") != digest(tmp_path / "b")
    there, missing = tmp_path / "a" / "two", tmp_path / "a" / "none"
    assert len({digest_files(tmp_path / "a", files) for files in ([there], [there, missing], [])}) == 3
    with pytest.raises(InputError, match="found no file"):
        digest(missing)
    number = np.arange(3)
    arrays = [number, number + 1, number[:, None], number.astype(np.int32), np.arange(6)[::2]]
    assert len({digest_arrays({"a": array}) for array in arrays}) == 5
    assert digest_arrays({"a": np.arange(6)[::2]}) == digest_arrays({"a": np.array([0, 2, 4])})
