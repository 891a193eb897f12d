"""A mesh as binary PLY, closed, with a normal and, where the asset has a texture, a colour at each vertex.
Metres, y up."""

import numpy as np
from jaxtyping import Float32, Float64, Int64, UInt8

from assets.asset.asset import PlainAsset, TexturedAsset
from exporters.obj import describe
from exporters.weld import weld

PLACE = [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("nx", "<f4"), ("ny", "<f4"), ("nz", "<f4")]
COLOUR = [("red", "u1"), ("green", "u1"), ("blue", "u1")]
PLY_TYPES = {"<f4": "float", "u1": "uchar"}


def encode(asset: PlainAsset) -> bytes:
    mesh = weld(asset)
    columns = PLACE + (COLOUR if isinstance(asset, TexturedAsset) else [])
    vertices = np.zeros(len(mesh.vertices), dtype=columns)
    for index, axis in enumerate("xyz"):
        vertices[axis], vertices[f"n{axis}"] = mesh.vertices[:, index], mesh.normals[:, index]
    if isinstance(asset, TexturedAsset):
        colours = vertex_colours(asset.texture, asset.uv, mesh.number)
        for index, (name, _) in enumerate(COLOUR):
            vertices[name] = colours[:, index]
    faces = np.zeros(len(mesh.faces), dtype=[("count", "u1"), ("vertices", "<i4", 3)])
    faces["count"], faces["vertices"] = 3, mesh.faces
    properties = "".join(f"property {PLY_TYPES[kind]} {name}\n" for name, kind in columns)
    header = (
        f"ply\nformat binary_little_endian 1.0\ncomment {describe(asset.info)[2:]}\n"
        f"element vertex {len(vertices)}\n{properties}"
        f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    return header.encode() + vertices.tobytes() + faces.tobytes()


def vertex_colours(
    texture: UInt8[np.ndarray, "S S 3"], uv: Float32[np.ndarray, "W 2"], number: Int64[np.ndarray, " W"]
) -> UInt8[np.ndarray, "V 3"]:
    """The texture's sRGB colour at each welded vertex, the mean of those on either side of a seam."""
    found = sample(texture, uv)
    count = np.bincount(number)[:, None]
    total = np.stack([np.bincount(number, weights=found[:, channel]) for channel in range(3)], axis=1)
    return np.rint(total / count).astype(np.uint8)


def sample(texture: UInt8[np.ndarray, "S S 3"], uv: Float32[np.ndarray, "W 2"]) -> Float64[np.ndarray, "W 3"]:
    """Bilinear between texel centres, clamped at the border; uv origin at the top left."""
    size = np.array(texture.shape[1::-1])
    place = np.clip(uv.astype(np.float64) * size - 0.5, 0, size - 1)
    low = np.floor(place).astype(np.int64)
    high = np.minimum(low + 1, size - 1)
    x, y = (place - low).T[..., None]
    upper = texture[low[:, 1], low[:, 0]] * (1 - x) + texture[low[:, 1], high[:, 0]] * x
    lower = texture[high[:, 1], low[:, 0]] * (1 - x) + texture[high[:, 1], high[:, 0]] * x
    return upper * (1 - y) + lower * y
