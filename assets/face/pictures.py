"""An asset's pictures with squares for what is inside: colours of a mouth and of lids, and an eye.

Letters: S texels along a side, I vertices of mouth and eyes. Metres.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Float64, Shaped, UInt8

from assets.asset.asset import Asset
from assets.face.eye_picture import eye_picture, eye_uv, sampled
from assets.face.eyes import SOCKET
from assets.face.motions import Motions
from assets.face.opened import UV, OpenFace
from assets.face.swatch import MOUTH, Swatch

FLAT, OPEN = np.array([[128, 128, 255]]), np.array([255])  # texels of a normal map and of occlusion
ALONG_LIDS = (1e-3, 2.5e-3)  # m from their margins


def with_pictures(asset: Asset, face: OpenFace, for_eyes: Swatch, for_mouth: Swatch) -> Asset:
    """The asset with an eye and the colours of the inside in its texture, and nothing there in others."""

    def blank(picture: UInt8[np.ndarray, "S S *C"], texel: Shaped[np.ndarray, "1 *C"]) -> np.ndarray:
        return for_eyes.painted(for_mouth.painted(picture, texel), texel)

    colours = np.concatenate([MOUTH, rim_colour(asset, face)[None]])
    eye = eye_picture(asset.texture, face, for_eyes.texels(len(asset.texture)))
    normal_map = asset.normal_map
    return replace(
        asset,
        texture=for_eyes.shown(for_mouth.painted(asset.texture, colours), eye),
        occlusion=None if asset.occlusion is None else blank(asset.occlusion, OPEN),
        normal_map=normal_map and replace(normal_map, texels=blank(normal_map.texels, FLAT)),
    )


def rim_colour(asset: Asset, face: OpenFace) -> Float64[np.ndarray, "3"]:
    """The median colour of the skin along the lids."""
    off = np.minimum(*(face.curves.outside(face.mesh.places, eye) for eye in (0, 1)))
    skin = (off > ALONG_LIDS[0]) & (off < ALONG_LIDS[1])
    return np.median(sampled(asset.texture, face.mesh.values[skin, UV]), axis=0)


def inner_uv(motions: Motions, for_eyes: Swatch, for_mouth: Swatch) -> Float64[np.ndarray, "I 2"]:
    """Where mouth and eyes read the pictures."""
    kinds, first = motions.kind[motions.skin :], motions.eyes.first - motions.skin
    found = for_mouth.uv(np.minimum(kinds, SOCKET), motions.at[motions.skin :])
    balls = np.flatnonzero(kinds > SOCKET)
    found[balls] = eye_uv(motions.eyes, for_eyes)[balls - first]
    return found
