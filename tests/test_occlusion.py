"""Ambient occlusion: white where nothing is near, and as dark as by hand where something is."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from shapes import icosphere, sphere, union
from test_atlas import parts_of

from assets.asset.levels import with_levels
from assets.asset.posed import posed
from assets.errors import GeometryError
from assets.mesh.surface import Surface
from assets.picture.paint import painted
from assets.texture.atlas import Atlas, AtlasConfig, unwrap
from assets.texture.bake import BakeConfig, map_texels
from assets.texture.occlusion import HEIGHTS, STRENGTH, bake_occlusion, distance_to, openness
from avatargen.errors import FieldError, InputError
from exporters import encode, export, find_format
from tests.figure import figure
from tests.tube import mapped, tube, welded

RADIUS, SIZE = 0.6, 256
CONFIG = BakeConfig(texture_size=SIZE)
H = np.array(HEIGHTS)


def charts(surface: Surface) -> Atlas:
    return unwrap(surface, parts_of(surface), AtlasConfig(texture_size=SIZE))


def darkened(distance: np.ndarray) -> np.ndarray:
    """The formula by hand, for distances [N, heights]."""
    return 1 - STRENGTH * np.clip((H - distance) / H, 0, 1).mean(axis=1)


@pytest.mark.parametrize("off", [0.0, 0.01, -0.01])
def test_a_sphere_is_white_to_the_last_texel_wherever_its_field_has_it(off: float) -> None:
    surface = icosphere(RADIUS, rounds=5)
    found = bake_occlusion(surface, charts(surface), sphere(RADIUS + off), CONFIG)
    assert found.shape == (SIZE, SIZE)
    assert found.dtype == np.uint8
    assert found.min() >= 254


@pytest.mark.parametrize("gap", [0.005, 0.03, 0.1, 0.4])
def test_between_two_spheres_it_is_as_dark_as_by_hand(gap: float) -> None:
    both = union(sphere(RADIUS), sphere(RADIUS, centre=(2 * RADIUS + gap, 0, 0)))
    points = np.array([[RADIUS, 0, 0], [-RADIUS, 0, 0]])
    found = openness(both, points, points / RADIUS)
    facing = darkened(np.minimum(H, gap - H)[None])[0]
    assert found == pytest.approx([facing, 1], abs=1e-4)
    assert (facing < 1) == (gap < 2 * H[-1])


def test_a_corner_of_two_planes_darkens_towards_its_crease() -> None:
    x = np.linspace(0, 0.2, 101)
    corner = lambda points: points[:, :2].min(dim=1).values  # noqa: E731
    points = np.stack([x, 0 * x, 0 * x], axis=1)
    found = openness(corner, points, np.broadcast_to([0.0, 1, 0], points.shape))
    assert found == pytest.approx(darkened(np.minimum(x[:, None], H)), abs=1e-4)
    assert (np.diff(found) >= 0).all()
    assert found[0] == pytest.approx(1 - STRENGTH, abs=1e-6)
    assert found[x >= H[-1]].min() == pytest.approx(1, abs=1e-6)


def test_texels_have_the_openness_of_their_own_places() -> None:
    """A wall beside a sphere: every texel that filtering reads, by hand, within the mesh's own roughness."""
    surface, wall = icosphere(RADIUS, rounds=5), RADIUS + 0.03
    atlas = charts(surface)
    found = bake_occlusion(surface, atlas, union(sphere(RADIUS), lambda p: wall - p[:, 0]), CONFIG)
    texel_map = map_texels(atlas, SIZE)
    places = texel_map.points(surface, texel_map.asked)
    outward = places / np.linalg.norm(places, axis=1, keepdims=True)
    to_wall = wall - (places[:, :1] + H * outward[:, :1])
    by_hand = 255 * darkened(np.minimum(H, to_wall))
    off = np.abs(found.reshape(-1)[texel_map.asked] - by_hand)
    assert by_hand.min() < 130
    assert off.max() < 4


def test_distances_to_a_mesh_are_signed_and_exact() -> None:
    surface = icosphere(RADIUS, rounds=5)
    points = torch.from_numpy(np.random.default_rng(0).uniform(-1, 1, (2000, 3)).astype(np.float32))
    assert (distance_to(surface)(points) - sphere(RADIUS)(points)).abs().max() < 5e-4


def test_a_field_that_is_no_number_is_refused() -> None:
    surface = icosphere(RADIUS, rounds=2)
    with pytest.raises(FieldError, match="NaN"):
        bake_occlusion(surface, charts(surface), lambda points: points[:, 0] * torch.nan, CONFIG)


@pytest.mark.parametrize(
    "texels",
    [np.zeros((4, 8), np.uint8), np.zeros((4, 4, 3), np.uint8), np.zeros((4, 4)), np.zeros((0, 0), np.uint8)],
)
def test_an_asset_wants_a_square_of_bytes(texels: np.ndarray) -> None:
    asset = tube()
    object.__setattr__(asset, "occlusion", texels)  # past the hints' own check
    with pytest.raises(GeometryError, match="square of uint8"):
        type(asset).__post_init__(asset)


def test_it_stays_with_levels_and_poses_and_goes_with_the_texture() -> None:
    asset = welded(mapped(tube(rings=24)))
    assert asset.occlusion is not None
    for kept in (with_levels(asset, (400,)), posed(asset, np.full((2, 3), 0.1))):
        assert kept.occlusion is not None
        assert np.array_equal(kept.occlusion, asset.occlusion)
    assert painted(asset, np.zeros(len(asset.vertices))).occlusion is None


@pytest.mark.parametrize("suffix", [".gltf", ".usda", ".usdc"])
def test_a_picture_has_its_own_name_with_or_without_a_normal_map(suffix: str) -> None:
    for asset, kinds in (
        (figure(), ("base_color", "normal", "occlusion")),
        (replace(figure(), normal_map=None), ("base_color", "occlusion")),
    ):
        files = {path.name: data for path, data in encode(asset, f"person{suffix}")}
        assert {name for name in files if name.endswith(".png")} == {f"person_{kind}.png" for kind in kinds}
        assert suffix == ".usdc" or b"person_occlusion.png" in files[f"person{suffix}"]


def test_formats_without_a_place_for_it_leave_it_out(tmp_path) -> None:
    for suffix in (".obj", ".ply", ".stl"):
        assert "occlusion" not in find_format(f"a{suffix}").maps
        export(figure(), tmp_path / f"person{suffix}")
    assert not list(tmp_path.glob("*occlusion*"))


def test_a_mesh_alone_cannot_have_it() -> None:
    from assets import BuildConfig

    with pytest.raises(InputError, match="ambient occlusion"):
        BuildConfig(content="mesh", ambient_occlusion=64)
    with pytest.raises(InputError, match="texture of 4"):
        BuildConfig(ambient_occlusion=4)
