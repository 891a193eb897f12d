import numpy as np
import pytest
import torch
from shapes import icosphere
from test_atlas import parts_of, small_person

from assets.mesh.measure import sample_surface
from assets.mesh.surface import face_areas, opposite_edges
from assets.texture.atlas import AtlasConfig, plain_atlas, unwrap, uv_areas
from assets.texture.bake import BakeConfig, bake_texture
from assets.texture.raster import rasterise
from avatargen.errors import FieldError, InputError


def linear(points):
    return 0.5 + points @ torch.tensor([[0.3, 0.1, 0.0], [0.0, 0.3, -0.2], [0.1, 0.0, 0.3]])


def bilinear(texture, uv):
    """What a graphics card reads at uv with linear filtering and clamped edges."""
    size = len(texture)
    place = np.clip(uv.astype(np.float64) * size - 0.5, 0, size - 1)
    low = np.minimum(np.floor(place).astype(int), size - 2)
    t = place - low
    total = 0.0
    for dx in (0, 1):
        for dy in (0, 1):
            share = np.where(dx, t[:, 0], 1 - t[:, 0]) * np.where(dy, t[:, 1], 1 - t[:, 1])
            total = total + share[:, None] * texture[low[:, 1] + dy, low[:, 0] + dx]
    return total


@pytest.mark.parametrize(("shape", "size"), [("sphere", 256), ("sphere", 300), ("person", 512)])
@pytest.mark.parametrize("kind", ["charts", "plain"])
def test_filtered_texture_gives_a_linear_colour_back(shape, size, kind):
    surface = icosphere(0.8, rounds=3) if shape == "sphere" else small_person()
    make = unwrap if kind == "charts" else lambda *args: plain_atlas(*args, reason="wanted")
    atlas = make(surface, parts_of(surface), AtlasConfig(texture_size=size))
    texture = bake_texture(surface, atlas, linear, BakeConfig(texture_size=size)).texels

    assert texture.shape == (size, size, 3)
    face, barycentric = sample_surface(surface, 20_000, seed=0)
    uv = np.einsum("nc,ncd->nd", barycentric, atlas.uv[atlas.faces[face]])
    points = np.einsum("nc,ncd->nd", barycentric, surface.vertices[surface.faces[face]])
    wanted = 255 * linear(torch.from_numpy(points.astype(np.float32))).numpy()
    error = np.abs(bilinear(texture, uv) - wanted).max(axis=1)
    limit = 2 if kind == "charts" else 6  # faces alone are a few texels wide
    assert np.quantile(error, 0.999) < limit


def test_no_texel_is_left_unset():
    surface = icosphere(0.8, rounds=2)
    atlas = unwrap(surface, parts_of(surface), AtlasConfig(texture_size=128))
    red = lambda points: torch.tensor([1.0, 0.5, 0.25]).expand(len(points), 3)  # noqa: E731
    texture = bake_texture(surface, atlas, red, BakeConfig(texture_size=128))
    assert (texture.texels == [255, 128, 64]).all()
    assert 0.3 < texture.coverage < 1


def test_row_zero_is_the_top():
    surface = icosphere(0.8, rounds=3)
    atlas = unwrap(surface, parts_of(surface), AtlasConfig(texture_size=128))
    asked = []

    def watch(points):
        asked.append(points)
        return linear(points)

    texture = bake_texture(surface, atlas, watch, BakeConfig(texture_size=128)).texels
    face = atlas.faces[np.argmin(atlas.uv[atlas.faces].mean(axis=1)[:, 1])]  # nearest the top
    u, v = atlas.uv[face].mean(axis=0)
    point = surface.vertices[atlas.vertex_map[face]].mean(axis=0)
    wanted = 255 * linear(torch.from_numpy(point[None].astype(np.float32))).numpy()[0]
    assert v < 0.5
    assert np.abs(texture[int(v * 128), int(u * 128)] - wanted).max() < 6


def to_linear(srgb):
    """Light, which can be averaged, of sRGB values in 0..1 (IEC 61966-2-1)."""
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def to_srgb(linear):
    """The inverse of `to_linear`."""
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def smaller(texture, level):
    """The texture as a graphics card makes it smaller: light, averaged over squares."""
    light = to_linear(texture / 255.0)
    for _ in range(level):
        half = len(light) // 2
        light = light.reshape(half, 2, half, 2, 3).mean(axis=(1, 3))
    return light


def both_sides(surface, atlas, count=4):
    """Texture coordinates of the same places as seen from both sides of the atlas's seams."""
    twin = opposite_edges(surface.faces, len(surface.vertices))
    edge = np.flatnonzero(np.arange(len(twin)) < twin)
    corner = atlas.faces.reshape(-1)
    ahead = np.arange(len(corner)).reshape(-1, 3)[:, [1, 2, 0]].reshape(-1)
    ends = [corner[edge], corner[ahead[edge]], corner[ahead[twin[edge]]], corner[twin[edge]]]
    start, end, other_start, other_end = (atlas.uv[each].astype(np.float64) for each in ends)
    split = (ends[0] != ends[2]) | (ends[1] != ends[3])
    along = ((np.arange(count) + 0.5) / count)[:, None]
    return [
        (a[split, None] * (1 - along) + b[split, None] * along).reshape(-1, 2)
        for a, b in ((start, end), (other_start, other_end))
    ]


@pytest.mark.parametrize("level", [0, 1, 2, 3])
def test_no_seam_shows_when_the_texture_is_made_smaller(level):
    """Along both sides of every seam the colour is the same, but for what the field itself changes by over
    the texels that filtering mixes."""
    surface, size = small_person(), 1024
    atlas = unwrap(surface, parts_of(surface), AtlasConfig(texture_size=size))
    light = smaller(bake_texture(surface, atlas, linear, BakeConfig(texture_size=size)).texels, level)
    here, there = (255 * to_srgb(bilinear(light, uv)) for uv in both_sides(surface, atlas))
    assert len(here) > 500
    texel = np.sqrt(face_areas(surface).sum() / np.abs(uv_areas(atlas)).sum()) / size * 2**level  # metres
    changes = 255 * 0.36 * texel  # `linear` rises by .36 a metre at most
    off = np.abs(here - there).max(axis=1)
    assert np.quantile(off, 0.99) < 1 + 2 * changes


def test_colours_out_of_range_are_clipped_and_nan_is_named():
    surface = icosphere(0.8, rounds=1)
    atlas = unwrap(surface, parts_of(surface), AtlasConfig(texture_size=64))
    config = BakeConfig(texture_size=64)
    assert bake_texture(surface, atlas, lambda points: linear(points) * 0 + 7, config).texels.min() == 255
    with pytest.raises(FieldError, match="NaN"):
        bake_texture(surface, atlas, lambda points: linear(points) * torch.nan, config)


def test_rasterising_equals_asking_each_pixel():
    rng = np.random.default_rng(0)
    triangles = rng.random((40, 3, 2)) * 50 - 5
    found = set()
    for fragments in rasterise(triangles, 40, 30):
        assert fragments.barycentric.sum(axis=1) == pytest.approx(1)
        found |= set(zip(fragments.triangle.tolist(), fragments.pixel.tolist(), strict=True))
    wanted = set()
    for t, (a, b, c) in enumerate(triangles):
        turn = np.sign(np.cross(np.append(b - a, 0), np.append(c - a, 0))[2])
        for y in range(30):
            for x in range(40):
                p = np.array([x + 0.5, y + 0.5])
                sides = [
                    turn * ((q - o)[0] * (p - o)[1] - (q - o)[1] * (p - o)[0])
                    for o, q in ((a, b), (b, c), (c, a))
                ]
                if min(sides) >= 0:
                    wanted.add((t, y * 40 + x))
    assert found == wanted


@pytest.mark.parametrize("values", [{"texture_size": 4}, {"texture_size": 20_000}])
def test_settings_out_of_range(values):
    with pytest.raises(InputError):
        BakeConfig(**values)
