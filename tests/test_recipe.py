"""Every mesher with every simplifier keeps the same promises; the usual recipe is what it says, not ours."""

import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np
import pytest
import torch
from shapes import BOX, PERSON_BOX, icosphere, person, sphere, torus, union
from skimage.measure import marching_cubes
from test_pipeline import SMALL, Stranger, report_of, stranger, welded_surface

from assets import BuildConfig, build
from assets.build_config import MESHERS
from assets.choose import choose_settings
from assets.draft import open_draft
from assets.errors import GeometryError
from assets.isosurface import volume
from assets.isosurface.extract import ExtractConfig, trace
from assets.isosurface.grid import make_grid
from assets.isosurface.volume import march_volume
from assets.mesh.importance import Importance
from assets.mesh.surface import Surface, euler_number, find_defects
from assets.mesh.surface import volume as enclosed
from assets.pipeline import plan_for
from assets.simplify import simplify as simplifying
from assets.simplify.simplify import SIMPLIFIERS, SimplifyConfig, simplify
from avatargen.errors import InputError

RECIPES = list(product(MESHERS, SIMPLIFIERS))
Field = Callable[[torch.Tensor], torch.Tensor]


@dataclass(frozen=True)
class Shape(Stranger):
    """Another field in place of the stranger's."""

    field: Field | None = None
    box: Any = None

    @property
    def bounds(self):
        return self.box

    def sdf(self, points):
        assert self.field is not None
        return self.field(points)


def surface_of(field: Field, box: np.ndarray, **settings: Any) -> Surface:
    """The surface as the stages up to the texture leave it."""
    avatar = Shape(**vars(stranger()), field=field, box=box)
    config = BuildConfig(content="mesh", **settings)
    with open_draft(avatar, config, charts=False) as draft:
        for stage in plan_for(config).stages:
            if stage.name in ("extract", "clean", "simplify", "fit"):
                stage.run(draft)
    return draft.surface


SHAPES = {
    "sphere": (sphere(), BOX, 0, 4 / 3 * np.pi * 0.6**3),
    "torus": (torus(), BOX, 1, 2 * np.pi**2 * 0.6 * 0.2**2),
    "two pieces": (union(sphere(0.5), sphere(0.05, (0.8, 0.8, 0.8))), BOX, 0, 4 / 3 * np.pi * 0.5**3),
    "person": (person(), PERSON_BOX, 0, None),
}


@pytest.mark.parametrize(("mesher", "simplifier"), RECIPES)
@pytest.mark.parametrize("name", SHAPES)
def test_every_recipe_keeps_the_promises(name: str, mesher: str, simplifier: str) -> None:
    """Closed, manifold, outward, one piece; as many faces as asked for; the shape's handles and volume."""
    field, box, handles, size = SHAPES[name]
    for faces in (300, 2000):
        surface = surface_of(field, box, resolution=64, faces=faces, mesher=mesher, simplifier=simplifier)
        assert not find_defects(surface)
        assert abs(len(surface.faces) - faces) <= 0.02 * faces
        assert euler_number(surface) == 2 - 2 * handles
        if size is not None:
            assert enclosed(surface) == pytest.approx(size, rel=0.04 if faces == 300 else 0.015)


@pytest.mark.parametrize(("mesher", "simplifier"), RECIPES)
def test_every_recipe_makes_a_rigged_asset(mesher: str, simplifier: str) -> None:
    """With four influences a vertex, near the field, and a report that says what was not done."""
    asset = build(stranger(), replace(SMALL, resolution=96, mesher=mesher, simplifier=simplifier))
    assert not find_defects(welded_surface(asset))
    assert euler_number(welded_surface(asset)) == 2
    assert abs(len(asset.faces) - 2000) <= 40
    assert asset.joints.shape[1] == asset.weights.shape[1] == 4
    assert np.abs(asset.weights.sum(axis=1) - 1).max() < 1e-5
    report = report_of(asset)
    assert report.error.mean_mm < 1.5
    ours = simplifier == "adaptive"
    assert ("fit" in dict(report.seconds)) == ours
    assert ("laying on the field" in {item.what for item in report.left_out}) != ours


def dense_grid(field: Field, resolution: int) -> Surface:
    """scikit-image's marching cubes on the field at every corner of the grid."""
    grid = make_grid(BOX, resolution)
    corners = np.stack(np.meshgrid(*[np.arange(n + 1) for n in grid.shape], indexing="ij"), axis=-1)
    points = torch.from_numpy(grid.points(corners.reshape(-1, 3)).astype(np.float32))
    values = field(points).numpy().reshape(corners.shape[:3]) / grid.cell_size
    found: Any = marching_cubes(values, 0.0)
    return Surface(vertices=grid.points(found[0].astype(np.float64)), faces=found[1].astype(np.int64))


@pytest.mark.parametrize("field", [sphere(0.61), torus(), person()], ids=["sphere", "torus", "person"])
def test_the_volume_gives_the_whole_grids_surface(field: Field) -> None:
    found = trace(field, BOX, ExtractConfig(resolution=64), march_volume).surface
    wanted = dense_grid(field, 64)
    assert not find_defects(found)
    assert np.array_equal(found.faces, wanted.faces)
    assert np.abs(found.vertices - wanted.vertices).max() < 0.01 * 2 / 64  # of a cell, where edges graze it


def test_corners_on_the_zero_level_leave_no_flat_faces() -> None:
    """A box whose sides lie on the grid's own planes, and a field that is zero at many corners."""
    for half in (0.5, 0.5 + 1e-9):
        flat = trace(
            lambda points, half=half: points.abs().amax(dim=1) - half,
            BOX,
            ExtractConfig(resolution=32),
            march_volume,
        ).surface
        assert not find_defects(flat)
        assert enclosed(flat) == pytest.approx(1, rel=0.03)  # edges are cut


def test_noise_is_closed_in_every_cell() -> None:
    """Every case of the table: independent values at all corners."""
    noise = torch.from_numpy(np.random.default_rng(0).normal(size=(17, 17, 17)).astype(np.float32))
    noise[[0, -1]] = noise[:, [0, -1]] = noise[:, :, [0, -1]] = 1

    def field(points: torch.Tensor) -> torch.Tensor:
        place = ((points + 1) * 8).round().long().clamp(0, 16)
        return noise[tuple(place.T)] / 8

    # the band sees coarse cells alone, so all of them are fine
    found = trace(field, BOX, ExtractConfig(resolution=16, coarsest=16, seeds=16), march_volume).surface
    defects = find_defects(found)
    assert (defects.bad_edges, defects.bad_vertices, defects.thin_faces, defects.inward) == (0, 0, 0, 0)


def test_a_volume_too_large_is_refused_before_it_is_made(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(volume, "LARGEST_VOLUME", 10_000)
    with pytest.raises(InputError, match=r"33 x 33 x 33 .* choose the adaptive mesher"):
        trace(sphere(), BOX, ExtractConfig(resolution=32), march_volume)


@pytest.mark.parametrize("simplifier", SIMPLIFIERS)
def test_what_no_way_keeps_closed_is_refused(simplifier: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    def torn(surface: Surface, target: int, _: Importance) -> list[Surface]:
        return [Surface(vertices=surface.vertices, faces=surface.faces[:target])]

    monkeypatch.setitem(simplifying.CANDIDATES, simplifier, torn)
    wanted = "ask for more faces$" if simplifier == "adaptive" else "choose the adaptive simplifier$"
    with pytest.raises(GeometryError, match=wanted):
        simplify(icosphere(), SimplifyConfig(target_faces=100, simplifier=simplifier))


def test_a_way_that_keeps_the_handles_goes_first(monkeypatch: pytest.MonkeyPatch) -> None:
    dense = surface_of(torus(), BOX, resolution=48, faces=2000)
    ball, ring = icosphere(rounds=2), simplify(dense, SimplifyConfig(target_faces=320))
    monkeypatch.setitem(simplifying.CANDIDATES, "pymeshlab", lambda surface, target, weight: [ball, ring])
    assert simplify(dense, SimplifyConfig(target_faces=320, simplifier="pymeshlab")) is ring
    monkeypatch.setitem(simplifying.CANDIDATES, "pymeshlab", lambda surface, target, weight: [ball])
    assert simplify(dense, SimplifyConfig(target_faces=320, simplifier="pymeshlab")) is ball


def test_a_change_of_topology_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    """Handles that a simplifier closes are named, not passed over."""
    ball = icosphere(0.6, rounds=3)
    monkeypatch.setitem(simplifying.CANDIDATES, "fast-simplification", lambda surface, target, weight: [ball])
    body = stranger()
    low, high = body.body.vertices.min(axis=0), body.body.vertices.max(axis=0)
    assert (high - low).min() > 0  # the ring stands for a person: skinned by the nearest bones
    avatar = Shape(**vars(body), field=torus(), box=BOX)
    config = replace(SMALL, resolution=48, faces=1280, content="mesh", simplifier="fast-simplification")
    asset = build_mesh(avatar, config)
    said = {item.what: item.why for item in report_of(asset).left_out}
    assert said["handles where layers touch"] == "fast-simplification left 0 handles of 1"


def build_mesh(avatar: Shape, config: BuildConfig) -> Any:
    from assets import build_content

    return build_content(avatar, config)


@pytest.mark.parametrize("recipe", [{"mesher": "marching-cubes"}, {"simplifier": "pymeshlab"}])
def test_curves_do_not_speak_for_other_recipes(recipe: dict[str, Any]) -> None:
    with pytest.raises(InputError, match="leave the recipe out"):
        choose_settings(BuildConfig(**recipe), tolerance_mm=1.0)


WRONG = """
from assets import BuildConfig
from avatargen.errors import InputError
every_face = {"faces": None, "content": "mesh"}
for wrong in ({"mesher": "dual"}, {"simplifier": "vtk"}, {"simplifier": "pymeshlab", **every_face}):
    try:
        BuildConfig(**wrong)
    except InputError as error:
        print(error)
"""


def test_recipes_there_are_not() -> None:
    """In a process of its own, without the hints' check, as users run it."""
    run = subprocess.run([sys.executable, "-c", WRONG], capture_output=True, text=True, timeout=300)
    assert run.stdout.splitlines() == [
        "mesher: found 'dual', wanted one of adaptive, marching-cubes",
        "simplifier: found 'vtk', wanted one of adaptive, pymeshlab, fast-simplification",
        "found simplifier pymeshlab where every face is kept; give a number of faces, or leave it out",
    ]


DEFAULT_EXPORT = """
import sys
from avatargen.commands.export.avatar_export import main
assert main(["--seed", "4", "--resolution", "64", "--faces", "500", "--texture", "32", *sys.argv[1:]]) == 0
print(*sorted({"pymeshlab", "trimesh", "fast_simplification", "skimage"} & set(sys.modules)))
"""


@pytest.mark.parametrize(
    ("options", "loaded"),
    [
        ([], []),
        (["--simplifier", "pymeshlab"], ["pymeshlab"]),
        (
            ["--mesher", "marching-cubes", "--simplifier", "fast-simplification"],
            ["fast_simplification", "skimage"],
        ),
    ],
)
def test_a_default_export_loads_nobody_elses_recipe(tmp_path, options: list[str], loaded: list[str]) -> None:
    """pymeshlab is under the GPL: who does not ask for it does not run it."""
    command = [sys.executable, "-c", DEFAULT_EXPORT, "--out", str(tmp_path / "person.glb"), *options]
    run = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert run.returncode == 0, run.stderr
    assert run.stdout.splitlines()[-1].split() == loaded
