import tracemalloc

import igl
import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation
from shapes import BOX, PERSON_BOX, capsule, person, plate, sphere, torus, union

from assets.errors import GeometryError
from assets.isosurface.extract import ExtractConfig, Extraction, extract, trace
from assets.isosurface.grid import CORNERS, make_grid
from assets.mesh.surface import find_defects, label_components, volume
from avatargen.errors import FieldError, InputError

SMALL_BLOB = sphere(0.05, (0.8, 0.8, 0.8))


def euler(surface):
    return len(surface.vertices) - len(surface.faces) // 2


def sorted_rows(vertices):
    rounded = np.round(vertices, 5)
    return vertices[np.lexsort(rounded.T)]


def dense_marching_cubes(sdf, resolution):
    grid = make_grid(BOX, resolution)
    z, y, x = np.meshgrid(*[np.arange(n + 1) for n in grid.shape[::-1]], indexing="ij")
    points = grid.points(np.stack([x, y, z], axis=-1).reshape(-1, 3))
    values = sdf(torch.from_numpy(points.astype(np.float32))).numpy().astype(np.float64)
    counts = [int(n) + 1 for n in grid.shape]
    vertices, faces = igl.marching_cubes(values, points, counts[0], counts[1], counts[2], 0.0)[:2]
    return np.asarray(vertices), np.asarray(faces)


@pytest.mark.parametrize(
    ("sdf", "holes"),
    [
        (sphere(0.61), 0),
        (torus(), 1),
        (union(sphere(0.3, (-0.5, 0, 0)), torus(0.2, 0.09)), None),
        (lambda points: (points.abs() - torch.tensor([0.41, 0.3, 0.55])).amax(dim=1), 0),
        (union(*(lambda p, y=y: plate(0.03)(p - torch.tensor([0.004, y, 0.007])) for y in (0, 0.06))), None),
        (person(), 0),
        (lambda points: person()(points).clamp(-0.02, 0.02), 0),
    ],
    ids=["sphere", "torus", "two pieces", "box", "two sheets", "person", "clamped person"],
)
def test_narrow_band_equals_the_dense_grid(sdf, holes):
    surface = extract(sdf, BOX, ExtractConfig(resolution=96, coarsest=12))

    vertices, faces = dense_marching_cubes(sdf, 96)
    assert len(surface.vertices) == len(vertices)
    assert np.abs(sorted_rows(surface.vertices) - sorted_rows(vertices)).max() < 1e-6
    assert euler(surface) == len(vertices) - len(faces) // 2
    if holes is not None:
        assert euler(surface) == 2 - 2 * holes


@pytest.mark.parametrize(
    ("sdf", "exact", "spread"),
    [
        (sphere(0.6), 4 / 3 * np.pi * 0.6**3, 0.6),
        (torus(0.6, 0.2), 2 * np.pi**2 * 0.6 * 0.2**2, 0.8),
        (capsule((0, -0.4, 0), (0, 0.4, 0), 0.2), np.pi * 0.2**2 * 0.8 + 4 / 3 * np.pi * 0.2**3, 0.6),
    ],
)
def test_closed_outward_exact_volume_and_bounds(sdf, exact, spread):
    surface = extract(sdf, BOX, ExtractConfig(resolution=128))

    assert not find_defects(surface)
    assert volume(surface) == pytest.approx(exact, rel=0.01)
    assert np.abs(surface.vertices).max() == pytest.approx(spread, abs=1e-3)


def crossing_corners(result: Extraction, box: np.ndarray) -> int:
    """How many corners the cells around the vertices' edges have: no search for the surface can ask fewer."""
    places = (result.surface.vertices - make_grid(box, ExtractConfig().resolution).low) / result.cell_size
    along = np.abs(places - np.rint(places)).argmax(axis=1)
    low = np.where(np.arange(3) == along[:, None], np.floor(places), np.rint(places)).astype(np.int64)
    cells = [low - offset for offset in CORNERS]
    around = np.concatenate([c[(low == c)[np.arange(len(low)), along]] for c in cells])
    corners = np.unique(around, axis=0)[:, None] + CORNERS
    return len(np.unique(corners.reshape(-1, 3), axis=0))


def test_few_questions_at_full_resolution():
    result = trace(person(), PERSON_BOX, ExtractConfig())

    assert result.cell_size == pytest.approx(2 / 512)
    assert result.queries < 1.2 * crossing_corners(result, PERSON_BOX)
    assert result.attempts == 1
    assert not find_defects(result.surface)


def test_a_clamped_field_is_not_searched_everywhere():
    """Two centimetres from the surface the field says nothing any more of how far it is."""
    shape = person()
    result = trace(lambda points: shape(points).clamp(-0.02, 0.02), PERSON_BOX, ExtractConfig())
    assert result.queries < 1.4 * crossing_corners(result, PERSON_BOX)


def peak_memory(resolution: int) -> int:
    """Bytes that numpy held at most while extracting the same person."""
    tracemalloc.start()
    trace(person(), PERSON_BOX, ExtractConfig(resolution=resolution))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak


def test_memory_grows_with_the_surface():
    assert peak_memory(384) < 5 * peak_memory(192)  # four times the surface, eight times the volume


def test_the_finest_resolution():
    result = trace(sphere(0.03), BOX, ExtractConfig(resolution=2048))
    assert not find_defects(result.surface)
    assert volume(result.surface) == pytest.approx(4 / 3 * np.pi * 0.03**3, rel=1e-3)


@pytest.mark.parametrize("resolution", [5, 33, 100, 77])
def test_any_resolution_and_a_box_that_is_no_multiple_of_the_cell(resolution):
    bounds = np.array([[-0.9, -0.81, -0.7], [0.83, 0.79, 0.77]])
    surface = extract(sphere(), bounds, ExtractConfig(resolution=resolution, coarsest=4))
    assert not find_defects(surface)
    assert volume(surface) == pytest.approx(4 / 3 * np.pi * 0.6**3, rel=4 / resolution)


def test_a_plate_thinner_than_the_coarse_cells_stays_whole():
    surface = extract(plate(0.02), BOX, ExtractConfig(resolution=256))
    assert not find_defects(surface)
    assert np.ptp(surface.vertices, axis=0) == pytest.approx([1, 0.02, 1], abs=2e-3)


def test_every_component_is_found():
    surface = extract(union(sphere(0.4), SMALL_BLOB), BOX, ExtractConfig(resolution=128))
    assert label_components(surface)[0] == 2


@pytest.mark.parametrize("scale", [0.2, 5.0])
def test_slope_is_estimated_for_fields_that_are_no_distances(scale):
    surface = extract(lambda points: scale * torus()(points), BOX, ExtractConfig(resolution=128))
    assert not find_defects(surface)
    assert euler(surface) == 0


def test_random_noise_gives_manifold_components():
    rng = np.random.default_rng(0)
    directions, phases = (
        torch.from_numpy(rng.normal(size=(3, 40)) * 12).float(),
        torch.from_numpy(rng.random(40) * 6),
    )

    def noise(points):
        walls = points.abs().amax(dim=1) - 0.9
        return torch.maximum((torch.sin(points @ directions + phases).sum(dim=1) * 0.01), walls.double())

    surface = extract(noise, BOX, ExtractConfig(resolution=48, coarsest=48))
    defects = find_defects(surface)
    assert (defects.bad_edges, defects.bad_vertices, defects.thin_faces) == (0, 0, 0)


def test_a_field_that_jumps_widens_the_band_or_says_so():
    def cliff(points):  # far from the surface it claims to be farther than it is
        distance = sphere(0.5)(points)
        return torch.where(distance.abs() > 0.01, distance * 40, distance)

    surface = extract(cliff, BOX, ExtractConfig(resolution=128))
    assert not find_defects(surface)
    with pytest.raises(GeometryError, match="lipschitz"):
        extract(cliff, BOX, ExtractConfig(resolution=128, lipschitz=0.001, attempts=2, audit=20_000))


def test_values_of_exactly_zero_make_no_flat_faces():
    box_on_the_grid = lambda points: points.abs().amax(dim=1) - 0.5  # noqa: E731
    surface = extract(box_on_the_grid, BOX, ExtractConfig(resolution=32, coarsest=8))
    assert not find_defects(surface)
    assert volume(surface) == pytest.approx(1, rel=0.03)  # marching cubes cuts edges and corners off


def test_same_input_same_arrays():
    first, second = (extract(person(), PERSON_BOX, ExtractConfig(resolution=100)) for _ in range(2))
    assert np.array_equal(first.vertices, second.vertices)
    assert np.array_equal(first.faces, second.faces)


@pytest.mark.parametrize(
    ("sdf", "error", "words"),
    [
        (lambda points: torch.ones(len(points)), GeometryError, "outside"),
        (lambda points: -torch.ones(len(points)), GeometryError, "inside"),
        (sphere(1.2), GeometryError, "touches the bounds"),
        (sphere(0.5, (0.8, 0, 0)), GeometryError, "touches the bounds"),
        (lambda points: sphere()(points) * float("nan"), FieldError, "NaN"),
        (
            lambda points: torch.where(points[:, 0] > 0.55, torch.inf, sphere()(points)),
            FieldError,
            "infinite",
        ),
        (lambda points: points, FieldError, "shape"),
    ],
)
def test_unusable_fields_are_named(sdf, error, words):
    with pytest.raises(error, match=words):
        extract(sdf, BOX, ExtractConfig(resolution=64, coarsest=16))


@pytest.mark.parametrize("bounds", [BOX[::-1].copy(), BOX * np.nan, BOX * 0])
def test_bounds_without_a_box(bounds):
    with pytest.raises(InputError, match="bounds"):
        extract(sphere(), bounds)


@pytest.mark.parametrize("values", [{"resolution": 1}, {"resolution": 100_000}, {"lipschitz": -1.0}])
def test_settings_out_of_range(values):
    with pytest.raises(InputError):
        ExtractConfig(**values)


def test_corner_order_goes_round_each_layer():
    assert (np.abs(np.diff(CORNERS[:4], axis=0)).sum(axis=1) == 1).all()
    assert np.array_equal(CORNERS[4:] - CORNERS[:4], [[0, 0, 1]] * 4)


# Topology where surfaces nearly touch. A part, of the solid or of the air, is thick from two cells on.


def ring(x: float, axis: int):
    """A torus of radii .4 and .1 about an axis, its middle at x."""
    across = [other for other in range(3) if other != axis]
    middle = torch.tensor([x, 0.0, 0.0])

    def field(points):
        from_middle = points - middle
        out = from_middle[:, across].norm(dim=1) - 0.4
        return torch.stack([out, from_middle[:, axis]], dim=1).norm(dim=1) - 0.1

    return field


def rings(apart: float):
    """Two rings whose tubes cross at the origin, their middles this far apart: linked in one piece below .2,
    two pieces above."""
    shift = 0.4 - apart / 2
    return union(ring(-shift, 1), ring(shift, 2))


def turned(field, seed: int):
    turn = torch.from_numpy(Rotation.random(rng=np.random.default_rng(seed)).as_matrix()).float()
    return lambda points: field(points @ turn)


def wedge(angle: float):
    """What lies between two planes that meet at the z axis."""
    return lambda points: points[:, 1].abs() * np.cos(angle / 2) - points[:, 0] * np.sin(angle / 2)


def pieces(surface) -> list[tuple[int, np.ndarray]]:
    """Euler number and vertices of each closed piece, the largest first."""
    assert find_defects(surface).bad_edges == find_defects(surface).bad_vertices == 0
    count, label = label_components(surface)
    vertices, faces = np.bincount(label), np.bincount(label[surface.faces[:, 0]])
    order = np.argsort(-vertices, kind="stable")
    return [(int(vertices[i] - faces[i] // 2), surface.vertices[label == i]) for i in order[:count]]


@pytest.mark.parametrize(("apart", "resolution"), [(0.18, 128), (0.18, 512), (0.19, 128), (0.2, 128)])
def test_tubes_that_cross_share_one_seam(apart, resolution):
    """No handles across the thin air beside the seam, and nothing stray where they only touch."""
    found = pieces(extract(rings(apart), BOX, ExtractConfig(resolution=resolution)))
    assert [euler for euler, _ in found] in ([[-2]] if apart < 0.2 else [[-2], [0, 0]])


@pytest.mark.parametrize("seed", range(6))
def test_thick_parts_keep_the_fields_topology(seed):
    """Tubes that overlap or stay apart, a sheet of solid and one of air, however they lie in the grid."""
    thick = 2 * 2 / 64  # metres
    config = ExtractConfig(resolution=64)
    for field, expected in (
        (rings(0.2 - thick), [-2]),
        (rings(0.2 + thick), [0, 0]),
        (plate(thick), [2]),
        (lambda p: torch.maximum(sphere(0.8)(p), -plate(thick)(p)), [2, 2]),
    ):
        found = pieces(extract(turned(field, seed), BOX, config))
        assert [euler for euler, _ in found] == expected


@pytest.mark.parametrize("angle", [0.6, 0.3])
@pytest.mark.parametrize("air", [False, True])
def test_thin_wedges_crumble_where_they_are_thin_alone(angle, air):
    """The solid wedge cut out of a ball, or the ball without it: one piece without handles, and crumbs where
    the wedge is thinner than two cells."""
    cell, sign = 2 / 64, -1 if air else 1
    shape = lambda p: torch.maximum(sphere(0.7)(p), sign * wedge(angle)(p))  # noqa: E731
    for seed in range(3):
        turn = Rotation.random(rng=np.random.default_rng(seed)).as_matrix()
        (euler, _), *crumbs = pieces(extract(turned(shape, seed), BOX, ExtractConfig(resolution=64)))
        assert euler == 2
        for _, vertices in crumbs:
            x = (vertices @ turn)[:, 0]
            assert 2 * x.min() * np.sin(angle / 2) < 2 * cell
