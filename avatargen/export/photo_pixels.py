"""The photographs' own pixels on the texture of the person found in them.

Letters: W vertices, T texels, S texels along a side, H L pixels, K landmarks of a body, M of a face.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float32, Float64, UInt8
from scipy.ndimage import binary_dilation

from assets.asset.asset import TexturedAsset
from assets.picture.preview import sample_texture
from assets.texture.atlas import Atlas
from assets.texture.bake import TexelMap, map_texels
from avatargen.body.model import CanonicalBody
from avatargen.photo.face_shift import face_shift
from avatargen.photo.pixels import Shown, evened, of_one_stuff, scene_of, show, trust
from avatargen.photo.problem import Fit
from avatargen.photo.resembling.pieces import Dresser
from avatargen.photo.seeing.face import find_face
from avatargen.photo.seeing.network import Network
from avatargen.photo.sighting import Sighting

GAMMA = 2.2  # of `sample_texture`'s linear light
AROUND, BEHIND = 0.02, 128  # of the person's height, that is kept around the outline; grey beyond


@dataclass(frozen=True, kw_only=True, eq=False)
class Look:
    """What a photograph gives to a texture: sRGB pixels of the person, grey elsewhere; where the person is,
    0..1; landmarks of body and face, pixels; and the body fitted to them."""

    pixels: UInt8[np.ndarray, "H L 3"]
    mask: Float32[np.ndarray, "H L"]
    landmarks: Float64[np.ndarray, "K 2"]
    face: Float64[np.ndarray, "M 2"] | None
    fit: Fit


def look_of(sighting: Sighting, fit: Fit) -> Look:
    """A sighting without what is not the person, its mask in 255 steps as files hold it."""
    steps = np.rint(255 * sighting.mask.clip(0, 1)).astype(np.uint8)
    rows = np.flatnonzero((sighting.mask > 0.5).any(axis=1))
    near = binary_dilation(steps > 0, iterations=max(round(AROUND * len(rows)), 1))
    return Look(
        pixels=np.where(np.asarray(near)[..., None], sighting.picture.pixels, np.uint8(BEHIND)),
        mask=steps.astype(np.float32) / 255,
        landmarks=sighting.pixels,
        face=sighting.face,
        fit=fit,
    )


def painted(
    asset: TexturedAsset,
    body: CanonicalBody,
    looks: Sequence[Look],
    stuffs: Float64[np.ndarray, "N 3"],
    face: Network | None = None,
) -> TexturedAsset:
    """The asset, where photographs show it well in their own colours; where several do, the best one's most.
    `stuffs` are the colours that the person has, CIELAB. With the face network, features of the face lie
    where the asset has them."""
    assert asset.canonical is not None
    texels = map_texels(
        Atlas(vertex_map=np.arange(len(asset.vertices)), uv=asset.uv, faces=asset.faces), len(asset.texture)
    )
    dresser = Dresser(body)
    shown = [
        shown_by(asset, texels, dresser.move(asset.canonical, look.fit), look, stuffs, face) for look in looks
    ]
    return replace(asset, texture=blended(asset.texture, texels, shown))


def shown_by(
    asset: TexturedAsset,
    texels: TexelMap,
    vertices: Float64[np.ndarray, "W 3"],
    look: Look,
    stuffs: Float64[np.ndarray, "N 3"],
    face: Network | None,
) -> Shown:
    """The texels that filtering reads, in one photograph."""
    pixels, mask = look.pixels, look.mask
    scene = scene_of(vertices, asset.faces, look.fit.camera)
    tall = float((mask > 0.5).any(axis=1).sum())
    trusted = trust(scene.seen, mask, tall)
    own = np.zeros(pixels.shape)
    at = scene.seen.mask
    own[at] = sample_texture(asset, scene.seen.face[at], scene.seen.barycentric[at]).clip(0, 1) ** (1 / GAMMA)
    built = np.where(at[..., None], np.rint(255 * own), pixels).astype(np.uint8)
    shift = None if face is None else face_shift(find_face(face, built, look.landmarks), look.face)
    alike = of_one_stuff(pixels, own, stuffs, trusted, tall)
    if shift is not None:  # glasses and beards are no other stuff
        alike = np.maximum(alike, trusted * shift.cover(*trusted.shape))
    photograph = evened(pixels, own, alike, tall)
    asked = texels.asked
    return show(scene, texels.face[asked], texels.barycentric(asked), photograph, alike, shift)


def blended(
    texture: UInt8[np.ndarray, "S S 3"], texels: TexelMap, shown: Sequence[Shown]
) -> UInt8[np.ndarray, "S S 3"]:
    """The texture with what is shown laid over it."""
    values = texture.reshape(-1, 3).astype(np.float64)
    weights = np.stack([each.weight**2 for each in shown])
    most = np.max([each.weight for each in shown], axis=0)
    colors = np.einsum("pt,ptc->tc", weights, np.stack([each.color for each in shown]))
    colors /= np.maximum(weights.sum(axis=0), 1e-9)[:, None]
    old = values[texels.asked]
    values[texels.asked] = old + most[:, None] * (255 * colors - old)
    return texels.spread(np.rint(values).astype(np.uint8).reshape(texture.shape))
