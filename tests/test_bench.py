"""The bench measures what it says: checked on shapes whose errors are known, then run end to end, small."""

import json

import numpy as np
import pytest
import torch
from shapes import BOX, icosphere, sphere

from assets.choose import Choice, within_budget, within_tolerance
from assets.mesh.surface import Surface, smallest_angles
from assets.texture.atlas import Atlas
from avatargen.avatar import load_single
from avatargen.commands.bench import run as bench
from avatargen.commands.bench.cost import measured
from avatargen.commands.bench.peer import with_cheap_distance, with_libigl
from avatargen.commands.bench.plot import front
from avatargen.commands.bench.truth import (
    Match,
    Truth,
    find_truth,
    match,
    normal_errors,
    sample,
    texture_psnr,
)
from avatargen.errors import InputError
from avatargen.shipped import shipped


def steep_ball(points: torch.Tensor) -> torch.Tensor:
    return 3 * sphere(0.6)(points)  # a field need not have slope 1


def true_ball(resolution: int, count: int) -> Truth:
    """Points of a sphere that is coloured by place."""
    return find_truth(steep_ball, lambda points: 0.5 + 0.4 * points, BOX, resolution, count)


def test_true_points_lie_on_the_zero_level_with_its_normals() -> None:
    truth = true_ball(64, 2000)
    assert len(truth.points) == 2000
    radius = np.linalg.norm(truth.points, axis=1, keepdims=True)
    assert np.abs(radius - 0.6).max() < 2e-6
    assert np.abs(truth.normals - truth.points / radius).max() < 1e-3
    assert np.abs(truth.colors - (0.5 + 0.4 * truth.points)).max() < 1e-6


def test_distances_and_normals_are_those_of_a_larger_sphere() -> None:
    truth = true_ball(64, 2000)
    larger = icosphere(0.61, rounds=5)
    found = match(truth, larger)
    assert np.abs(found.distance - 0.01).max() < 5e-4
    errors = normal_errors(truth, larger, found)
    assert errors.max() < 0.5
    tilted = Surface(vertices=larger.vertices * [1.0, 0.5, 1.0], faces=larger.faces)
    assert normal_errors(truth, tilted, match(truth, tilted)).max() > 20


def test_the_noise_of_a_texture_is_that_of_its_colours() -> None:
    texels = np.zeros((8, 8, 3), dtype=np.uint8)
    texels[:, :, 0] = 255 * np.arange(8) // 7
    assert sample(texels, np.array([[0.5, 0.5]]))[0, 0] == pytest.approx((109 + 145) / 2 / 255, abs=1e-9)
    assert sample(texels, np.array([[0.0, 0.3], [1.0, 0.9]]))[:, 0].tolist() == [0, 1]
    atlas = Atlas(
        vertex_map=np.arange(3),
        uv=np.full((3, 2), 0.5, dtype=np.float32),
        faces=np.array([[0, 1, 2]]),
    )
    truth = true_ball(32, 50)
    found = Match(
        distance=np.zeros(50), face=np.zeros(50, dtype=np.int64), barycentric=np.full((50, 3), 1 / 3)
    )
    flat = np.full((8, 8, 3), 51, dtype=np.uint8)
    wanted = -10 * np.log10(((0.2 - truth.colors) ** 2).mean())
    assert texture_psnr(truth, atlas, flat, found) == pytest.approx(wanted)


def test_the_cost_of_work_is_seen() -> None:
    with measured() as cost:
        block = np.ones(25_000_000)
        total = block.sum()
        del block
    assert total == 25_000_000
    assert 180 < cost.peak_mb < 300
    assert cost.seconds > 0


def test_smallest_angles() -> None:
    surface = Surface(
        vertices=np.array([[0.0, 0, 0], [1, 0, 0], [0.5, np.sqrt(0.75), 0], [0, 1, 0], [2, 0, 0]]),
        faces=np.array([[0, 1, 2], [0, 1, 3], [0, 1, 4]]),
    )
    assert smallest_angles(surface) == pytest.approx([60, 45, 0])


def test_nothing_beats_the_front_and_the_front_beats_the_rest() -> None:
    points = [tuple(pair) for pair in np.random.default_rng(0).random((60, 2)).tolist()]
    best = front(points)
    for x, y in points:
        beaten = any(a <= x and b <= y and (a, b) != (x, y) for a, b in points)
        assert ((x, y) in best) == (not beaten)


def choice(seconds: float, p99_mm: float) -> Choice:
    return Choice(resolution=128, faces=1000, seconds=seconds, p99_mm=p99_mm)


def test_settings_are_chosen_by_what_was_measured() -> None:
    measured = [(1.0, 3.0), (2.0, 0.9), (3.0, 1.1), (4.0, 0.4), (5.0, 0.6), (6.0, 0.1)]
    choices = [choice(seconds, error) for seconds, error in measured]
    assert [c.seconds for c in within_tolerance(choices, 1.0)] == [2, 4, 6]
    assert [c.seconds for c in within_tolerance(choices, 0.01)] == [6]
    assert within_budget(choices, 5.0).seconds == 4
    assert within_budget(choices, 60.0).seconds == 6
    with pytest.raises(InputError, match="budget"):
        within_budget(choices, 1.0)


def test_libigls_tree_gives_the_same_distance_and_the_cheap_one_another() -> None:
    avatar = load_single(shipped("generator.safetensors")).sample(3)
    points = torch.from_numpy(np.random.default_rng(5).uniform(*avatar.bounds, size=(2000, 3)))
    exact = avatar.sdf(points)
    assert (with_libigl(avatar).sdf(points) - exact).abs().max() < 1e-5
    off = (with_cheap_distance(avatar).sdf(points) - exact).abs()
    assert 1e-5 < off.median() < 5e-3


def test_the_command_writes_tables_a_plot_and_curves(tmp_path, monkeypatch, capsys) -> None:
    small = bench.Grid(
        resolutions=(48, 64),
        faces=(500, 1000),
        textures=(32, 64),
        neighbours=(1, 2),
        steps=(4, 8),
        truth=80,
        points=500,
        default=(64, 500),
        peer=(48, 500, 32),
        ours=(64, 500, 32),
    )
    monkeypatch.setattr(bench, "QUICK", small)
    monkeypatch.setattr("avatargen.commands.bench.sweep.RAYS", 12)
    monkeypatch.setattr("avatargen.commands.bench.sweep.REFERENCE_STEPS", 64)
    assert bench.main(["--out", str(tmp_path / "new"), "--quick", "--seeds", "4"]) == 0
    out = tmp_path / "new"
    assert capsys.readouterr().out.splitlines()[-1] == str(out / "bench.md")
    facts = json.loads((out / "bench.json").read_text())
    assert [
        len(facts[name]) for name in ("surfaces", "textures", "mapping", "rays", "comparison", "recipes")
    ] == [*(4, 2, 2, 2, 4, 6)]
    recipes = facts["recipes"]
    assert len({(row["mesher"], row["simplifier"]) for row in recipes}) == 6
    assert all(row["defects"] == "" and row["seconds"] > 0 and row["peak_mb"] >= 0 for row in recipes)
    assert recipes[0]["mean_mm"] < 1.05 * min(row["mean_mm"] for row in recipes)
    coarse, fine = facts["surfaces"][0], facts["surfaces"][-1]
    assert fine["mean_mm"] < coarse["mean_mm"]
    assert all(row["closed"] for row in facts["surfaces"])
    assert facts["rays"][0]["psnr_db"] < facts["rays"][1]["psnr_db"]
    assert facts["comparison"][0]["back_mean_mm"] < facts["comparison"][1]["back_mean_mm"]
    curve = json.loads((out / "curves.json").read_text())
    assert curve["field_us"] > 0
    assert len(curve["surfaces"]) == 4
    assert (out / "bench.png").read_bytes()[:4] == b"\x89PNG"
    assert (out / "bench.md").read_text().count("\n| ---") == 6


def test_the_scenes_are_measured(tmp_path) -> None:
    assert bench.main(["--out", str(tmp_path), "--quick", "--scenes", "--seeds", "4"]) == 0
    (row,) = json.loads((tmp_path / "scenes.json").read_text())
    assert row["scene"] == "crowd"
    assert row["left_out"][:3] == ["normal map", "ambient occlusion", "fingers' joints"]
    assert abs(row["faces"] - 2000) <= 40
    assert "| crowd | one of hundreds" in (tmp_path / "scenes.md").read_text()


def test_charts_are_measured_both_ways(tmp_path) -> None:
    assert bench.main(["--out", str(tmp_path), "--quick", "--charts", "--seeds", "4"]) == 0
    ours, alone = json.loads((tmp_path / "charts.json").read_text())
    assert (ours["way"], alone["way"]) == ("seams of clothes", "xatlas alone")
    assert ours["unguided"] == ""
    assert ours["islands"] < alone["islands"] / 3
    assert ours["used"] > 1.2 * alone["used"]
    assert (tmp_path / "charts.md").read_text().count("| 4 |") == 2
