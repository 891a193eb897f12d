"""An asset as glTF 2.0 in several files: NAME.gltf (text), NAME.bin and the pictures."""

from urllib.parse import quote

import pygltflib as gltf

from assets.asset import PlainAsset, TexturedAsset
from exporters import glb
from exporters.file import File
from exporters.png import encode_png


def encode(asset: PlainAsset, names: tuple[str, ...]) -> tuple[File, ...]:
    """The same document as in a .glb; it names the files beside it by relative addresses."""
    name, buffer_name, *picture_names = names
    document, data = glb.describe(asset, [quote(picture) for picture in picture_names])
    document.buffers = [gltf.Buffer(uri=quote(buffer_name), byteLength=len(data))]
    files = (File(name, document.to_json(indent=1).encode()), File(buffer_name, data))
    if isinstance(asset, TexturedAsset):
        pictures = zip(picture_names, glb.pictures(asset).values(), strict=False)  # not all have each
        return (*files, *(File(picture, encode_png(pixels)) for picture, pixels in pictures))
    return files
