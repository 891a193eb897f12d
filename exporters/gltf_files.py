"""An asset as glTF 2.0 in several files: NAME.gltf (text), NAME.bin and the pictures."""

from urllib.parse import quote

import pygltflib as gltf

from assets.asset.asset import PlainAsset, TexturedAsset
from exporters import glb
from exporters.encoding import Encoding
from exporters.file import File


def encode(asset: PlainAsset, names: tuple[str, ...], encoding: Encoding) -> tuple[File, ...]:
    """The same document as in a .glb; it names the files beside it by relative addresses."""
    name, buffer_name, *picture_names = names
    document, data = glb.describe(asset, encoding, [quote(picture) for picture in picture_names])
    document.buffers = [gltf.Buffer(uri=quote(buffer_name), byteLength=len(data))]
    files = (File(name, document.to_json(indent=1).encode()), File(buffer_name, data))
    if isinstance(asset, TexturedAsset):
        return (*files, *glb.picture_files(asset, picture_names, encoding).values())
    return files
