"""Read back a .glb as `avatar-export` writes it: one mesh, with a texture and a skeleton where it has them,
or a person's parts.

Every number in the file is checked against what is really stored before it is used, so a forged file costs
neither memory nor time. Letters: W vertices, F faces, J joints, S texels along a side.
"""

import io
import json
import struct
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float32, Int64, UInt8
from PIL import Image, UnidentifiedImageError

from assets.asset.asset import Asset, AssetInfo, PlainAsset, TexturedAsset
from assets.asset.posed import world_rotations
from assets.asset.rig import Skeleton
from assets.texture.normal_map import NormalMap
from avatargen.body.pose import named_pose
from avatargen.eight_bits import eight_bits
from avatargen.errors import InputError
from exporters.glb import WEBP
from exporters.quantize import EXTENSION as QUANTIZED
from exporters.read_morphs import read_morphs

READABLE = {WEBP, QUANTIZED}
MOST_BYTES = 1 << 29
MOST_TEXELS = 8192  # along a side
MOST_JOINTS = 1000
TYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
JSON_CHUNK, BINARY_CHUNK = 0x4E4F534A, 0x004E4942
DAMAGE = (
    KeyError,
    IndexError,
    TypeError,
    ValueError,
    AttributeError,
    OverflowError,
    RecursionError,
    struct.error,
)


@dataclass(frozen=True, kw_only=True)
class Document:
    """The file's description and its one buffer."""

    description: Any
    buffer: bytes

    def array(self, accessor: Any) -> np.ndarray:
        """The numbers of an accessor, [count, width], as they are stored."""
        found = self.accessor(accessor)
        if "sparse" in found:
            raise ValueError("an accessor is sparse")
        return self.stored(found)

    def accessor(self, number: Any) -> Any:
        """What the file says of an accessor."""
        return item(self.description["accessors"], number)

    def stored(self, found: Any) -> np.ndarray:
        """The numbers that an accessor, or a part of a sparse one, describes, [count, width]."""
        dtype, width = np.dtype(TYPES[found["componentType"]]), WIDTHS[found["type"]]
        view = self.view(found["bufferView"])
        stride = item(self.description["bufferViews"], found["bufferView"]).get(
            "byteStride", dtype.itemsize * width
        )
        count, start = whole(found["count"]), whole(found.get("byteOffset", 0))
        if count < 1 or whole(stride) < dtype.itemsize * width:
            raise ValueError("an accessor is empty or overlaps itself")
        if start + (count - 1) * stride + dtype.itemsize * width > len(view):
            raise ValueError("an accessor reaches beyond its buffer")
        return np.ndarray(
            (count, width), dtype=dtype, buffer=view, offset=start, strides=(stride, dtype.itemsize)
        ).copy()

    def numbers(self, accessor: Any, width: int) -> np.ndarray:
        """Real numbers, float32 [count, width]; whole ones marked as normalized are shares of the largest."""
        stored = columns(self.array(accessor), width)
        real = stored.astype(np.float32)
        if stored.dtype.kind == "f" or not item(self.description["accessors"], accessor).get("normalized"):
            return real
        return np.maximum(real / np.iinfo(stored.dtype).max, -1)

    def directions(self, accessor: Any, width: int) -> np.ndarray:
        """Unit vectors; a sign in a fourth column stays. Rounded ones are brought back to length 1."""
        vectors = self.numbers(accessor, width)
        if self.array(accessor).dtype.kind != "f":
            length = np.linalg.norm(vectors[:, :3], axis=1, keepdims=True)
            vectors[:, :3] /= np.maximum(length, 1e-9)
        return vectors

    def view(self, number: Any) -> bytes:
        """The bytes of a buffer view."""
        found = item(self.description["bufferViews"], number)
        start, length = whole(found.get("byteOffset", 0)), whole(found["byteLength"])
        if found.get("buffer", 0) != 0 or start + length > len(self.buffer):
            raise ValueError("a buffer view reaches beyond its buffer")
        return self.buffer[start : start + length]


def read_glb(path: str | Path, rest: str = "a") -> PlainAsset:
    """What a .glb file holds: its first mesh, as an `Asset` if that has a skin, with its pictures if any; or
    its parts, if it is of a person who was built in parts.

    A file does not say in which pose it rests: `rest` is the pose's name.

    Raises:
        InputError: no such file, not a whole .glb, compressed, or without a mesh of triangles.
        GeometryError: its parts do not fit.
    """
    path = Path(path)
    try:
        if path.stat().st_size > MOST_BYTES:
            raise InputError(f"glb: {path} is larger than {MOST_BYTES >> 20} MB; give a smaller file")
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"glb: cannot read {path}: {error.strerror or error}; check the path") from error
    try:
        return read_asset(parse(data), rest)
    except InputError:
        raise
    except DAMAGE as error:
        reason = f"{error}" if isinstance(error, ValueError) else f"{type(error).__name__} {error}"
        raise InputError(f"glb: {path} holds no mesh that can be read ({reason}); export it again") from error


def parse(data: bytes) -> Document:
    """The chunks of a .glb file."""
    magic, version, length = struct.unpack_from("<4sII", data)
    if magic != b"glTF" or version != 2 or length != len(data):
        raise ValueError("it is not a whole .glb of version 2")
    size, kind = struct.unpack_from("<II", data, 12)
    if kind != JSON_CHUNK or 20 + size > len(data):
        raise ValueError("its description is cut off")
    description = json.loads(data[20 : 20 + size])
    if needed := set(map(str, description.get("extensionsRequired", ()))) - READABLE:
        raise ValueError(f"it needs {', '.join(sorted(needed))}")
    buffer = b""
    if 20 + size < len(data):
        length, kind = struct.unpack_from("<II", data, 20 + size)
        buffer = data[28 + size :]
        if kind != BINARY_CHUNK or length != len(buffer):
            raise ValueError("its buffer is cut off")
    return Document(description=description, buffer=buffer)


def read_asset(document: Document, rest: str) -> PlainAsset:
    """The first node that has a mesh, with as much as the file gives it; or all of a person's parts."""
    nodes = [node for node in document.description["nodes"] if "mesh" in node]
    if not nodes:
        raise ValueError("it has no mesh")
    names = document.description.get("asset", {}).get("extras", {}).get("parts", ())
    by_name = {node.get("name"): node for node in nodes}
    if not names or not set(names) <= by_name.keys():
        return read_mesh(document, nodes[0], rest)
    parts = {name: read_mesh(document, by_name[name], rest) for name in names}
    from assets.asset.parts import join  # most files hold one mesh

    rigged = {name: part for name, part in parts.items() if isinstance(part, Asset)}
    return join(rigged) if len(rigged) == len(parts) else read_mesh(document, nodes[0], rest)


def read_mesh(document: Document, node: Any, rest: str) -> PlainAsset:
    """A node's mesh."""
    description = document.description
    primitive = item(description["meshes"], node["mesh"])["primitives"][0]
    if primitive.get("mode", 4) != 4:
        raise ValueError("the mesh is no triangles")
    attributes = primitive["attributes"]
    vertices = document.numbers(attributes["POSITION"], 3)
    plain = PlainAsset(
        vertices=vertices if "skin" in node else placed(vertices, node),
        normals=document.directions(attributes["NORMAL"], 3),
        faces=columns(document.array(primitive["indices"]), 1).astype(np.int64).reshape(-1, 3),
        info=read_info(description.get("asset", {})),
    )
    if "TEXCOORD_0" not in attributes:
        return plain
    material = item(description["materials"], primitive["material"])
    normal_map = None
    if "normalTexture" in material and "TANGENT" in attributes:
        normal_map = NormalMap(
            texels=read_picture(document, material["normalTexture"]),
            tangents=document.directions(attributes["TANGENT"], 4),
        )
    occlusion = None
    if "occlusionTexture" in material:
        occlusion = read_picture(document, material["occlusionTexture"])[..., 0]
    textured = TexturedAsset(
        **vars(plain),
        uv=np.clip(document.numbers(attributes["TEXCOORD_0"], 2), 0, 1),
        texture=read_picture(document, material["pbrMetallicRoughness"]["baseColorTexture"]),
        normal_map=normal_map,
        occlusion=occlusion,
    )
    if "skin" not in node:
        return textured
    skeleton, place = read_skeleton(document, item(description["skins"], node["skin"]), rest)
    return Asset(
        **vars(textured),
        joints=place[columns(document.array(attributes["JOINTS_0"]), 4).astype(np.int64)],
        weights=document.numbers(attributes["WEIGHTS_0"], 4),
        skeleton=skeleton,
        morphs=read_morphs(document, item(description["meshes"], node["mesh"]), len(vertices), place),
    )


def placed(vertices: Float32[np.ndarray, "W 3"], node: Any) -> Float32[np.ndarray, "W 3"]:
    """Where a mesh without a skin stands: rounded places lie in a cube that its node scales and moves."""
    scale = np.array(node.get("scale", (1, 1, 1)), dtype=np.float64)
    move = np.array(node.get("translation", (0, 0, 0)), dtype=np.float64)
    if scale.shape != (3,) or move.shape != (3,) or not (scale == scale[0]).all() or not scale[0] > 0:
        raise ValueError("the mesh's node is scaled unevenly, or has no place")
    with np.errstate(all="ignore"):  # whoever takes the vertices asks for finite ones
        return (vertices * scale + move).astype(np.float32)


def read_skeleton(document: Document, skin: Any, rest: str) -> tuple[Skeleton, Int64[np.ndarray, " J"]]:
    """The skeleton with parents before children, and for each joint of the file its place there."""
    nodes, members = document.description["nodes"], [whole(number) for number in skin["joints"]]
    if not 0 < len(members) <= MOST_JOINTS or len(set(members)) != len(members):
        raise ValueError(f"the skin names {len(members)} joints")
    parent_of = {whole(child): number for number, n in enumerate(nodes) for child in n.get("children", ())}
    lines = [ancestry(member, parent_of) for member in members]
    sequence = sorted(range(len(members)), key=lambda joint: len(lines[joint]))
    place = {members[joint]: index for index, joint in enumerate(sequence)}
    inverse_binds = document.array(skin["inverseBindMatrices"])[: len(members)].astype(np.float64)
    T_joint_world = inverse_binds.reshape(-1, 4, 4).transpose(0, 2, 1)[sequence]
    if not np.isfinite(T_joint_world).all() or (np.abs(np.linalg.det(T_joint_world)) < 1e-9).any():
        raise ValueError("a bind matrix has no inverse")
    found = [next((place[a] for a in lines[joint][1:] if a in place), -1) for joint in sequence]
    parents = np.array(found, dtype=np.int64)
    names = tuple(str(nodes[members[joint]].get("name", f"joint_{joint}")) for joint in sequence)
    skeleton = Skeleton(
        joint_names=names,
        parents=parents,
        T_world_joint=np.linalg.inv(T_joint_world),
        rest_rotations=world_rotations(named_pose(rest, names), parents),
    )
    return skeleton, np.argsort(sequence).astype(np.int64)


def ancestry(node: int, parent_of: dict[int, int]) -> list[int]:
    """A node, its parent, and so on up to the root."""
    line = [node]
    while line[-1] in parent_of:
        line.append(parent_of[line[-1]])
        if len(line) > MOST_JOINTS:
            raise ValueError("the nodes are deeper than any skeleton")
    return line


def read_picture(document: Document, texture_info: Any) -> UInt8[np.ndarray, "S S 3"]:
    """The picture that a material's texture shows."""
    texture = item(document.description["textures"], texture_info["index"])
    webp = texture.get("extensions", {}).get(WEBP, {})
    source = item(document.description["images"], webp["source"] if webp else texture["source"])
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # a picture of a size to fill the memory
            picture = Image.open(
                io.BytesIO(document.view(source["bufferView"])), formats=("PNG", "JPEG", "WEBP")
            )
            if picture.width != picture.height or picture.width > MOST_TEXELS:
                raise ValueError(f"the texture is {picture.width} x {picture.height}")
            return np.asarray(eight_bits(picture).convert("RGB"))
    except (UnidentifiedImageError, OSError, SyntaxError, Image.DecompressionBombError, Warning) as error:
        raise ValueError(f"the texture is damaged: {error}") from error


def read_info(header: Any) -> AssetInfo:
    """Where the file says it comes from; what it does not say stays empty."""
    extras = header.get("extras", {})
    return AssetInfo(
        seed=whole(extras.get("seed", 0)),
        weights_hash=str(extras.get("weights_hash", "")),
        version=str(extras.get("version", "")),
        licence=str(extras.get("licence", header.get("copyright", ""))),
        betas=tuple(float(beta) for beta in extras.get("betas", ())),
        height_m=float(extras["height_m"]) if "height_m" in extras else None,
        facts=read_facts(extras.get("attributes", {})),
    )


def read_facts(found: Any) -> tuple[tuple[str, str | int | float], ...]:
    """A person's attributes; those that are no words or numbers are left out."""
    pairs = found.items() if isinstance(found, dict) else ()
    return tuple((str(name), value) for name, value in pairs if isinstance(value, str | int | float))


def item(items: Any, number: Any) -> Any:
    """One of a list; a number below zero, which Python would count from the end, is none."""
    return items[whole(number)]


def whole(number: object) -> int:
    """A number that counts something."""
    if isinstance(number, bool) or not isinstance(number, int) or number < 0:
        raise ValueError(f"{number!r} is no index or count")
    return number


def columns(array: np.ndarray, width: int) -> np.ndarray:
    """An array of that many columns; floats stay what they are."""
    if array.shape[1] != width:
        raise ValueError(f"an attribute has {array.shape[1]} columns, not {width}")
    return array
