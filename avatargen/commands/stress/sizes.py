"""Stress of the whole pipeline: very few and very many faces, texels and joints, on the default body."""

import numpy as np

from assets.asset.asset import Asset, PlainAsset, TexturedAsset
from assets.build_config import BuildConfig
from assets.mesh.surface import Surface, find_defects
from assets.pipeline import build_content
from assets.texture.atlas import AtlasConfig, unwrap
from assets.texture.bake import BakeConfig, bake_texture
from avatargen.commands.stress.case import Case, require
from avatargen.commands.stress.figure import Figure, default_figure, figure, with_joints
from avatargen.errors import InputError
from exporters.glb import encode


def built(person: Figure, config: BuildConfig) -> str:
    """An asset, closed under its seams, that encodes."""
    asset = build_content(person, config)
    require(isinstance(asset, PlainAsset) and asset.welded is not None, "no asset")
    assert asset.welded is not None
    vertices = np.zeros((asset.welded.max() + 1, 3))
    vertices[asset.welded] = asset.vertices
    defects = find_defects(Surface(vertices=vertices, faces=asset.welded[asset.faces]))
    require(defects.bad_edges == 0 and defects.extra_components == 0, f"the mesh has {defects}")
    size = len(encode(asset)) / 1e6
    texture = f", texture {len(asset.texture)}" if isinstance(asset, TexturedAsset) else ""
    joints = f", {len(asset.skeleton.parents)} joints" if isinstance(asset, Asset) else ""
    return f"closed, {len(asset.faces):,} faces{texture}{joints}, {size:.1f} MB"


def faces(count: int, resolution: int) -> str:
    said = built(default_figure(), BuildConfig(content="mesh", faces=count, resolution=resolution))
    found = int(said.split(", ", 1)[1].split(" faces")[0].replace(",", ""))
    require(abs(found - count) <= max(0.02 * count, 2), f"{found} faces")
    return said


def large_texture(size: int) -> str:
    """A large texture over a simple mesh, coloured by a cheap field: the memory of baking."""
    corners = np.stack(np.meshgrid(*3 * [np.arange(2.0)], indexing="ij"), axis=-1).reshape(-1, 3)
    sides = np.array(
        [
            *([0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]),
            *([2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]),
        ]
    )
    surface = Surface(vertices=corners, faces=sides)
    atlas = unwrap(surface, np.zeros(len(sides), dtype=np.int64), AtlasConfig(texture_size=size))
    texture = bake_texture(surface, atlas, lambda points: points.clamp(0, 1), BakeConfig(texture_size=size))
    require(texture.texels.shape == (size, size, 3), f"the texture has shape {texture.texels.shape}")
    require(texture.coverage > 0.3, f"only {100 * texture.coverage:.0f} % of texels are used")
    return f"{size} x {size}, {100 * texture.coverage:.0f} % of texels used"


def cases() -> list[Case]:
    """The smallest and the largest of everything."""
    small = BuildConfig(resolution=96, faces=2000, texture=128)
    return [
        Case(name="50 faces", expected="closed, 49 to 52 faces", check=lambda: faces(50, 128)),
        Case(
            name="500,000 faces",
            expected="closed, within 2 % of the number",
            check=lambda: faces(500_000, 640),
            seconds=120.0,
            slow=True,
        ),
        Case(
            name="more faces than the resolution has",
            expected="closed, all there are",
            check=lambda: built(default_figure(), BuildConfig(resolution=48, faces=200_000, texture=64)),
        ),
        Case(
            name="4 faces of a body",
            expected="closed, or an error that asks for more faces",
            check=lambda: built(default_figure(), BuildConfig(content="mesh", resolution=64, faces=4)),
        ),
        Case(
            name="texture of 16",
            expected="an asset",
            check=lambda: built(default_figure(), BuildConfig(resolution=96, faces=2000, texture=16)),
        ),
        Case(
            name="texture of 8192",
            expected="baked within 4 GB",
            check=lambda: large_texture(8192),
            seconds=120.0,
            megabytes=4000.0,
            slow=True,
        ),
        Case(
            name="texture of 15",
            expected="InputError: ... 16 to 16384 ...",
            check=lambda: built(default_figure(), BuildConfig(texture=15)),
            error=(InputError, "16 to 16384"),
        ),
        Case(
            name="body of 1 joint",
            expected="an asset with a skeleton of one joint",
            check=lambda: built(figure(with_joints(1)), small),
        ),
        Case(
            name="body of 300 joints",
            expected="an asset with 300 joints",
            check=lambda: built(figure(with_joints(300)), small),
        ),
        Case(
            name="built with betas +5",
            expected="an asset",
            check=lambda: built(figure(with_joints(24), 5.0), small),
        ),
    ]
