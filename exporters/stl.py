"""A mesh as binary STL: triangles alone. STL has no place for unit and upward axis; its header says them."""

import numpy as np

from assets.asset.asset import PlainAsset
from exporters.encoding import PLAIN, Encoding

HEADER_BYTES = 80
TRIANGLE = [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")]


def encode(asset: PlainAsset, encoding: Encoding = PLAIN) -> bytes:
    corners = asset.vertices[asset.faces].astype(np.float64)
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(across, axis=1, keepdims=True)
    triangles = np.zeros(len(corners), dtype=TRIANGLE)
    triangles["normal"] = across / np.maximum(length, 1e-30)  # a face without area keeps 0, as STL wants
    triangles["corners"] = corners
    info = asset.info
    # a binary STL must not begin with "solid"
    header = f"avatargen {info.version}, seed {info.seed}, {encoding.axes}, {info.licence}"
    start = header.encode("ascii", "replace")[:HEADER_BYTES].ljust(HEADER_BYTES, b" ")
    return start + np.uint32(len(triangles)).astype("<u4").tobytes() + triangles.tobytes()
