"""Parts named as Ready Player Me's avatars have them: a head of its own, and nothing changed otherwise."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from assets.asset.asset import Asset, apart, part_names
from assets.asset.names import rename_joints
from assets.asset.part_names import head_apart, rename_parts
from avatargen.errors import InputError
from exporters import export
from exporters.check_usd import check_usd
from exporters.read_glb import read_glb
from tests.figure import figure
from tests.test_separate import built
from tests.verdicts import khronos_issues

WANTED = ("Wolf3D_Head", "Wolf3D_Body", "Wolf3D_Outfit_Footwear", "Wolf3D_Outfit_Top")


def triangles(asset: Asset) -> np.ndarray:
    """Corners of the faces with all that a viewer sees of each."""
    seen = np.concatenate([asset.vertices, asset.normals, asset.weights, asset.joints], axis=1)
    rows = seen[asset.faces].reshape(len(asset.faces), -1)
    return rows[np.lexsort(rows.T)]


def test_the_head_is_a_part_and_every_face_is_as_it_was() -> None:
    asset: Any = built(normal_map=32, ambient_occlusion=32)
    named = rename_parts(asset)
    assert part_names(named) == WANTED
    assert np.array_equal(triangles(named), triangles(asset))
    parts: Any = apart(named)
    own: Any = apart(asset)
    head, body = parts["Wolf3D_Head"], parts["Wolf3D_Body"]
    assert head.vertices[:, 1].mean() > body.vertices[:, 1].mean() + 0.3
    assert head.vertices[:, 1].min() > 1.2  # above the shoulders
    assert np.array_equal(head.texture, own["body"].texture) and np.array_equal(body.texture, head.texture)
    for ours, theirs in (("top", "Wolf3D_Outfit_Top"), ("shoes", "Wolf3D_Outfit_Footwear")):
        assert np.array_equal(parts[theirs].vertices, own[ours].vertices)
        assert np.array_equal(parts[theirs].texture, own[ours].texture)
        assert np.array_equal(parts[theirs].faces, own[ours].faces)


def test_parts_without_such_a_name_keep_theirs() -> None:
    asset: Any = built("keep")
    worn = replace(
        asset, parts=tuple(replace(p, name="outer" if p.name == "top" else p.name) for p in asset.parts)
    )
    assert part_names(rename_parts(worn)) == (*WANTED[:3], "outer")
    dress = replace(
        asset, parts=tuple(replace(p, name="dress" if p.name == "top" else p.name) for p in asset.parts)
    )
    assert part_names(rename_parts(dress)) == WANTED  # of those who wear no top
    headless = replace(asset, skeleton=replace(asset.skeleton, joint_names=tuple(f"j{i}" for i in range(24))))
    assert part_names(head_apart(headless)) == ("body", "shoes", "top")
    with pytest.raises(InputError, match="give --parts separate"):
        rename_parts(figure())


def test_files_hold_them_and_the_body_s_picture_once(tmp_path: Path) -> None:
    named = rename_joints(rename_parts(built()), "rpm")
    export(named, tmp_path / "person.glb")
    assert khronos_issues(tmp_path / "person.glb")["messages"] == []
    back: Any = read_glb(tmp_path / "person.glb")
    assert part_names(back) == WANTED and "Hips" in back.skeleton.joint_names
    assert np.abs(back.vertices - named.vertices).max() < 1e-6
    assert np.abs(back.uv - named.uv).max() < 1e-6 and np.array_equal(back.texture, named.texture)
    export(built(), tmp_path / "own.glb")
    more = (tmp_path / "person.glb").stat().st_size - (tmp_path / "own.glb").stat().st_size
    assert more < 0.1 * (tmp_path / "own.glb").stat().st_size
    export(named, tmp_path / "person.usdz")
    assert check_usd(tmp_path / "person.usdz") == []
