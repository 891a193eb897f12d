"""An asset as trimesh's mesh is what trimesh reads from the file, and closed once its seams are."""

import io
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import trimesh

from assets.asset.asset import Asset, PlainAsset
from exporters import glb
from tests.test_mesh_files import plain, seamed


def test_it_is_what_trimesh_reads_from_the_glb() -> None:
    asset = seamed(size=48)
    mesh: Any = asset.to_trimesh()
    scene = trimesh.load_scene(io.BytesIO(glb.encode(asset)), file_type="glb", process=False)
    read: Any
    (read,) = scene.geometry.values()
    np.testing.assert_array_equal(mesh.vertices, read.vertices)
    np.testing.assert_array_equal(mesh.faces, read.faces)
    np.testing.assert_allclose(mesh.visual.uv, read.visual.uv, atol=1e-6)
    texture = np.asarray(mesh.visual.material.baseColorTexture)
    np.testing.assert_array_equal(texture, asset.texture)
    np.testing.assert_array_equal(texture, np.asarray(read.visual.material.baseColorTexture.convert("RGB")))
    np.testing.assert_allclose(mesh.vertex_normals, asset.normals, atol=1e-6)


@pytest.mark.parametrize("make", [seamed, lambda: plain(seamed())], ids=["textured", "plain"])
def test_trimesh_finds_it_closed(make) -> None:
    mesh: Any = make().to_trimesh()
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    assert mesh.is_watertight and mesh.is_winding_consistent and mesh.is_volume
    assert mesh.euler_number == 2


def test_the_asset_is_not_touched_through_it() -> None:
    asset: Asset = replace(seamed(), occlusion=np.full((16, 16), 200, dtype=np.uint8))
    before: PlainAsset = replace(asset, vertices=asset.vertices.copy(), faces=asset.faces.copy())
    mesh: Any = asset.to_trimesh()
    mesh.apply_translation([1, 2, 3])
    mesh.invert()
    assert np.array_equal(asset.vertices, before.vertices) and np.array_equal(asset.faces, before.faces)
    assert np.asarray(mesh.visual.material.occlusionTexture).shape == (16, 16)
