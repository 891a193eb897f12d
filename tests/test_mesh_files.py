"""OBJ, PLY and STL read back by trimesh and by Blender: the same closed surface, its uv, its colours."""

import io
import os
import re
import subprocess
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pymeshlab
import pytest
import trimesh
from PIL import Image

from assets.asset.asset import Asset, PlainAsset
from avatargen.errors import InputError
from exporters import export, files_of, ply, stl
from exporters.encoding import Encoding
from exporters.weld import weld
from tests.tube import tube, welded
from tests.verdicts import JUDGES, blender_python

Z_UP = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])  # Blender's axes from ours
SUFFIXES = [".obj", ".ply", ".stl"]


def seamed(**shape) -> Asset:
    """The tube with the seam and both ends' fans welded by place, as assets are that were built."""
    return welded(tube(rings=24, **shape))


def plain(asset: PlainAsset) -> PlainAsset:
    return PlainAsset(**{part.name: getattr(asset, part.name) for part in fields(PlainAsset)})


def by_trimesh(asset: PlainAsset, path: Path) -> Any:
    export(asset, path)
    return trimesh.load_mesh(path, process=False, maintain_order=True)


def in_blender(asset: PlainAsset, path: Path) -> dict[str, np.ndarray]:
    export(asset, path)
    out = path.with_suffix(".npz")
    command = [str(blender_python()), str(JUDGES / "blender_mesh.py"), str(path), str(out)]
    run = subprocess.run(command, capture_output=True, text=True, timeout=240)
    assert run.returncode == 0, run.stdout + run.stderr
    with np.load(out) as arrays:
        return dict(arrays)


def colours_by_hand(asset: Asset) -> np.ndarray:
    """The texture's colour at each vertex before welding, by Pillow's own bilinear filter."""
    height, width = asset.texture.shape[:2]
    picture, found = Image.fromarray(asset.texture), []
    for x, y in asset.uv * [width, height]:
        x, y = np.clip([x, y], 0.5, [width - 0.5, height - 0.5])
        box = (1, 0, x - 0.5, 0, 1, y - 0.5)
        pixel = picture.transform((1, 1), Image.Transform.AFFINE, box, Image.Resampling.BILINEAR)
        found.append(pixel.getpixel((0, 0)))
    return np.array(found, dtype=float)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_the_surface_is_closed_and_the_same(tmp_path: Path, suffix: str) -> None:
    asset = seamed()
    mesh = by_trimesh(asset, tmp_path / f"tube{suffix}")

    corners = mesh.vertices[mesh.faces]
    np.testing.assert_allclose(corners, asset.vertices[asset.faces], atol=1e-7)
    normals = trimesh.Trimesh(asset.vertices, asset.faces, process=False).face_normals
    np.testing.assert_allclose(mesh.face_normals, normals, atol=1e-5)
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    assert mesh.is_volume
    assert mesh.euler_number == 2


def test_obj_closes_its_seams_by_itself(tmp_path: Path) -> None:
    """Read by hand: the places alone make a closed surface, and every corner keeps its own uv."""
    asset = seamed(size=48)
    path = tmp_path / "my tübe.obj"
    export(asset, path)
    rows = [line.split() for line in path.read_text().splitlines()]
    places, uv, normals = (
        np.array([row[1:] for row in rows if row[0] == keyword], dtype=np.float32)
        for keyword in ("v", "vt", "vn")
    )
    corners = np.array([[c.split("/") for c in row[1:]] for row in rows if row[0] == "f"], dtype=int) - 1

    assert trimesh.Trimesh(places, corners[..., 0], process=False).is_volume
    assert len(places) < len(asset.vertices)
    np.testing.assert_array_equal(places[corners[..., 0]], asset.vertices[asset.faces])
    np.testing.assert_allclose(uv[corners[..., 1]], asset.uv[asset.faces] * [1, -1] + [0, 1], atol=1e-7)
    np.testing.assert_allclose(np.linalg.norm(normals[corners[..., 2]], axis=-1), 1, atol=1e-5)
    _, library, texture, _ = files_of(path)
    assert ["mtllib", library.name] in rows
    assert f"map_Kd {texture.name}" in library.read_text().splitlines()
    with Image.open(texture) as picture:
        np.testing.assert_array_equal(np.asarray(picture), asset.texture)


def test_trimesh_finds_objs_texture(tmp_path: Path) -> None:
    asset = tube(size=48)
    mesh = by_trimesh(asset, tmp_path / "tube.obj")
    np.testing.assert_array_equal(np.asarray(mesh.visual.material.image.convert("RGB")), asset.texture)
    uv = asset.uv * [1, -1] + [0, 1]
    np.testing.assert_allclose(mesh.visual.uv[mesh.faces], uv[asset.faces], atol=1e-6)


def test_ply_colours_are_the_textures(tmp_path: Path) -> None:
    asset = seamed(size=48)
    mesh = by_trimesh(asset, tmp_path / "tube.ply")
    found = colours_by_hand(asset)
    number = weld(asset).number
    expected = np.array([found[number == vertex].mean(axis=0) for vertex in range(number.max() + 1)])

    assert len(mesh.vertices) == number.max() + 1
    assert mesh.is_volume  # closed as it is
    assert np.abs(mesh.visual.vertex_colors[:, :3] - expected).max() <= 2  # Pillow rounds on its way
    assert mesh.visual.vertex_colors[:, :3].std(axis=0).min() > 20


def test_colours_at_texel_centres_and_borders_are_exact() -> None:
    texture = np.arange(48, dtype=np.uint8).reshape(4, 4, 3)
    centres = (np.stack(np.meshgrid(*[np.arange(4)] * 2), axis=-1).reshape(-1, 2) + 0.5) / 4
    np.testing.assert_array_equal(ply.sample(texture, centres.astype(np.float32)), texture.reshape(-1, 3))
    corners = np.array([[0, 0], [1, 0], [0, 1], [1, 1]], dtype=np.float32)
    np.testing.assert_array_equal(ply.sample(texture, corners), texture[[0, 0, 3, 3], [0, 3, 0, 3]])


def test_stl_is_binary_with_unit_normals() -> None:
    asset = tube()
    flat = asset.faces.copy()
    flat[0] = flat[0, 0]  # a face without area
    data = stl.encode(replace(asset, faces=flat))
    triangles = np.frombuffer(data, dtype=np.dtype(stl.TRIANGLE), offset=84)

    assert not data.startswith(b"solid")
    assert int.from_bytes(data[80:84], "little") == len(asset.faces) == len(triangles)
    np.testing.assert_array_equal(triangles["normal"][0], 0)
    np.testing.assert_allclose(np.linalg.norm(triangles["normal"][1:], axis=1), 1, atol=1e-6)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_blender_reads_it(tmp_path: Path, suffix: str) -> None:
    asset = seamed(size=48)
    found = in_blender(asset, tmp_path / f"tube{suffix}")
    turned = Z_UP if suffix == ".obj" else np.eye(3)  # the one whose y Blender knows to be up
    corners = found["vertices"][found["faces"]]

    np.testing.assert_allclose(corners, asset.vertices[asset.faces] @ turned.T, atol=1e-5)
    if suffix == ".obj":
        np.testing.assert_allclose(
            found["uv"].reshape(-1, 3, 2), asset.uv[asset.faces] * [1, -1] + [0, 1], atol=1e-6
        )
        assert found["images"].tolist() == [[48, 48]]
        assert found["materials"] == 1
    if suffix == ".ply":
        colours = ply.vertex_colours(asset.texture, asset.uv, weld(asset).number)
        np.testing.assert_allclose(found["colours"][:, :3] * 255, colours, atol=1)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_plain_meshes_have_the_shape_alone(tmp_path: Path, suffix: str) -> None:
    mesh = by_trimesh(plain(seamed()), tmp_path / f"plain{suffix}")
    assert [file.name for file in tmp_path.iterdir()] == [f"plain{suffix}"]
    assert mesh.visual.kind is None
    mesh.merge_vertices(merge_norm=True)
    assert mesh.is_volume


# which some reader of OBJ takes apart, or Python keeps as bytes that are no UTF-8
HOSTILE_STEMS = ["my avatar", 'a"b', "a\\b", "-map", "a#b", "line\nbreak", "täst", os.fsdecode(b"caf\xe9")]


@pytest.mark.parametrize("stem", HOSTILE_STEMS)
def test_every_reader_finds_objs_texture(tmp_path: Path, stem: str) -> None:
    """By the letter of the formats, by trimesh and by MeshLab, which ends a name at its first space."""
    asset = seamed()
    export(asset, tmp_path / f"{stem}.obj")
    text = (tmp_path / f"{stem}.obj").read_text()
    (library,) = re.findall(r"^mtllib (\S+)$", text, re.MULTILINE)
    pictures = re.findall(
        r"^(?:map_Kd|norm) ([A-Za-z0-9._]\S*)$", (tmp_path / library).read_text(), re.MULTILINE
    )
    assert {f"{stem}.obj", library, *pictures} == {file.name for file in tmp_path.iterdir()}
    (tmp_path / f"{stem}.obj").rename(tmp_path / "person.obj")  # the readers' own names for files
    found: Any = trimesh.load_mesh(tmp_path / "person.obj")
    np.testing.assert_array_equal(np.asarray(found.visual.material.image.convert("RGB")), asset.texture)
    meshes: Any = pymeshlab.MeshSet()  # pyright: ignore
    meshes.load_new_mesh(str(tmp_path / "person.obj"))
    (picture,) = meshes.current_mesh().textures().values()
    assert (picture.width(), picture.height()) == asset.texture.shape[1::-1]


def test_names_that_are_alike_share_no_files(tmp_path: Path) -> None:
    files = [files_of(tmp_path / name) for name in ("my avatar.obj", "my_avatar.obj", "my#avatar.obj")]
    assert len({file for each in files for file in each}) == 3 * len(files[0])
    assert files[1][1].name == "my_avatar.mtl"  # what needs no other name keeps its own


def test_ply_header_names_where_it_comes_from() -> None:
    header = ply.encode(tube()).split(b"end_header\n")[0]
    assert b"comment avatargen 0.1.0, seed 3, weights 000" in header
    assert io.BytesIO(header).readline() == b"ply\n"


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_slicers_get_millimetres_standing_on_the_plate(tmp_path: Path, suffix: str) -> None:
    """Read back by trimesh: the same closed surface in millimetres, up along z, its front at -y."""
    asset = seamed()
    export(asset, tmp_path / f"tube{suffix}", Encoding(for_slicers=True))
    mesh: Any = trimesh.load_mesh(tmp_path / f"tube{suffix}", process=False, maintain_order=True)
    np.testing.assert_allclose(
        mesh.vertices[mesh.faces], 1000 * asset.vertices[asset.faces] @ Z_UP.T, atol=1e-4
    )
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    assert mesh.is_volume
    assert mesh.extents[2] == pytest.approx(1000.0, abs=1e-2) and mesh.bounds[0, 2] == pytest.approx(0)
    if suffix == ".stl":
        assert (tmp_path / "tube.stl").read_bytes()[:80].find(b"millimetres, z up") > 0
        assert stl.encode(asset)[:80].find(b"metres, y up") > 0


@pytest.mark.parametrize("suffix", [".glb", ".gltf", ".vrm", ".usda", ".usdc", ".usdz"])
def test_files_that_name_their_unit_stay_as_they_are(tmp_path: Path, suffix: str) -> None:
    with pytest.raises(InputError, match=r"in metres, which slicers ask for; write them \.stl"):
        export(seamed(), tmp_path / f"tube{suffix}", Encoding(for_slicers=True))
    assert list(tmp_path.iterdir()) == []
