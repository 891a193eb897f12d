import numpy as np
import pytest
import torch
from shapes import BOX, PERSON_BOX, box, capsule, person, plate, sphere, torus, union

from assets.errors import BoundsError, GeometryError
from assets.isosurface.adaptive import LARGE, bends, crossed_twice, refine, trace_adaptively
from assets.isosurface.extract import ExtractConfig, trace
from assets.isosurface.follow import find_start, follow_surface
from assets.isosurface.grid import CornerValues, make_grid
from assets.mesh.clean import clean
from assets.mesh.surface import find_defects, label_components, volume

MANY, FEW = 10**9, 1  # faces to be left: all cells are halved, or none that need not be
FINE = ExtractConfig(resolution=128)


def euler(surface):
    return len(surface.vertices) - len(surface.faces) // 2


@pytest.mark.parametrize(
    ("sdf", "bounds"),
    [
        (sphere(0.61), BOX),
        (torus(), BOX),
        (union(sphere(0.3, (-0.5, 0, 0)), torus(0.2, 0.09)), BOX),
        (union(*(lambda p, y=y: plate(0.03)(p - torch.tensor([0.004, y, 0.007])) for y in (0, 0.06))), BOX),
        (person(), PERSON_BOX),
        (lambda points: person()(points).clamp(-0.02, 0.02), PERSON_BOX),
    ],
    ids=["sphere", "torus", "two pieces", "two sheets", "person", "clamped person"],
)
@pytest.mark.parametrize("faces", [FEW, 5000, MANY])
def test_the_surface_is_that_of_the_fine_grid(sdf, bounds, faces):
    exact = trace(sdf, bounds, FINE)
    found = trace_adaptively(sdf, bounds, FINE, faces)

    assert not find_defects(found.surface, components=1)
    assert label_components(found.surface)[0] == label_components(exact.surface)[0]
    assert euler(found.surface) == euler(exact.surface)
    assert volume(found.surface) == pytest.approx(volume(exact.surface), rel=1e-2)
    off = sdf(torch.from_numpy(found.surface.vertices.astype(np.float32))).abs()
    assert off.quantile(0.99) < 0.06 * exact.cell_size  # creases keep a little more
    assert len(found.surface.faces) < 1.05 * len(exact.surface.faces)


def test_where_it_is_flat_there_are_few_questions_and_faces():
    sdf, config = person(), ExtractConfig(resolution=512)
    exact = trace(sdf, PERSON_BOX, config)
    found = trace_adaptively(sdf, PERSON_BOX, config, 20_000)

    assert found.queries < 0.75 * exact.queries
    assert len(found.surface.faces) < 0.45 * len(exact.surface.faces)


def test_cells_are_halved_at_edges_alone():
    """A turned box: large cells stay on its sides."""
    turn = torch.linalg.qr(torch.randn(3, 3, generator=torch.Generator().manual_seed(0)))[0]
    grid = make_grid(BOX, 128, together=LARGE)
    values = CornerValues(box((0.5, 0.4, 0.6), turn), grid)
    large = follow_surface(values, find_start(values, FINE, LARGE).cells, LARGE)
    halved = large[bends(values, large, np.full(len(large), 0.2))]

    local = np.abs(grid.points(halved + LARGE / 2) @ turn.numpy()) - (0.5, 0.4, 0.6)
    from_edge = np.sort(np.abs(local), axis=1)[:, 1]
    assert len(halved) < 0.3 * len(large)
    assert from_edge.max() < 3 * LARGE * grid.cell_size


@pytest.mark.parametrize("thickness", [0.02, 0.03])
def test_a_sheet_thinner_than_a_large_cell_stays_whole(thickness):
    """One small cell and a half, or two."""
    config = ExtractConfig(resolution=128)
    sdf = union(plate(thickness), sphere(0.2))
    found = trace_adaptively(lambda p: sdf(p - 0.003), BOX, config, FEW).surface
    wanted = trace(lambda p: sdf(p - 0.003), BOX, config).surface
    assert volume(clean(found).surface) == pytest.approx(volume(clean(wanted).surface), rel=0.05)
    assert np.ptp(found.vertices, axis=0) == pytest.approx(np.ptp(wanted.vertices, axis=0), abs=0.02)


def test_a_sheet_between_the_corners_of_large_cells_is_followed():
    """It grows out of a ball, whose cells are halved; no corner of a large cell sees it."""
    cell = 2 / 128
    sheet = box((0.5, 0.5, 0.9 * cell))
    sdf = union(sphere(0.12), lambda p: sheet(p - torch.tensor([0.0, 0.0, cell])))
    values = CornerValues(sdf, make_grid(BOX, 128, together=LARGE))
    large = follow_surface(values, find_start(values, FINE, LARGE).cells, LARGE)
    assert np.abs(values.grid.points(large)).max() < 0.2

    found = trace_adaptively(sdf, BOX, FINE, 5000).surface
    assert np.ptp(found.vertices, axis=0)[:2] == pytest.approx([1, 1], abs=cell)
    assert not find_defects(found)


def test_no_edge_of_a_large_cell_that_is_left_is_crossed_twice():
    sdf = union(person(), plate(0.012))
    values = CornerValues(sdf, make_grid(BOX, 128, together=LARGE))
    large = follow_surface(values, find_start(values, FINE, LARGE).cells, LARGE)
    leaves = refine(values, large, bends(values, large, np.full(len(large), 0.4)))
    twice = values.grid.keys(crossed_twice(values, leaves.small))
    assert np.isin(twice, values.grid.keys(leaves.halved)).all()
    assert not np.isin(values.grid.keys(leaves.large), values.grid.keys(leaves.halved)).any()


@pytest.mark.parametrize("scale", [1e-3, 0.2, 5.0, 1e3])
def test_fields_that_are_no_distances(scale):
    found = trace_adaptively(lambda points: scale * torus()(points), BOX, FINE, 2000).surface
    assert not find_defects(found)
    assert torus()(torch.from_numpy(found.vertices.astype(np.float32))).abs().max() < 1e-3


def test_random_noise_is_closed_once_tidied():
    rng = np.random.default_rng(0)
    directions = torch.from_numpy(rng.normal(size=(3, 40)) * 12).float()
    phases = torch.from_numpy(rng.random(40) * 6)

    def noise(points):
        walls = points.abs().amax(dim=1) - 0.9
        return torch.maximum((torch.sin(points @ directions + phases).sum(dim=1) * 0.01), walls.double())

    found = trace_adaptively(noise, BOX, ExtractConfig(resolution=48, coarsest=48), 1000)
    assert not find_defects(clean(found.surface).surface)


@pytest.mark.parametrize("resolution", [4, 5, 33, 77])
def test_any_resolution_and_a_box_that_is_no_multiple_of_the_cell(resolution):
    bounds = np.array([[-0.9, -0.81, -0.7], [0.83, 0.79, 0.77]])
    config = ExtractConfig(resolution=resolution, coarsest=4)
    found = trace_adaptively(sphere(), bounds, config, 1000).surface
    assert not find_defects(found)
    assert volume(found) == pytest.approx(4 / 3 * np.pi * 0.6**3, rel=4 / resolution)


def test_a_surface_that_leaves_the_bounds():
    for faces in (FEW, MANY):
        with pytest.raises(BoundsError):
            trace_adaptively(capsule((0.0, 0.0, 0.0), (2.0, 0.0, 0.0), 0.2), BOX, FINE, faces)
    with pytest.raises(GeometryError, match="no surface"):
        trace_adaptively(sphere(0.2, (3, 0, 0)), BOX, FINE, FEW)


def test_the_same_field_gives_the_same_bytes():
    first, second = (trace_adaptively(person(), PERSON_BOX, FINE, 5000).surface for _ in range(2))
    assert first.vertices.tobytes() == second.vertices.tobytes()
    assert first.faces.tobytes() == second.faces.tobytes()
