"""avatargen check: our files pass, damaged ones are found out in plain words, and statuses tell which."""

import json
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from assets.asset.asset import Asset
from avatargen.commands.look import check
from exporters import FORMATS, check_gltf, export
from exporters.check_mesh import check_mesh
from exporters.check_trimesh import check_trimesh
from exporters.check_vrm import check_vrm
from tests.figure import figure
from tests.test_mesh_files import seamed
from tests.verdicts import khronos_issues


def person_or_tube(suffix: str) -> Asset:
    """A person; for formats that hold a surface alone, a tube whose seam is known to be none."""
    return seamed() if suffix in (".obj", ".ply", ".stl") else figure()


@pytest.mark.parametrize("suffix", FORMATS)
def test_our_files_pass(tmp_path: Path, suffix: str, capsys: pytest.CaptureFixture[str]) -> None:
    export(person_or_tube(suffix), tmp_path / f"a person{suffix}")
    if suffix in (".glb", ".gltf", ".vrm"):
        khronos_issues(tmp_path / f"a person{suffix}")  # skips, or fails in CI, where the judge is missing
    assert check.main([str(tmp_path / f"a person{suffix}")]) == 0
    out, err = capsys.readouterr()
    assert out and all(line.endswith(": nothing to say") for line in out.splitlines())
    assert err == ""


@pytest.mark.parametrize("suffix", FORMATS)
def test_files_cut_short_are_found_out(
    tmp_path: Path, suffix: str, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / f"person{suffix}"
    export(person_or_tube(suffix), path)
    if suffix in (".glb", ".gltf", ".vrm"):
        khronos_issues(path)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 3])
    assert check.main([str(path)]) == 1
    assert not all(line.endswith(": nothing to say") for line in capsys.readouterr().out.splitlines())


def damaged(path: Path, change: Callable[[dict], object]) -> list[str]:
    """What is found in a .vrm whose document was changed."""
    export(figure(), path)
    data = path.read_bytes()
    end = 20 + int.from_bytes(data[12:16], "little")
    document = json.loads(data[20:end])
    change(document)
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    path.write_bytes(data[:12] + len(text).to_bytes(4, "little") + data[16:20] + text + data[end:])
    return check_vrm(path)


@pytest.mark.parametrize(
    ("change", "finding"),
    [
        (lambda d: vrm(d)["meta"].pop("name"), "the model has no name"),
        (lambda d: vrm(d)["meta"].update(authors=[]), "the model has no author"),
        (lambda d: vrm(d)["meta"].update(licenseUrl="mine"), "licenseUrl is 'mine'"),
        (lambda d: bones(d).pop("leftHand"), "the bone leftHand is missing"),
        (lambda d: bones(d)["head"].update(node=bones(d)["neck"]["node"]), "two bones are the same node"),
        (lambda d: bones(d)["head"].update(node=99), "the bone head is node 99, which is not there"),
        (lambda d: d["nodes"][0].update(scale=[1, -1, 1]), "the bone hips is scaled by 0 or less"),
        (lambda d: d.pop("extensions"), "the file is no VRM 1.0"),
        (lambda d: d.update(nodes=3), "the file is no VRM 1.0"),
    ],
)
def test_what_breaks_vrms_rules_is_named(tmp_path: Path, change, finding: str) -> None:
    (found,) = damaged(tmp_path / "person.vrm", change)
    assert finding in found


def vrm(document: dict) -> dict:
    return document["extensions"]["VRMC_vrm"]


def bones(document: dict) -> dict:
    return vrm(document)["humanoid"]["humanBones"]


def test_open_and_inverted_surfaces_are_named(tmp_path: Path) -> None:
    asset = seamed()
    for name, faces, finding in (
        ("open", asset.faces[1:], "the surface is open, or folded onto itself, at 3 edges"),
        ("inverted", asset.faces[:, ::-1].copy(), "the surface is turned inside out or encloses nothing"),
    ):
        for suffix in (".obj", ".ply", ".stl"):
            export(replace(asset, faces=faces), tmp_path / f"{name}{suffix}")
            assert check_mesh(tmp_path / f"{name}{suffix}") == [finding]


def test_trimesh_has_its_own_verdicts(tmp_path: Path) -> None:
    asset = seamed()
    faces, count = asset.faces, len(asset.vertices)
    for name, changed, finding in (
        ("open", faces[1:], "the surface is not watertight"),
        ("turned", np.concatenate([faces[:1, ::-1], faces[1:]]), "neighbouring faces are turned"),
        ("inverted", faces[:, ::-1].copy(), "the surface encloses no volume"),
    ):
        export(replace(asset, faces=changed), tmp_path / f"{name}.ply")
        (found,) = check_trimesh(tmp_path / f"{name}.ply")
        assert found.startswith(finding)
    twice = replace(
        asset,
        vertices=np.concatenate([asset.vertices, asset.vertices + np.float32(3)]),
        faces=np.concatenate([faces, faces + count]),
        **{
            name: np.concatenate([getattr(asset, name)] * 2)
            for name in ("normals", "uv", "joints", "weights")
        },
        welded=None,
    )
    export(twice, tmp_path / "twice.ply")
    (found,) = check_trimesh(tmp_path / "twice.ply")
    assert found.startswith("the Euler number is 4")


def test_khronos_findings_are_sentences(tmp_path: Path) -> None:
    asset = figure()
    asset.faces[0, 0] = len(asset.vertices)
    export(asset, tmp_path / "person.glb")
    khronos_issues(tmp_path / "person.glb")
    findings = check_gltf.check_gltf(tmp_path / "person.glb")
    assert findings and findings[0].startswith("/meshes/0/primitives/0/indices: ")


@pytest.mark.parametrize(("name", "line"), [("gone.glb", "found no file"), ("notes.txt", "wanted a file of")])
def test_what_cannot_be_judged(
    tmp_path: Path, name: str, line: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "notes.txt").write_text("x")
    assert check.main([str(tmp_path / name)]) == 2
    out, err = capsys.readouterr()
    assert out == "" and line in err and err.count("\n") == 1


def test_without_node_it_says_what_is_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(check_gltf, "package_folders", lambda node: [])
    for suffix, status in ((".glb", 2), (".vrm", 0)):
        export(figure(), tmp_path / f"person{suffix}")
        assert check.main([str(tmp_path / f"person{suffix}")]) == status
    out, err = capsys.readouterr()
    assert "no judge of .glb is installed; run `npm install -g gltf-validator`" in err
    assert "Khronos' glTF validator: not installed" in out and "VRM 1.0's rules: nothing to say" in out


@pytest.mark.parametrize("suffix", [".usda", ".vrm", ".ply", ".stl", ".obj"])
def test_judges_never_raise_for_what_a_file_holds(tmp_path: Path, suffix: str) -> None:
    """Bytes changed at random: a verdict every time, good or bad."""
    path, random = tmp_path / f"person{suffix}", np.random.default_rng(0)
    export(person_or_tube(suffix), path)
    whole = np.frombuffer(path.read_bytes(), dtype=np.uint8)
    mesh = suffix in (".obj", ".ply", ".stl")
    judges = list(check.judges_of(path).values())[0 if mesh else -1 :]
    for _ in range(4 if mesh else 20):  # those have a process each
        changed = whole.copy()
        changed[random.integers(0, min(len(whole), 3000), 8)] = random.integers(0, 256, 8)
        path.write_bytes(changed.tobytes())
        assert all(isinstance(judge(path), list) for judge in judges)
    assert os.listdir(tmp_path)
