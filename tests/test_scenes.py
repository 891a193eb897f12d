"""Scenes, content, tolerance and budget of avatar-export: chosen as measured, reported as it went."""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import torch
import trimesh

from assets import BuildConfig, choose, choose_settings
from assets.scenes import SCENES
from avatargen.avatar import shipped
from avatargen.commands.export import avatar_export
from avatargen.commands.export.options import parse
from avatargen.errors import InputError
from avatargen.export.one import Stopwatch

CURVES = {
    "field_us": 1.0,
    "surfaces": [
        {
            "resolution": 64,
            "faces": 500,
            "seconds": {"extract": 1.0, "simplify": 0.0, "atlas": 0.5},
            "p99_mm": 20.0,
        },
        {
            "resolution": 96,
            "faces": 2000,
            "seconds": {"extract": 2.0, "simplify": 0.0, "atlas": 1.0},
            "p99_mm": 4.9,
        },
        {
            "resolution": 128,
            "faces": 4000,
            "seconds": {"extract": 3.0, "simplify": 0.0, "atlas": 2.0},
            "p99_mm": 2.0,
        },
    ],
    "textures": [
        {"size": 32, "seconds": {"bake": 0.1, "encode": 0.1}, "bytes": 1000},
        {"size": 64, "seconds": {"bake": 0.4, "encode": 0.4}, "bytes": 4000},
    ],
}


@pytest.fixture
def curves(tmp_path, monkeypatch) -> None:
    """Made-up curves on a machine as fast as the bench's."""
    path = tmp_path / "curves.json"
    path.write_text(json.dumps(CURVES))
    monkeypatch.setattr("assets.choose.shipped", lambda name: path)
    monkeypatch.setattr(choose, "measure_speed", lambda avatar: 1.0)


def export(tmp_path: Path, *options: str) -> dict:
    """The report of an export that must succeed."""
    report = tmp_path / "report.json"
    arguments = ["--seed", "4", "--out", str(tmp_path / "person.glb"), "--report", str(report), *options]
    assert avatar_export.main(arguments) == 0
    return json.loads(report.read_text())


def test_every_scene_has_settings_that_its_format_holds() -> None:
    for name, scene in SCENES.items():
        request = parse(["--seed", "1", "--scene", name])
        assert (request.format, request.scene) == (scene.format, name)
        assert request.path_of(1) == Path(f"avatar_1.{scene.format}")
        names = ("content", "resolution", "faces", "texture", "normal_map", "joints")
        assert [getattr(request.build, each) for each in names] == [getattr(scene, each) for each in names]
        assert BuildConfig.for_scene(name) == request.build
    with pytest.raises(InputError, match="found scene 'opera', wanted one of hero"):
        BuildConfig.for_scene("opera")


def test_options_go_before_the_scene_and_the_format_limits_both() -> None:
    config = parse(["--seed", "1", "--scene", "hero", "--faces", "900", "--format", "stl"]).build
    assert (config.faces, config.resolution, config.content) == (900, SCENES["hero"].resolution, "mesh")
    assert config.normal_map is None  # STL holds none
    assert parse(["--seed", "1", "--scene", "hero", "--normal-map", "0"]).build.normal_map is None
    rigged = ["--seed", "1", "--scene", "print", "--format", "glb", "--content", "rigged"]
    assert parse(rigged).build.faces == 20_000


def test_the_shipped_curves_choose_finer_settings_for_smaller_errors() -> None:
    curves = choose.load_curves(shipped("curves.json"), None)
    choices = curves.choices(1024)
    errors = [choose.within_tolerance(choices, limit)[0].p99_mm for limit in (8.0, 2.0, 1.0)]
    assert errors == sorted(errors, reverse=True)
    least, most = choices[0].seconds, choices[-1].seconds
    found = [choose.within_budget(choices, 1.2 * s).p99_mm for s in (least, (least + most) / 2, most)]
    assert found == sorted(found, reverse=True)


def test_a_normal_map_takes_four_questions_a_texel(tmp_path) -> None:
    path = tmp_path / "curves.json"
    path.write_text(json.dumps(CURVES))
    found = choose.load_curves(path, None)
    with_map, without = (found.choices(64, size)[0].seconds for size in (1000, None))
    assert with_map - without == pytest.approx(4 * 0.6)  # seconds, at a microsecond a question


def test_ambient_occlusion_takes_six_questions_a_texel(tmp_path) -> None:
    path = tmp_path / "curves.json"
    path.write_text(json.dumps(CURVES))
    found = choose.load_curves(path, None)
    with_map, without = (found.choices(64, None, size)[0].seconds for size in (1000, None))
    assert with_map - without == pytest.approx(6 * 0.6)  # seconds, at a microsecond a question
    assert parse(["--seed", "1", "--ambient-occlusion", "512"]).build.ambient_occlusion == 512
    for options in ([], ["--ambient-occlusion", "0"]):
        assert parse(["--seed", "1", "--scene", "hero", *options]).build.ambient_occlusion is None


@pytest.mark.usefixtures("curves")
def test_a_statue_is_a_closed_mesh_and_nothing_else(tmp_path) -> None:
    path = tmp_path / "statue.stl"
    report = export(tmp_path, "--out", str(path), "--scene", "print", "--resolution", "64")
    mesh = trimesh.load(path)
    assert isinstance(mesh, trimesh.Trimesh)
    assert mesh.is_volume
    assert report["axes"] == "millimetres, z up"
    assert 500 < mesh.extents[2] < 3000 and mesh.extents[2] == mesh.extents.max()
    assert mesh.bounds[0, 2] == pytest.approx(0, abs=0.1)  # it stands on the plate
    assert len(mesh.faces) == report["faces"]
    assert not {"atlas", "bake", "simplify", "fit"} & set(report["seconds"])
    saved = {item["what"]: item for item in report["left_out"]}
    assert saved["colours"]["seconds_saved"] == pytest.approx(0.8)
    assert saved["colours"]["bytes_saved"] == 4000
    assert saved["texture coordinates"]["seconds_saved"] == 2.0


@pytest.mark.usefixtures("curves")
def test_a_tolerance_takes_the_cheapest_and_goes_on_until_it_is_kept(tmp_path) -> None:
    kept = export(tmp_path, "--tolerance", "25mm", "--texture", "32")
    assert kept["settings"]["faces"] == 500
    assert kept["fit"]["tries"] == 1
    assert kept["fit"]["predicted"]["p99_mm"] == 20.0
    assert kept["fit"]["achieved"]["p99_mm"] == kept["error_mm"]["p99"] <= 25
    missed = export(tmp_path, "--tolerance", "0.5mm", "--texture", "32")
    assert missed["settings"]["faces"] == 4000
    assert missed["fit"]["achieved"]["p99_mm"] > 0.5


@pytest.mark.usefixtures("curves")
def test_settings_are_chosen_in_python_as_by_the_command() -> None:
    near = choose_settings(tolerance_mm=25.0)
    assert (near.resolution, near.faces, near.texture) == (64, 500, BuildConfig().texture)
    crowd = replace(BuildConfig.for_scene("crowd"), texture=32)
    assert choose_settings(crowd, budget_s=4.0) == replace(crowd, resolution=96, faces=2000)
    for wish in ({}, {"tolerance_mm": 1.0, "budget_s": 4.0}):
        with pytest.raises(InputError, match="one of them"):
            choose_settings(**wish)  # pyright: ignore[reportArgumentType]


@pytest.mark.usefixtures("curves")
def test_a_budget_takes_the_best_that_has_room(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.setattr(Stopwatch, "total", lambda watch: 2.0)
    report = export(tmp_path, "--budget", "6s", "--texture", "32")
    assert report["settings"]["faces"] == 2000
    assert report["fit"]["predicted"]["seconds"] == pytest.approx(2.0 + 3.2)
    (tmp_path / "person.glb").unlink()
    assert avatar_export.main(["--seed", "4", "--budget", "3", "--out", str(tmp_path / "person.glb")]) == 2
    assert "budget" in capsys.readouterr().err
    assert not (tmp_path / "person.glb").exists()


def test_a_dry_run_says_the_plan_and_writes_nothing(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("avatargen.load_generator", None)  # it is not needed
    assert avatar_export.main(["--seed", "4", "--scene", "print", "--dry-run"]) == 0
    said = capsys.readouterr().out
    assert "stages: extract, clean, skin, measure, rest\n" in said
    assert "left out: colours" in said
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--tolerance=-1mm"], "positive"),
        (["--tolerance", "soon"], "positive"),
        (["--budget", "nan"], "positive"),
        (["--tolerance", "1mm", "--budget", "5s"], "alone"),
        (["--tolerance", "1mm", "--faces", "500"], "alone"),
        (["--scene", "opera"], "opera"),
        (["--format", "stl", "--content", "rigged"], "at most mesh"),
        (["--scene", "still", "--clip", "walk"], "skeleton"),
        (["--format", "ply", "--normal-map", "64"], "holds none"),
        (["--format", "obj", "--ambient-occlusion", "64"], "holds none"),
        (["--scene", "print", "--ambient-occlusion", "64"], "holds none"),
        (["--normal-map", "4"], "texture of 4"),
        (["--format", "vrm", "--texture-format", "webp"], "no webp"),
        (["--format", "usdz", "--compress", "quantize"], "rounded"),
        (["--seeds", "1:3", "--out", "many", "--budget", "9s"], "one seed"),
    ],
)
def test_wishes_that_make_no_sense(options, words, tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    seed = [] if "--seeds" in options else ["--seed", "4"]
    assert avatar_export.main([*seed, *options]) == 2
    said = capsys.readouterr().err
    assert words in said
    assert said.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_speed_is_told_by_one_thread_as_in_the_bench() -> None:
    """A budget that counted on more threads for all of the work was overdrawn by a sixth."""
    seen = set()

    class Person:
        body = SimpleNamespace(vertices=np.zeros((8, 3)))

        def sdf(self, points: torch.Tensor) -> torch.Tensor:
            seen.add(torch.get_num_threads())
            return points[:, 0]

    before = torch.get_num_threads()
    torch.set_num_threads(2)
    try:
        assert choose.measure_speed(Person()) > 0
        assert torch.get_num_threads() == 2
    finally:
        torch.set_num_threads(before)
    assert seen == {1}
