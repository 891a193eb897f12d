"""An asset as glTF 2.0 in several files: NAME.gltf (text), NAME.bin and the texture."""

from urllib.parse import quote

import pygltflib as gltf

from assets.asset import PlainAsset, TexturedAsset
from exporters import glb
from exporters.file import File
from exporters.png import encode_png


def encode(asset: PlainAsset, names: tuple[str, ...]) -> tuple[File, ...]:
    """The same document as in a .glb; it names the files beside it by relative addresses."""
    name, buffer_name, texture_name = names
    document, data = glb.describe(asset, picture_uri=quote(texture_name))
    document.buffers = [gltf.Buffer(uri=quote(buffer_name), byteLength=len(data))]
    files = (File(name, document.to_json(indent=1).encode()), File(buffer_name, data))
    if isinstance(asset, TexturedAsset):
        return (*files, File(texture_name, encode_png(asset.texture)))
    return files
