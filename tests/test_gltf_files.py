"""glTF in several files says what the .glb says, finds its files, and passes Khronos' validator."""

import json
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
import pygltflib
import pytest
import trimesh

from exporters import export, glb
from tests.figure import figure
from tests.tube import tube
from tests.verdicts import khronos_issues


@pytest.mark.parametrize("name", ["person.gltf", "100% ü #1 person?.gltf"])
def test_files_are_found_whatever_their_names_and_flawless(tmp_path: Path, name: str) -> None:
    export(figure(), tmp_path / name)
    document = json.loads((tmp_path / name).read_text())
    named = [document["buffers"][0]["uri"], document["images"][0]["uri"]]

    assert {unquote(uri) for uri in named} == {f"{name[:-5]}.bin", f"{name[:-5]}_base_color.png"}
    assert all("/" not in uri and " " not in uri for uri in named)
    assert khronos_issues(tmp_path / name)["messages"] == []


def test_it_is_the_glb_with_its_picture_outside(tmp_path: Path) -> None:
    asset = tube(joint_count=3, tilt=0.4)
    export(asset, tmp_path / "tube.gltf")
    apart = json.loads((tmp_path / "tube.gltf").read_text())
    whole: Any = pygltflib.GLTF2.load_from_bytes(glb.encode(asset))
    together = json.loads(whole.to_json())

    for part in set(together) - {"buffers", "bufferViews", "images"}:
        assert apart[part] == together[part], part
    assert set(apart) == set(together)
    assert apart["bufferViews"] == together["bufferViews"][:-1]  # the last is the picture's
    data = (tmp_path / "tube.bin").read_bytes()
    assert whole.binary_blob()[: len(data)] == data


def test_trimesh_reads_it_back(tmp_path: Path) -> None:
    asset = tube()
    export(asset, tmp_path / "tube.gltf")
    meshes: list[Any] = trimesh.load_scene(tmp_path / "tube.gltf", process=False).dump()
    (mesh,) = meshes
    np.testing.assert_allclose(mesh.vertices, asset.vertices)
    np.testing.assert_array_equal(mesh.faces, asset.faces)
    np.testing.assert_array_equal(np.asarray(mesh.visual.material.baseColorTexture)[..., :3], asset.texture)
