"""Khronos' own validator finds nothing to say about our files: no error, no warning, no note."""

from dataclasses import fields
from pathlib import Path

import pytest

from assets import PlainAsset, TexturedAsset
from exporters import export
from exporters.glb import encode
from tests.tube import tube
from tests.verdicts import khronos_issues


@pytest.mark.parametrize(
    "shape",
    [{}, {"joint_count": 24, "tilt": 0.1}, {"joint_count": 300}, {"rings": 1100, "sides": 60}],
    ids=["two bones", "turned joints", "u16 joints", "u32 indices"],
)
def test_tubes_are_flawless(tmp_path: Path, shape: dict) -> None:
    path = tmp_path / "tube.glb"
    export(tube(**shape), path)
    issues = khronos_issues(path)

    assert issues["messages"] == []
    assert (issues["numErrors"], issues["numWarnings"], issues["numInfos"]) == (0, 0, 0)


@pytest.mark.parametrize("kind", [PlainAsset, TexturedAsset])
def test_lesser_assets_are_flawless(tmp_path: Path, kind: type[PlainAsset]) -> None:
    whole, path = tube(), tmp_path / "tube.glb"
    path.write_bytes(encode(kind(**{part.name: getattr(whole, part.name) for part in fields(kind)})))
    issues = khronos_issues(path)
    assert issues["messages"] == []
    assert path.stat().st_size < len(encode(whole))


def test_the_judge_is_awake(tmp_path: Path) -> None:
    """A damaged file is found out: an index beyond the last vertex."""
    path = tmp_path / "tube.glb"
    asset = tube()
    asset.faces[0, 0] = len(asset.vertices)
    export(asset, path)
    assert "ACCESSOR_INDEX_OOB" in {message["code"] for message in khronos_issues(path)["messages"]}
