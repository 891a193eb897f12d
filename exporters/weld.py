"""A mesh as it was before the texture's seams split it: closed, one vertex a place."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float32, Int64

from assets.asset.asset import PlainAsset


class Welded(NamedTuple):
    """V welded vertices with unit normals; `number` is the welded vertex of each of the W split ones."""

    vertices: Float32[np.ndarray, "V 3"]
    normals: Float32[np.ndarray, "V 3"]
    faces: Int64[np.ndarray, "F 3"]
    number: Int64[np.ndarray, " W"]


def weld(asset: PlainAsset) -> Welded:
    """The mesh without seams, where the asset knows them; else as it is."""
    number = np.arange(len(asset.vertices)) if asset.welded is None else asset.welded
    _, first, number = np.unique(number, return_index=True, return_inverse=True)
    return Welded(asset.vertices[first], asset.normals[first], number[asset.faces], number)
