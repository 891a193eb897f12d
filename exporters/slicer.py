"""A mesh as slicers take it. Formats without units are millimetres to them, and the plate is below z = 0."""

from dataclasses import replace

import numpy as np

from assets.asset.asset import PlainAsset

MILLIMETRES = 1000.0  # in a metre
Z_UP_FROM_Y_UP = np.array(
    [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]
)  # facing -y, the plate's front


def for_slicers(asset: PlainAsset) -> PlainAsset:
    """The asset's mesh in millimetres, z up and facing -y; what moves it is not for printing and stays."""
    vertices = asset.vertices.astype(np.float64) @ Z_UP_FROM_Y_UP.T * MILLIMETRES
    normals = asset.normals.astype(np.float64) @ Z_UP_FROM_Y_UP.T
    return replace(asset, vertices=vertices.astype(np.float32), normals=normals.astype(np.float32))
