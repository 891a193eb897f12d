"""Numbers as colours on an asset: what a joint moves, how far the mesh is from the field.

A painted asset is an ordinary textured one: its texture is a scale of colours and each vertex's uv is its
place on it. So colours blend along the scale, and every exporter and picture shows them. Letters: W vertices,
F faces, J joints.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Float, Float64, UInt8

from assets.asset.asset import Asset, TexturedAsset
from assets.errors import GeometryError
from assets.field import Field
from assets.mesh.measure import face_errors
from assets.mesh.surface import Surface

STEPS = 256  # colours of a scale
HEAT = ("#26456e", "#3a87a7", "#7bc6a4", "#f7e89b", "#f08a4b", "#b2182b")  # from none to most
PLAIN = ("#b9babd", "#b9babd")  # one colour: shape alone


def painted(
    asset: TexturedAsset, values: Float[np.ndarray, " W"], colors: tuple[str, ...] = HEAT
) -> TexturedAsset:
    """The asset in the colours of values from 0 to 1; what lies beyond has the colour of the nearer end."""
    place = 0.5 / STEPS + np.clip(values, 0, 1) * (1 - 1 / STEPS)
    uv = np.stack([place, np.full(len(place), 0.5)], axis=1).astype(np.float32)
    return replace(asset, uv=uv, texture=scale(colors), normal_map=None, occlusion=None)


def scale(colors: tuple[str, ...]) -> UInt8[np.ndarray, "S S 3"]:
    """A texture that runs through the colours from left to right."""
    stops = np.array([[int(color[i : i + 2], 16) for i in (1, 3, 5)] for color in colors], dtype=np.float64)
    place = np.linspace(0, len(stops) - 1, STEPS)
    row = np.stack([np.interp(place, np.arange(len(stops)), channel) for channel in stops.T], axis=1)
    return np.broadcast_to(np.rint(row).astype(np.uint8), (STEPS, STEPS, 3)).copy()


def joint_weights(asset: Asset, joint: str) -> Float64[np.ndarray, " W"]:
    """How much of each vertex the joint of that name moves, 0 to 1."""
    number = asset.skeleton.joint_names.index(joint)
    return np.where(asset.joints == number, asset.weights, 0).sum(axis=1, dtype=np.float64)


def vertex_errors(asset: TexturedAsset, sdf: Field) -> Float64[np.ndarray, " W"]:
    """Distance of the mesh to the field around each vertex, millimetres: the largest of its faces' middles.

    Raises:
        GeometryError: the asset was not built from a field, so nobody knows where its vertices were.
        FieldError: the field is NaN or infinite.
    """
    if asset.canonical is None:
        raise GeometryError(
            "paint: the asset does not say where in the field it was; build it from an avatar"
        )
    surface = Surface(vertices=asset.canonical.astype(np.float64), faces=asset.faces)
    errors = np.zeros(len(asset.vertices))
    np.maximum.at(errors, asset.faces.reshape(-1), np.repeat(face_errors(surface, sdf), 3))
    return errors
