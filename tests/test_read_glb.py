"""Files that were written are read back as they were; damaged and foreign ones are refused by name."""

import dataclasses
import io
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from assets.asset.asset import Asset, PlainAsset, TexturedAsset
from avatargen.errors import InputError
from exporters import export, glb
from exporters.encoding import Encoding
from exporters.read_glb import read_glb
from tests.tube import mapped, tube
from tests.verdicts import khronos_issues


def altered(change: Any, data: bytes = b"") -> bytes:
    """A file, if none is given the tube's, with its description changed by a function."""
    data = data or glb.encode(tube())
    size = struct.unpack_from("<I", data, 12)[0]
    description = json.loads(data[20 : 20 + size])
    change(description)
    text = json.dumps(description).encode()
    text += b" " * (-len(text) % 4)
    rest = data[20 + size :]
    return struct.pack("<4sIIII", b"glTF", 2, 20 + len(text) + len(rest), len(text), 0x4E4F534A) + text + rest


@pytest.mark.parametrize("tilt", [0.0, 0.4])
def test_what_is_written_is_read_back(tmp_path: Path, tilt: float):
    asset = tube(joint_count=3, tilt=tilt)
    export(asset, tmp_path / "a.glb")
    again = read_glb(tmp_path / "a.glb")
    for name in ("vertices", "uv", "faces", "joints", "texture"):
        assert np.array_equal(getattr(again, name), getattr(asset, name)), name
    for name in ("normals", "weights"):
        assert getattr(again, name) == pytest.approx(getattr(asset, name), abs=1e-6), name
    assert again.info == asset.info
    assert isinstance(again, Asset)
    assert again.skeleton.joint_names == asset.skeleton.joint_names
    assert again.skeleton.T_world_joint == pytest.approx(asset.skeleton.T_world_joint, abs=1e-6)
    again_bytes = glb.encode(dataclasses.replace(again, normals=asset.normals, weights=asset.weights))
    assert len(again_bytes) == len(glb.encode(asset))


def test_occlusion_is_read_back_with_and_without_a_normal_map(tmp_path: Path):
    for asset in (mapped(tube()), dataclasses.replace(mapped(tube()), normal_map=None)):
        export(asset, tmp_path / "a.glb")
        again = read_glb(tmp_path / "a.glb")
        assert isinstance(again, Asset)
        assert again.occlusion is not None
        assert asset.occlusion is not None
        assert np.array_equal(again.occlusion, asset.occlusion)
        assert (again.normal_map is None) == (asset.normal_map is None)
        assert khronos_issues(tmp_path / "a.glb")["messages"] == []


def test_a_texture_of_16_bits_is_scaled(tmp_path: Path):
    grey = np.linspace(0, 65535, 64).round().astype(np.uint16).reshape(8, 8)
    stream = io.BytesIO()
    Image.fromarray(grey).save(stream, "png")
    picture = stream.getvalue() + b"\0" * (-len(stream.getvalue()) % 4)
    data = glb.encode(tube())
    size = struct.unpack_from("<I", data, 12)[0]
    held = len(data) - 20 - size - 8

    def change(description: Any) -> None:
        description["bufferViews"].append({"buffer": 0, "byteOffset": held, "byteLength": len(picture)})
        description["buffers"][0]["byteLength"] = held + len(picture)
        description["images"][0]["bufferView"] = len(description["bufferViews"]) - 1

    data = bytearray(data + picture)
    struct.pack_into("<I", data, 20 + size, held + len(picture))
    struct.pack_into("<I", data, 8, len(data))
    (tmp_path / "a.glb").write_bytes(altered(change, bytes(data)))
    again = read_glb(tmp_path / "a.glb")
    assert isinstance(again, TexturedAsset)
    assert np.array_equal(again.texture, np.rint(grey / 257).astype(np.uint8)[..., None].repeat(3, axis=2))


@pytest.mark.parametrize("kind", [PlainAsset, TexturedAsset])
def test_files_of_less_are_read_as_less(tmp_path: Path, kind: type):
    asset = tube()
    less = kind(**{field.name: getattr(asset, field.name) for field in dataclasses.fields(kind)})
    (tmp_path / "a.glb").write_bytes(glb.encode(less))
    again = read_glb(tmp_path / "a.glb")
    assert type(again) is kind
    assert np.array_equal(again.faces, asset.faces)


def unrounded(asset: Any, name: str) -> float:
    """How far rounding may take a part of the asset."""
    edge = np.ptp(asset.vertices, axis=0).max()
    rigged = isinstance(asset, Asset)
    return {
        "vertices": 0 if rigged else 0.51 * edge / 65534 + 1e-7,
        "normals": 1 / 127,
        "uv": 0.51 / 65535,
        "weights": 2 / 65535,
    }[name]


@pytest.mark.parametrize("kind", [PlainAsset, TexturedAsset, Asset])
def test_rounded_files_are_read_within_their_rounding(tmp_path: Path, kind: type):
    whole = mapped(tube(joint_count=3, tilt=0.4))
    asset = kind(**{field.name: getattr(whole, field.name) for field in dataclasses.fields(kind)})
    export(asset, tmp_path / "a.glb", Encoding(quantize=True))
    again = read_glb(tmp_path / "a.glb")
    assert type(again) is kind
    assert np.array_equal(again.faces, asset.faces)
    for name in ("vertices", "normals", "uv", "weights"):
        if hasattr(asset, name):
            off = np.abs(getattr(again, name).astype(np.float64) - getattr(asset, name)).max()
            assert off <= unrounded(asset, name), name
    if isinstance(again, TexturedAsset):
        assert again.normal_map is not None
        assert np.abs(again.normal_map.tangents - asset.normal_map.tangents).max() <= 1 / 127
    assert np.linalg.norm(again.normals, axis=1) == pytest.approx(1, abs=1e-6)


def test_whole_numbers_that_are_no_shares_are_themselves(tmp_path: Path):
    """As other programs round: steps of a length that the node says."""
    asset = tube()
    plain = PlainAsset(**{field.name: getattr(asset, field.name) for field in dataclasses.fields(PlainAsset)})
    export(plain, tmp_path / "a.glb", Encoding(quantize=True))

    def plainly(found: dict[str, Any]) -> None:
        del found["accessors"][found["meshes"][0]["primitives"][0]["attributes"]["POSITION"]]["normalized"]
        found["nodes"][0]["scale"] = [s / 32767 for s in found["nodes"][0]["scale"]]

    (tmp_path / "b.glb").write_bytes(altered(plainly, (tmp_path / "a.glb").read_bytes()))
    first, second = (read_glb(tmp_path / name).vertices for name in ("a.glb", "b.glb"))
    assert second == pytest.approx(first, abs=1e-6)


def test_joints_that_come_before_their_parents_are_sorted(tmp_path: Path):
    def turn_around(found: dict[str, Any]) -> None:
        skin = found["skins"][0]
        skin["joints"] = skin["joints"][::-1]

    (tmp_path / "a.glb").write_bytes(altered(turn_around))
    again = read_glb(tmp_path / "a.glb")
    assert isinstance(again, Asset)
    assert again.skeleton.joint_names == ("pelvis", "spine1")
    assert again.skeleton.parents.tolist() == [-1, 0]
    assert np.array_equal(again.joints, 1 - tube().joints)  # the file's numbers name the joints the other way


def set_in(*path: Any, to: Any) -> Any:
    def change(found: Any) -> None:
        for step in path[:-1]:
            found = found[step]
        found[path[-1]] = to

    return change


def stand_alone(**transform: Any) -> Any:
    """The mesh's node without its skin, transformed."""

    def change(found: Any) -> None:
        node = next(node for node in found["nodes"] if "mesh" in node)
        del node["skin"]
        node.update(transform)

    return change


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (set_in("extensionsRequired", to=["KHR_draco_mesh_compression"]), "KHR_draco_mesh_compression"),
        (set_in("nodes", 2, to={}), "no mesh"),
        (set_in("meshes", 0, "primitives", 0, "mode", to=1), "no triangles"),
        (stand_alone(scale=[1, 2, 1]), "unevenly"),
        (stand_alone(scale=[0, 0, 0]), "unevenly"),
        (stand_alone(translation=[0, 0]), "no place"),
        (set_in("accessors", 0, "count", to=10**12), "beyond its buffer"),
        (set_in("accessors", 0, "count", to=-1), "no index or count"),
        (set_in("accessors", 0, "sparse", to={}), "sparse"),
        (set_in("bufferViews", 0, "byteLength", to=10**9), "beyond its buffer"),
        (set_in("bufferViews", 0, "byteStride", to=0), "overlaps itself"),
        (set_in("skins", 0, "joints", to=[]), "0 joints"),
        (set_in("nodes", 1, "children", to=[0]), "deeper than any skeleton"),
        (set_in("materials", to=[]), "IndexError"),
        (set_in("accessors", to={}), "KeyError"),
    ],
)
def test_damaged_files_are_refused(tmp_path: Path, change: Any, reason: str):
    (tmp_path / "a.glb").write_bytes(altered(change))
    with pytest.raises(InputError, match=reason):
        read_glb(tmp_path / "a.glb")


def test_cut_missing_and_foreign_files_are_refused(tmp_path: Path):
    whole = glb.encode(tube())
    for data in (b"", b"glTF", whole[:-1], whole[:100], b"PK" + whole[2:], whole + b"x"):
        (tmp_path / "a.glb").write_bytes(data)
        with pytest.raises(InputError, match="export it again"):
            read_glb(tmp_path / "a.glb")
    with pytest.raises(InputError, match="cannot read"):
        read_glb(tmp_path / "none.glb")
