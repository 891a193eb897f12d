"""A textured mesh as Wavefront OBJ: NAME.obj, NAME.mtl and the pictures. Metres, y up.

The uv origin is at the bottom left there. A corner names its place, uv and normal apart, so the mesh stays
closed over the texture's seams.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float32, Int64

from assets.asset.asset import AssetInfo, PlainAsset, TexturedAsset
from exporters.encoding import Encoding
from exporters.file import File
from exporters.glb import picture_files
from exporters.weld import weld


def encode(asset: PlainAsset, names: tuple[str, ...], encoding: Encoding) -> tuple[File, ...]:
    """The mesh, and for a textured asset its material and texture."""
    name, material_name, *picture_names = names
    mesh = weld(asset)
    head = f"{describe(asset.info)}\n"
    places, normals = lines("v", mesh.vertices), lines("vn", mesh.normals)
    if not isinstance(asset, TexturedAsset):
        corners = faces(mesh.faces + 1, "{0}//{0}")
        return (File(name, "".join([head, "o avatar\n", places, normals, corners]).encode()),)
    uv = lines("vt", (asset.uv * [1, -1] + [0, 1]).astype(np.float32))
    corners = faces(np.stack([mesh.faces, asset.faces], axis=-1) + 1, "{0}/{1}/{0}")
    head += f"mtllib {material_name}\no avatar\n"
    text = "".join([head, places, uv, normals, "usemtl avatar\n", corners])
    files = picture_files(asset, picture_names, encoding)
    return (
        File(name, text.encode()),
        File(material_name, material([file.name for file in files.values()]).encode()),
        *files.values(),
    )


def describe(info: AssetInfo) -> str:
    """Where the mesh comes from, as one comment."""
    text = f"avatargen {info.version}, seed {info.seed}, weights {info.weights_hash}, {info.licence}"
    return f"# {' '.join(text.split())}"


def lines(keyword: str, rows: Float32[np.ndarray, "N D"]) -> str:
    """A line a row; nine digits give every float32 back."""
    pattern = f"{keyword} {' '.join(['%.9g'] * rows.shape[1])}\n"
    return "".join(pattern % tuple(row) for row in rows.tolist())


def faces(corners: Int64[np.ndarray, "F 3 *indices"], pattern: str) -> str:
    """A line a triangle; `pattern` says how a corner's indices are written."""
    rows = corners.reshape(len(corners), 3, -1).tolist()
    return "".join(f"f {' '.join(pattern.format(*corner) for corner in row)}\n" for row in rows)


def material(picture_names: Sequence[str]) -> str:
    """Light is scattered, nothing shines; `norm` is what OBJ's readers call a normal map. They have no
    name for ambient occlusion."""
    maps = zip(("map_Kd", "norm"), picture_names, strict=False)
    lines = "".join(f"{keyword} {name}\n" for keyword, name in maps)
    return f"newmtl avatar\nKa 1 1 1\nKd 1 1 1\nKs 0 0 0\nNs 10\nd 1\nillum 1\n{lines}"
