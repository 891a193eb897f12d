"""An asset with its morphs at some weights. Letters: W vertices."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from assets.asset.asset import Asset


def has_face(asset: Asset) -> bool:
    """Whether there are shapes of a face: morphs that say how normals turn."""
    return any(morph.normals is not None for morph in asset.morphs)


def shaped(asset: Asset, weights: Mapping[str, float]) -> Asset:
    """The asset whose vertices stand as these weights have them; its morphs go on from there. Joints stay."""
    given = [(morph, weights[morph.name]) for morph in asset.morphs if weights.get(morph.name)]
    if not given:
        return asset
    vertices, normals = asset.vertices.astype(np.float64), asset.normals.astype(np.float64)
    for morph, weight in given:
        vertices += weight * morph.vertices
        if morph.normals is not None:
            normals += weight * morph.normals
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)
    return replace(asset, vertices=vertices.astype(np.float32), normals=normals.astype(np.float32))


def with_played_morphs(asset: Asset) -> Asset:
    """The asset with those morphs alone that an animation moves: a fraction of the bytes."""
    weighed = [animation.weights for animation in asset.animations if animation.weights is not None]
    moved = np.zeros(len(asset.morphs), bool)
    for weights in weighed:
        moved |= weights.any(axis=0)
    return replace(
        asset,
        morphs=tuple(morph for morph, used in zip(asset.morphs, moved, strict=True) if used),
        animations=tuple(
            replace(animation, weights=None if animation.weights is None else animation.weights[:, moved])
            for animation in asset.animations
        ),
    )
